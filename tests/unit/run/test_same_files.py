"""Ranks whose hosts have other files are refused: what differs, and where."""

from __future__ import annotations

import json
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
    """The head's side of a launch in which each rank says what it has."""

    def __init__(self, *layouts: Layout, rank: int = 0) -> None:
        self._layouts, self.rank = layouts, rank

    def allgather(self, text: str) -> list[str]:
        said = [json.dumps(fingerprints(layout)) for layout in self._layouts]
        assert said[self.rank] == text
        return said


def on_host(folder: Path, text: str = TEXT, *, skin: str | None = "newmtl skin\n") -> Layout:
    """The layout of a host whose files are these."""
    folder.mkdir()
    (folder / "cow.obj").write_text(COW)
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

    there = "on node1 (rank 0) it is another one; wanted: the same on all hosts"
    assert str(refused.value).splitlines() == [
        f"configuration wall.yaml: differs on node2 (rank 2); {there}",
        f"file skin.mtl: differs on node2 (rank 2), is missing on node3 (rank 4); {there}",
    ]


def test_another_program_is_another_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    layout = on_host(tmp_path / "a")
    before = fingerprints(layout)
    (tmp_path / "newer.py").write_text("")
    monkeypatch.setattr(same_files, "PROGRAM", tmp_path)
    [line] = differences([before, fingerprints(layout)], ["node1", "node2"])
    assert line.startswith("the program (wall ")
