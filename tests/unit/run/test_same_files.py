"""Ranks whose hosts have other files are refused: what differs, and where."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import pytest

from wall.config.loading import loads
from wall.core.errors import ConfigError
from wall.roles.plan import Layout, make_layout
from wall.run import same_files
from wall.run.same_files import check_same, differences, fingerprints

TEXT = """\
version: 1
scene: {source: [courtyard, cow.obj]}
wall: {grid: {columns: 2, rows: 1, pixels: [64, 48], size: [0.4, 0.3]}}
views: [{camera: auto}]
"""
COW = "mtllib skin.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"


class Ranks:
    """A rank's side of a launch in which each says what it has; what the head sends comes in two parts."""

    def __init__(self, *layouts: Layout, rank: int = 0, sent: tuple[bytes, ...] = ()) -> None:
        self._layouts, self.rank, self._sent = layouts, rank, list(sent)
        self.files = list[bytes]()  # that the head has sent

    def allgather(self, text: str) -> list[str]:
        said = [json.dumps(fingerprints(layout)) for layout in self._layouts]
        assert said[self.rank] == text
        return said

    def shared(self, data: bytes | None) -> Iterator[bytes]:
        whole = self._sent.pop(0) if data is None else data
        self.files.append(whole)
        yield from (whole[:7], whole[7:])


def on_host(folder: Path, text: str = TEXT, *, skin: str | None = "newmtl skin\n", cow: str | None = COW) -> Layout:
    """The layout of a host whose files are these."""
    folder.mkdir()
    if cow is not None:
        (folder / "cow.obj").write_text(cow)
    if skin is not None:
        (folder / "skin.mtl").write_text(skin)
    return make_layout(loads(text, name="wall.yaml", path=folder / "wall.yaml"))


def test_ranks_with_the_same_files_pass(tmp_path: Path) -> None:
    check_same(Ranks(*(on_host(tmp_path / name) for name in "abc")), on_host(tmp_path / "d"), ["node1"] * 3)


def test_files_that_differ_are_named_with_the_host_once_and_other_ranks_end_without_a_word(tmp_path: Path) -> None:
    own, same = on_host(tmp_path / "a"), on_host(tmp_path / "b")
    other = on_host(tmp_path / "c", TEXT.replace("64, 48", "64, 50"), skin="newmtl other\n")
    bare = on_host(tmp_path / "d", skin=None)
    layouts, machines = (own, same, other, other, bare), ["node1", "node1", "node2", "node2", "node3"]

    with pytest.raises(ConfigError) as refused:
        check_same(Ranks(*layouts), own, machines)
    with pytest.raises(SystemExit):
        check_same(Ranks(*layouts, rank=4), bare, machines)
    assert not (tmp_path / "d/skin.mtl").exists(), "nothing is sent before a refusal"

    there = "on node1 (rank 0) it is another one; wanted: the same on all hosts"
    assert str(refused.value).splitlines() == [
        f"configuration wall.yaml: differs on node2 (rank 2); {there}",
        f"file skin.mtl: differs on node2 (rank 2), is missing on node3 (rank 4); {there}",
    ]


def test_what_a_host_lacks_is_sent_there_once_with_what_it_names(tmp_path: Path) -> None:
    skin = "newmtl skin\nmap_Kd -s 1 1 1 hide.png\n"
    head = on_host(tmp_path / "a", skin=skin)
    (tmp_path / "a/hide.png").write_bytes(b"an image")
    other, beside = (on_host(tmp_path / name, skin=None, cow=None) for name in "bc")
    (tmp_path / "c").rmdir()
    (tmp_path / "c").symlink_to(tmp_path / "b")  # another rank of that host
    sent = (COW.encode(), skin.encode(), b"an image")
    machines = ["node1", "node2", "node2"]

    notes = check_same(Ranks(head, other, beside, rank=1, sent=sent), other, machines)

    assert notes == ["cow.obj was sent to node2", "skin.mtl was sent to node2", "hide.png was sent to node2"]
    assert [(tmp_path / "b" / name).read_bytes() for name in ("cow.obj", "skin.mtl", "hide.png")] == list(sent)
    assert sorted(path.name for path in (tmp_path / "b").iterdir()) == ["cow.obj", "hide.png", "skin.mtl"]


def test_the_head_sends_what_others_lack_and_refuses_what_stays_missing(tmp_path: Path) -> None:
    head, other = on_host(tmp_path / "a"), on_host(tmp_path / "b", skin=None)
    ranks = Ranks(head, other)
    with pytest.raises(ConfigError, match=r"skin\.mtl: is missing on node2 \(rank 1\); on node1 .* there is one"):
        check_same(ranks, head, ["node1", "node2"])
    assert ranks.files == [b"newmtl skin\n"], "once"


def test_what_is_there_and_cannot_be_read_is_not_replaced(tmp_path: Path) -> None:
    """A link to a file that this machine lacks is not its folder's to change."""
    head, other = on_host(tmp_path / "a"), on_host(tmp_path / "b", skin=None)
    (tmp_path / "b/skin.mtl").symlink_to(tmp_path / "elsewhere/skin.mtl")
    (tmp_path / "elsewhere").write_text("no folder")
    with pytest.raises(SystemExit):
        check_same(Ranks(head, other, rank=1, sent=(b"newmtl skin\n",)), other, ["node1", "node2"])
    assert (tmp_path / "b/skin.mtl").is_symlink()
    assert sorted(path.name for path in (tmp_path / "b").iterdir()) == ["cow.obj", "skin.mtl"]


def test_names_that_no_file_can_have_are_missing(tmp_path: Path) -> None:
    layout = on_host(tmp_path / "a", skin="newmtl skin\nmap_Kd a\0b.png\n")
    assert fingerprints(layout)["file a\0b.png"] == same_files.MISSING


def test_what_cannot_be_written_is_taken_in_nevertheless(tmp_path: Path) -> None:
    """Or all other ranks would wait for this one."""
    head, other = on_host(tmp_path / "a"), on_host(tmp_path / "b", skin=None)
    (tmp_path / "b").rename(tmp_path / "gone")
    (tmp_path / "b").write_text("a file in the folder's place")
    ranks = Ranks(head, other, rank=1, sent=(COW.encode(), b"newmtl skin\n") * 2)
    with pytest.raises(SystemExit):
        check_same(ranks, other, ["node1", "node2"])
    assert ranks.files == [COW.encode()], "once"


def test_another_program_is_another_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    layout = on_host(tmp_path / "a")
    before = fingerprints(layout)
    (tmp_path / "newer.py").write_text("")
    monkeypatch.setattr(same_files, "PROGRAM", tmp_path)
    [line] = differences([before, fingerprints(layout)], ["node1", "node2"])
    assert line.startswith("the program (wall ")
