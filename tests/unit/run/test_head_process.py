"""The head's process: whatever fails at the end, everything is closed and the summary is written."""

from __future__ import annotations

import json
import os
import signal
from functools import partial
from pathlib import Path

import pytest
from flat_batches import plan_of

from wall.core.errors import RunError
from wall.display.base import Sink, Status, WallImage
from wall.display.saving import Saver
from wall.run import head
from wall.run.bootstrap_threads import ThreadBootstrap
from wall.run.succession import Preparer


class Reader:
    """A sink that reads the summary while the run goes on, and ends the run as its user would."""

    def __init__(self, summary: Path) -> None:
        self.summary, self.ended = summary, set[str]()

    def show(self, image: WallImage, status: Status) -> None:
        if self.summary.exists():
            self.ended.add(json.loads(self.summary.read_text())["ended"])
            os.kill(os.getpid(), signal.SIGHUP)

    def close(self) -> None:
        os.kill(os.getpid(), signal.SIGINT)  # a second Ctrl-C, at the worst moment

    def dropped(self) -> dict[str, int]:
        return {}


def test_summary_is_there_while_the_run_goes_on_and_after_a_hang_up(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, as_in_a_terminal: None
) -> None:
    sink = Reader(tmp_path / "summary.json")
    plan = plan_of()
    monkeypatch.setattr(head, "make_sinks", lambda *args, **options: ([sink] * len(plan.layout.graph.sinks), None))
    monkeypatch.setattr(head, "Saver", partial(Saver, every_s=0.01))
    bootstrap = ThreadBootstrap.start(1, lambda _: None)

    outcome = head.lead(plan, bootstrap, Preparer(plan, ["", ""]), head.Options(out=tmp_path, seconds=30.0), str, str)

    assert "running" in sink.ended
    assert json.loads(sink.summary.read_text()) == outcome.summary
    assert outcome.summary["ended"] == "its terminal was closed"


FULL = "panel.png: no space left on device"


class FullDisk:
    """A sink that can show, but not write what it has to write at the end."""

    def __init__(self, *, shows: bool) -> None:
        self.shows, self.closed = shows, 0

    def show(self, image: WallImage, status: Status) -> None:
        if not self.shows:
            raise RunError(FULL)

    def close(self) -> None:
        self.closed += 1
        raise RunError(FULL)

    def dropped(self) -> dict[str, int]:
        return {}


@pytest.mark.parametrize("fails_while_running", [False, True])
def test_after_a_full_disk_all_is_closed_and_the_summary_is_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, fails_while_running: bool
) -> None:
    sinks: list[Sink | None] = [FullDisk(shows=not fails_while_running) for _ in range(2)]
    plan = plan_of()
    monkeypatch.setattr(head, "make_sinks", lambda *args, **options: (sinks[: len(plan.layout.graph.sinks)], None))
    bootstrap = ThreadBootstrap.start(1, lambda _: None)

    options = head.Options(out=tmp_path, seconds=30.0 if fails_while_running else 0.1)
    outcome = head.lead(plan, bootstrap, Preparer(plan, ["", ""]), options, str, str)

    summary = json.loads((tmp_path / "summary.json").read_text())
    assert summary == outcome.summary
    assert summary["ended"] == ("the head's compositor failed" if fails_while_running else "time is up")
    assert FULL in outcome.failed
    assert all(sink.closed for sink in sinks[: len(plan.layout.graph.sinks)] if isinstance(sink, FullDisk))
