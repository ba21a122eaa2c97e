"""The end of a run: while the last view is held, the head goes on to send what other compositors need of it."""

from __future__ import annotations

from pathlib import Path

from wall.config.loading import loads
from wall.packets.control import parse_control
from wall.packets.framelets import FrameletPart
from wall.roles.head import HOLD_S, Head
from wall.roles.plan import make_layout, make_plan
from wall.run.bootstrap_threads import ThreadBootstrap
from wall.run.clock import ManualClock
from wall.transport.loopback import LoopbackHub, LoopbackLink

TEXT = """\
version: 1
scene: {source: courtyard}
wall: {grid: {columns: 1, rows: 1, pixels: [32, 24], size: [0.4, 0.3]}}
views: [{camera: {position: [6, 4.5, 10], target: [0, 0.6, 0]}}]
sampling: {method: adaptive}
graph:
  compositors: 2
  nodes:
    - {id: s, op: samples, panel: r0c0}
    - {id: objects, op: reconstruct, input: s, background: transparent, on: compositor 1}
    - {id: sky, op: sky, panel: r0c0, on: head}
    - {id: picture, op: depth, inputs: [objects, sky], on: compositor 1}
    - {id: files, op: sink, kind: png, input: picture}
"""


class TickingClock(ManualClock):
    """Time goes on whenever somebody looks."""

    def now(self) -> float:
        self.advance(HOLD_S / 8)
        return super().now()


def test_what_the_head_makes_while_the_view_is_held_reaches_the_compositor_that_shows_it() -> None:
    plan = make_plan(make_layout(loads(TEXT, path=Path("wall.yaml"))))
    hubs = [LoopbackHub(credit_bytes=1 << 16) for _ in range(3)]
    link = LoopbackLink(hubs[2].endpoint)
    bootstrap = ThreadBootstrap.start(1, lambda _: None)
    head = Head(plan, bootstrap, hubs[0], hubs[1], TickingClock(), {1: link}, [None], list, still=True)

    head._hold()

    (part,) = [parse_control(packet) for _, packet in hubs[2].drain(1 << 20)]
    assert isinstance(part, FrameletPart)
    assert part.step == plan.layout.graph.step("sky").index
    link.close()
    for hub in hubs:
        hub.close()
