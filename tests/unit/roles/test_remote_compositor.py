"""A compositor beside the head, as its thread runs, over loopback."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import fields
from pathlib import Path

from x_servers import comes_true, press, x_server
from Xlib import XK

from wall.config.loading import loads
from wall.display.window import WindowSink
from wall.operators.overlay import PLACEHOLDERS, Overlay
from wall.packets.control import Hands, Statistics, Stop, parse_control, serialise
from wall.roles.head import Head, statistics_of
from wall.roles.manager import Manager
from wall.roles.plan import HEAD, Plan, make_layout, make_plan
from wall.roles.remote_compositor import RemoteCompositor
from wall.run.bootstrap_threads import ThreadBootstrap
from wall.run.clock import HeadClock
from wall.run.control import Control
from wall.run.sinks import make_sinks
from wall.transport.loopback import LoopbackHub, LoopbackLink

RANK = 1
TEXT = """\
version: 1
scene: {source: courtyard}
wall:
  panels:
    - id: far
      pixels: [120, 90]
      corners: {lower_left: [0, 0, 0], lower_right: [0.4, 0, 0], upper_left: [0, 0.3, 0]}
      display: DISPLAY
views: [{camera: {position: [6, 4.5, 10], target: [0, 0.6, 0]}, refresh_hz: 20}]
graph:
  compositors: 2
  nodes:
    - {id: samples, op: samples, panel: far}
    - {id: picture, op: reconstruct, input: samples, on: compositor 1}
    - {id: window, op: sink, kind: window, input: picture}
"""


OVERLAY = """\
input: text}
    - {id: text, op: overlay, input: picture, text: '{fps} {ranks}', on: compositor 1}
"""


def plan_on(display: str) -> Plan:
    return make_plan(make_layout(loads(TEXT.replace("DISPLAY", f'"{display}"'), path=Path("wall.yaml"))))


def hub() -> LoopbackHub:
    return LoopbackHub(credit_bytes=1 << 20)


def further_of(plan: Plan, head: LoopbackHub, data: LoopbackHub, *sinks: WindowSink | None) -> RemoteCompositor:
    """Linked to the head's control hub; fed by `data`."""
    control = Control(LoopbackLink(head.endpoint), plan, RANK, same_clock=True)
    return RemoteCompositor(plan, RANK, data, control, {HEAD: LoopbackLink(hub().endpoint)}, list(sinks))


@contextmanager
def window_of(plan: Plan) -> Iterator[WindowSink]:
    [sink], _ = make_sinks(plan, RANK, Path(), headless=False)
    assert isinstance(sink, WindowSink)
    try:
        yield sink
    finally:
        sink.close()


class Waits(LoopbackHub):
    """Writes down for how long it is asked to wait instead of waiting; at the fifth time the head stops the run."""

    def __init__(self, head: LoopbackHub) -> None:
        super().__init__(credit_bytes=1 << 20)
        self._head, self.seconds = head, list[float]()

    def wait(self, seconds: float) -> None:
        self.seconds.append(seconds)
        if len(self.seconds) == 5:
            self._head.broadcast(serialise(Stop(reason="time is up")))


def test_before_the_first_event_it_waits_instead_of_spinning() -> None:
    head = hub()
    data = Waits(head)
    further_of(plan_on(":0"), head, data).run()
    assert set(data.seconds) == {0.02}


def test_keys_at_a_window_away_from_the_head_steer_and_escape_is_told() -> None:
    with x_server("120x90") as display, window_of(plan := plan_on(display)) as window:
        head = hub()
        manager = Manager(plan, head, HeadClock(), list, still=True)
        loop = threading.Thread(target=further_of(plan, head, hub(), window).run)
        before = manager.event.camera
        manager.start()
        loop.start()
        try:
            press(display, XK.XK_Right, (60, 45))
            assert comes_true(lambda: manager.event.camera != before)
            press(display, XK.XK_Escape, (60, 45))
            assert comes_true(lambda: manager.escape == "Escape was pressed in the window of panel far")
        finally:
            manager.stop()
            loop.join()


def test_a_display_that_a_compositor_lost_is_told_and_counted() -> None:
    head = hub()
    with ExitStack() as windows:
        with x_server("120x90") as display:
            window = windows.enter_context(window_of(plan := plan_on(display)))
        further = further_of(plan, head, hub(), window)
        assert comes_true(lambda: window.gone)
        further._tell_hands(again=False)
        assert further._heartbeat(None, last=False).dropped.items() >= window.dropped().items() > set()
    assert parse_control(head.messages()[-1][1]) == Hands(rank=RANK, closed=True)


def test_an_overlay_away_from_the_head_shows_the_numbers_that_the_head_tells() -> None:
    plan = make_plan(
        make_layout(
            loads(TEXT.replace("DISPLAY", '":0"').replace("input: picture}\n", OVERLAY), path=Path("wall.yaml"))
        )
    )
    control_hub = hub()
    head = Head(plan, ThreadBootstrap.start(1, lambda _: None), hub(), control_hub, HeadClock(), {}, [], [], still=True)
    further = further_of(plan, control_hub, hub(), None)
    [index] = [step.index for step in plan.layout.graph.steps if isinstance(step.node, Overlay)]
    event = head._newest()
    further._refresh(event, event, 0.0)
    before = further._compositor._pictures.executor.framelets[index].colour.copy()
    head.manager.start()
    try:
        head._refresh(HeadClock().now(), event, event)
        assert comes_true(lambda: further._control.newest() is not None and further._control.statistics is not None)
    finally:
        head.manager.stop()
    further._refresh(event, event, 1.0)
    assert further._control.statistics == statistics_of(head._status)
    assert (further._compositor._pictures.executor.framelets[index].colour != before).any(), "dashes before"


def test_there_is_a_statistic_for_each_placeholder_of_an_overlay() -> None:
    assert tuple(field.name for field in fields(Statistics)) == PLACEHOLDERS
