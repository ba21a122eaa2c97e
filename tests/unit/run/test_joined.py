"""What a process is told that joins: it makes the run's layout of it, or says which of its files are others."""

from __future__ import annotations

import errno
import time
from dataclasses import replace
from pathlib import Path

import pytest

from wall.config.loading import load
from wall.core.errors import ConfigError
from wall.packets.joining import JoinAnswer
from wall.roles.instructions import Invitation
from wall.roles.plan import Layout, Plan, make_layout, make_plan, reconstructed_at_renderers
from wall.run import joined
from wall.run.joined import Inviter, Told, as_given
from wall.run.same_files import fingerprints
from wall.transport.curve import KeyPair, Keys

TEXT = """\
version: 1
scene: {source: cow.obj}
wall: {grid: {columns: 2, rows: 1, pixels: [64, 48], size: [0.4, 0.3]}}
views: [{camera: {position: [0, 0, 9], target: [0, 0, 0]}}]
"""
COW = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"


@pytest.fixture
def plan(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Plan:
    """Of a configuration that was named relative to the folder in which the run was started."""
    (tmp_path / "cow.obj").write_text(COW)
    (tmp_path / "wall.yaml").write_text(TEXT)
    monkeypatch.chdir(tmp_path)
    return make_plan(reconstructed_at_renderers(make_layout(load(Path("wall.yaml"))), [""] * 3))


def invitation(plan: Plan, keys: Keys | None = None) -> Invitation:
    inviter, limit = Inviter([""] * 3, keys, headless=False), time.monotonic() + 10.0
    while not (made := list(inviter.look(plan))):
        assert time.monotonic() < limit
        time.sleep(0.001)
    assert list(inviter.look(plan)) == [], "of each configuration once"
    return made[0]


def test_files_that_cannot_be_read_are_read_again_later(plan: Plan, monkeypatch: pytest.MonkeyPatch) -> None:
    """As where a process may open no more files; a thread that dies of it would print a traceback."""
    tried: list[int] = []

    def refuse_twice(layout: Layout) -> dict[str, str]:
        tried.append(1)
        if len(tried) < 3:
            raise OSError(errno.EMFILE, "Too many open files")
        return fingerprints(layout)

    monkeypatch.setattr(joined, "RETRY_S", 0.0)
    monkeypatch.setattr(joined, "fingerprints", refuse_twice)
    assert invitation(plan).told == invitation(plan).told
    assert len(tried) == 4


def answer_of(invited: Invitation, **values: int) -> JoinAnswer:
    return JoinAnswer(client=1 << 32, number=1, configuration=invited.number, told=invited.told, **values)


def test_another_process_makes_the_same_layout_in_whatever_folder_it_stands(
    plan: Plan, tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch
) -> None:
    invited = invitation(plan)
    monkeypatch.chdir(tmp_path_factory.mktemp("elsewhere"))
    layout = Told(answer_of(invited)).layout()
    assert (layout.regions, layout.graph) == (plan.layout.regions, plan.layout.graph)
    assert all(layer.at_renderer for layer in layout.graph.layers)
    given = as_given(replace(plan, layout=layout), answer_of(invited, rank=3, extra=1, since=7))
    assert (given.layout.size, given.layout.regions_of(3), given.since) == (4, (), 7)


def test_files_that_changed_since_the_run_began_are_named(plan: Plan) -> None:
    told = Told(answer_of(invitation(plan)))
    Path("cow.obj").write_text(COW + "f 3 2 1\n")
    with pytest.raises(ConfigError, match=r"file cow.obj: differs on .* \(this process\); on .* \(rank 0\)"):
        told.layout()


def test_it_begins_with_its_own_keys_and_the_run_s(plan: Plan) -> None:
    own, run = KeyPair.new(), Keys.of_all(3)
    answer = answer_of(invitation(plan, run[0]), rank=2)
    begun = Told(answer).bootstrap(answer, plan, own, "tcp://head:1")
    assert begun.keys == Keys(own, run[0].ranks)
    assert begun.key == own.public
    assert '"manager": "tcp://head:1"' in begun.broadcast("")
    assert run[0].own.secret not in answer.told
