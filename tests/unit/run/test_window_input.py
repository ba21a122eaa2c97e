"""Input at a window away from the head: keys steer, Escape ends the run, a lost display is told and counted."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path

from x_servers import comes_true, press, scroll, x_server
from Xlib import XK

from wall.config.loading import loads
from wall.core.data import Camera
from wall.display.window import WindowSink
from wall.packets.control import Heartbeat, WindowInput, parse_control
from wall.roles.instructions import MANAGER, End
from wall.roles.manager import Manager
from wall.roles.plan import HEAD, Plan, make_layout, make_plan
from wall.run.clock import HeadClock
from wall.run.loop import Loop
from wall.run.ports import Ports
from wall.run.ranks import compositor_loop, hello_of
from wall.run.sinks import make_sinks, window_input_of
from wall.run.succession import Preparer
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
transport: {lost_after_s: 60}
graph:
  compositors: 2
  nodes:
    - {id: samples, op: samples, panel: far}
    - {id: picture, op: reconstruct, input: samples, on: compositor 1}
    - {id: window, op: sink, kind: window, input: picture}
"""
TWO_VIEWS = """\
views:
  - {id: main, camera: {position: [6, 4.5, 10], target: [0, 0.6, 0]}}
  - {id: map, viewport: {left: 0.5, top: 0, width: 0.5, height: 0.5}, camera: {position: [0, 9, 5], target: [0, 0, 0]}}
graph: {preset: sort-first, sinks: [window]}
"""
Command = dict[str, object]


def plan_on(display: str) -> Plan:
    return make_plan(make_layout(loads(TEXT.replace("DISPLAY", f'"{display}"'), path=Path("wall.yaml"))))


@contextmanager
def remote(plan: Plan, control: LoopbackHub) -> Iterator[tuple[Loop, WindowSink]]:
    """Compositor 1 with its window, linked to the manager's hub."""
    [sink], _ = make_sinks(plan, RANK, Path(), headless=False)
    assert isinstance(sink, WindowSink)
    hub, clock = LoopbackHub(credit_bytes=1 << 20), HeadClock()
    ports = Ports(RANK, clock, hub=hub, manager=LoopbackLink(control.endpoint))
    preparer = Preparer(plan, [""] * plan.layout.size)
    try:
        sources = [window_input_of(RANK, [sink])]
        yield compositor_loop(plan, hello_of(RANK, hub.endpoint), hub, ports, clock, [sink], preparer, sources), sink
    finally:
        sink.close()
        ports.close()


def test_keys_at_a_window_away_from_the_head_steer_and_escape_ends_the_run() -> None:
    with x_server("120x90") as display:
        plan, control, clock = plan_on(display), LoopbackHub(credit_bytes=1 << 20), HeadClock()
        manager, ends = Manager(plan, clock.now(), still=True), list[End]()
        managing = Loop(manager, Ports(MANAGER, clock, hub=control), clock, sources=[lambda: ends], longest_wait_s=0.01)
        with remote(plan, control) as (loop, _):
            threads = [threading.Thread(target=each.run) for each in (managing, loop)]
            before = manager.directors[0].event.camera
            for thread in threads:
                thread.start()
            try:
                press(display, XK.XK_Right, (60, 45))
                assert comes_true(lambda: manager.directors[0].event.camera != before)
                press(display, XK.XK_Escape, (60, 45))
                assert comes_true(lambda: manager.ended == "Escape was pressed in the window of panel far")
            finally:
                ends.append(End("the test is over"))
                for thread in threads:
                    thread.join()


def test_the_wheel_steers_the_view_beneath_the_pointer_keys_the_same_one_tab_the_next_and_z_undoes() -> None:
    with x_server("120x90") as display:
        text = TEXT.partition("views:")[0].replace("DISPLAY", f'"{display}"\n      rotation: 90')
        plan = make_plan(make_layout(loads(text + TWO_VIEWS, path=Path("wall.yaml"))))
        manager, now = Manager(plan, 0.0, still=True), 0.0
        windows, _ = make_sinks(plan, HEAD, Path(), headless=False)
        (sink,) = windows
        assert isinstance(sink, WindowSink)
        taken, ask = list[dict[str, object]](), window_input_of(HEAD, windows)

        def cameras(*, after: Command) -> list[Camera]:
            """Of both views, once a command has come."""
            nonlocal now
            while not any(after.items() <= command.items() for command in taken):
                messages = came(ask)
                assert messages
                for message in messages:
                    assert isinstance(message, WindowInput)
                    taken.extend(message.commands)
                    list(manager.on_message(message, now))
            taken.clear()
            now += 1.0
            list(manager.on_tick(now))
            return [event.camera for event in manager.events]

        try:
            main, plan_view = (event.camera for event in manager.events)
            scroll(display, (20, 20))  # over the inset: the display hangs turned clockwise
            assert cameras(after={"kind": "zoom", "view": 1})[0] == main
            turned = manager.events[1].camera
            assert turned != plan_view
            press(display, XK.XK_Right, (100, 70))  # beside it: keys stay with what was steered
            assert cameras(after={"kind": "orbit", "view": 1})[0] == main
            scroll(display, (100, 70))
            nearer, same = cameras(after={"kind": "zoom"})
            assert nearer != main
            press(display, XK.XK_n, (100, 70))
            press(display, XK.XK_r, (100, 70))
            assert cameras(after={"kind": "reset", "view": 1}) == [nearer, plan_view]
            assert same != plan_view
            press(display, XK.XK_Tab, (100, 70))
            press(display, XK.XK_r, (100, 70))
            assert cameras(after={"kind": "reset"}) == [main, plan_view]

            manager.editor.set([("exposure", 1.0)])
            press(display, XK.XK_z, (100, 70))
            cameras(after={"kind": "undo"})
            assert manager.editor.tone(0.0).stops == 0.0
        finally:
            sink.close()


def came(ask: Callable[[], Sequence[object]]) -> Sequence[object]:
    """What a source gives, once it gives something."""
    found: Sequence[object] = ()

    def asked() -> bool:
        nonlocal found
        found = ask()
        return bool(found)

    return found if comes_true(asked) else ()


def test_a_display_that_a_compositor_lost_is_told_and_counted() -> None:
    control = LoopbackHub(credit_bytes=1 << 20)
    with ExitStack() as windows:
        with x_server("120x90") as display:
            loop, window = windows.enter_context(remote(plan_on(display), control))
        assert comes_true(lambda: window.gone)
        loop.turn()
        said = [parse_control(data) for _, data in control.messages()]
    assert WindowInput(rank=RANK, closed=True) in said
    (beat,) = (message for message in said if isinstance(message, Heartbeat))
    assert beat.dropped.items() >= window.dropped().items() > set()
