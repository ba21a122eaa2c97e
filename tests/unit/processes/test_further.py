"""A compositor beside the head, as its thread runs: over loopback, with the head's end in the test's hands."""

from __future__ import annotations

from pathlib import Path

import pytest

from wall.config.loading import loads
from wall.packets.control import Stop, serialise
from wall.processes.control import Control
from wall.processes.further import FurtherCompositor
from wall.processes.plan import HEAD, Plan, make_layout, make_plan
from wall.transport.loopback import LoopbackHub, LoopbackLink

RANK = 1
TEXT = """\
version: 1
scene: {source: courtyard}
wall: {grid: {columns: 2, rows: 1, pixels: [32, 24], size: [0.4, 0.3]}}
views: [{camera: {position: [6, 4.5, 10], target: [0, 0.6, 0]}, refresh_hz: 20}]
graph: {compositors: 2, sinks: [png]}
"""


@pytest.fixture(scope="module")
def plan() -> Plan:
    return make_plan(make_layout(loads(TEXT, path=Path("wall.yaml"))))


class Ends:
    """The head's control hub, and the compositor at the other end of it."""

    def __init__(self, plan: Plan) -> None:
        self.head, self.data = LoopbackHub(credit_bytes=1 << 20), Waiting(self)
        self.control = Control(LoopbackLink(self.head.endpoint), plan, RANK, same_clock=True)
        links = {HEAD: LoopbackLink(LoopbackHub(credit_bytes=1 << 20).endpoint)}
        self.further = FurtherCompositor(plan, RANK, self.data, self.control, links, [])


class Waiting(LoopbackHub):
    """Writes down for how long it was asked to wait instead of waiting, and has the head stop the run in the end."""

    def __init__(self, ends: Ends) -> None:
        super().__init__(credit_bytes=1 << 20)
        self._ends, self.waits = ends, list[float]()

    def wait(self, seconds: float) -> None:
        self.waits.append(seconds)
        if len(self.waits) == 5:
            self._ends.head.broadcast(serialise(Stop(reason="time is up")))


def test_before_the_first_event_it_waits_instead_of_spinning(plan: Plan) -> None:
    ends = Ends(plan)
    ends.further.run()
    assert set(ends.data.waits) == {0.02}
