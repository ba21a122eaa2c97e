"""The head's process: whatever fails at the end, everything is closed and the summary is written."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from flat_batches import plan_of

from wall.core.errors import RunError
from wall.display.base import Sink, Status, WallImage
from wall.run import head
from wall.run.bootstrap_threads import ThreadBootstrap
from wall.run.succession import Preparer

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

    outcome = head.lead(plan, bootstrap, Preparer(plan, ["", ""]), head.Options(out=tmp_path, seconds=0.1), str, str)

    summary = json.loads((tmp_path / "summary.json").read_text())
    assert summary == outcome.summary
    assert summary["ended"] == ("the head's compositor failed" if fails_while_running else "time is up")
    assert FULL in outcome.failed
    assert all(sink.closed for sink in sinks[: len(plan.layout.graph.sinks)] if isinstance(sink, FullDisk))
