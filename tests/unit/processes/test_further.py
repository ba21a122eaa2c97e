"""A compositor beside the head, as its thread runs, over loopback."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

from x_servers import comes_true, press, x_server
from Xlib import XK

from wall.config.loading import loads
from wall.display.window import WindowSink
from wall.packets.control import Hands, Stop, parse_control, serialise
from wall.processes.clock import HeadClock
from wall.processes.control import Control
from wall.processes.further import FurtherCompositor
from wall.processes.manager import Manager
from wall.processes.plan import HEAD, Plan, make_layout, make_plan
from wall.processes.sinks import make_sinks
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


def plan_on(display: str) -> Plan:
    return make_plan(make_layout(loads(TEXT.replace("DISPLAY", f'"{display}"'), path=Path("wall.yaml"))))


def hub() -> LoopbackHub:
    return LoopbackHub(credit_bytes=1 << 20)


def further_of(plan: Plan, head: LoopbackHub, data: LoopbackHub, *sinks: WindowSink) -> FurtherCompositor:
    """Linked to the head's control hub; fed by `data`."""
    control = Control(LoopbackLink(head.endpoint), plan, RANK, same_clock=True)
    return FurtherCompositor(plan, RANK, data, control, {HEAD: LoopbackLink(hub().endpoint)}, list(sinks))


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
