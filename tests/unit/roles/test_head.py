"""The head: whatever the manager publishes meanwhile, a refresh is of one event from its first step to its last."""

from __future__ import annotations

from pathlib import Path

import pytest
from small_graphs import PANEL0, nodes, text_of

from wall.config.loading import loads
from wall.core.data import Event
from wall.display.base import Status, WallPicture
from wall.geometry.steering import Command, parse
from wall.packets.control import Hands, Heartbeat
from wall.roles.head import SETTLED_S, Head
from wall.roles.plan import Plan, make_layout, make_plan
from wall.run.bootstrap_threads import ThreadBootstrap
from wall.run.clock import ManualClock
from wall.transport.loopback import LoopbackHub

TEXT = """\
version: 1
scene: {source: courtyard}
wall: {grid: {columns: 2, rows: 1, pixels: [32, 24], size: [0.4, 0.3]}}
views: [{camera: {position: [6, 4.5, 10], target: [0, 0.6, 0]}}]
graph: {compositors: 2, sinks: [png]}
sampling: {method: adaptive}
"""


class Kept:
    """A sink that keeps what it is shown."""

    def __init__(self) -> None:
        self.shown: list[tuple[WallPicture, Status]] = []

    def show(self, picture: WallPicture, status: Status) -> None:
        self.shown.append((picture, status))

    def close(self) -> None:
        pass

    def dropped(self) -> dict[str, int]:
        return {}


@pytest.fixture(scope="module")
def plan() -> Plan:
    return make_plan(make_layout(loads(TEXT, path=Path("wall.yaml"))))


@pytest.fixture
def kept() -> Kept:
    return Kept()


@pytest.fixture
def head(plan: Plan, kept: Kept, manual_clock: ManualClock) -> Head:
    """One whose manager's thread does not run: what it publishes between two steps, a test decides."""
    return head_of(plan, manual_clock, kept)


def head_of(plan: Plan, clock: ManualClock, *sinks: Kept) -> Head:
    hubs = [LoopbackHub(credit_bytes=1 << 16) for _ in range(2)]
    return Head(plan, ThreadBootstrap.start(1, lambda _: None), *hubs, clock, {}, list(sinks), [], still=True)


def publish(head: Head, command: Command) -> None:
    """What the manager's thread does when a viewer's command came."""
    manager, now = head.manager, head.manager._clock.now()
    assert manager._director.update([command], now)
    manager._publish(now)


def test_what_is_published_during_a_refresh_waits_for_the_next(
    head: Head, kept: Kept, manual_clock: ManualClock
) -> None:
    seen = []
    for value in ("frameless", ""):  # a comparison begins during the first refresh and ends during the second
        event = head._newest()
        publish(head, parse({"kind": "compare", "value": value}))
        head._refresh(manual_clock.now(), event, event)
        seen.append((kept.shown[-1], event))
        manual_clock.advance(1.0)

    for (picture, status), event in seen:
        assert (picture.camera_event, picture.scene_event) == event.number
        assert status.compare == event.compare
    (alone, _), (both, _) = (shown for shown, _ in seen)
    assert alone.compared == ()
    assert [second.id for second in both.compared] == [panel.id for panel in both.panels], "each on its own panel"


def test_each_event_is_taken_once_and_the_newest_stays(head: Head) -> None:
    first = head._newest()
    assert head._newest() is first, "nothing came"
    for value in ("framed", "hilbert"):
        publish(head, parse({"kind": "sampler", "value": value}))

    assert head._newest() is head.manager.event
    assert not head.manager.recent


def test_a_head_that_shows_nothing_goes_by_heartbeats_to_know_that_all_is_complete(manual_clock: ManualClock) -> None:
    plan = plan_of_elsewhere()
    head = head_of(plan, manual_clock)
    event = head._newest()
    head._refresh(manual_clock.now(), event, event)

    for rank, complete in ((1, True), (2, False)):
        beats(head, rank, event, complete=complete)
    manual_clock.advance(10.0)
    assert not head._complete(manual_clock.now(), event), "the renderer is at work"
    beats(head, 2, event, complete=True)
    assert not head._complete(manual_clock.now(), event), "its last packets are on their way"
    manual_clock.advance(SETTLED_S)
    assert head._complete(manual_clock.now(), event)


def test_escape_at_any_window_ends_the_run_and_so_does_the_end_of_the_last(manual_clock: ManualClock) -> None:
    head = head_of(plan_of_elsewhere(), manual_clock)
    assert head._closed() == ""
    head.manager._take_hands(Hands(rank=1, closed=True))
    assert head._closed() == "every window is closed"
    head.manager._take_hands(Hands(rank=1, escape="Escape was pressed in the window of panel r0c0", closed=True))
    assert head._closed() == "Escape was pressed in the window of panel r0c0"


def test_the_last_window_of_one_compositor_leaves_those_of_others_open(manual_clock: ManualClock) -> None:
    head = head_of(plan_of_elsewhere("id: b, op: sink, kind: window, input: p0, on: head"), manual_clock)
    head.manager._take_hands(Hands(rank=1, closed=True))
    assert head._closed() == ""


def plan_of_elsewhere(*more: str) -> Plan:
    """A panel whose picture is made and shown by compositor 1."""
    shown = "id: p0, op: reconstruct, input: s0, on: compositor 1"
    graph = nodes(PANEL0[0], shown, "id: a, op: sink, kind: window, input: p0", *more, head="  compositors: 2\n")
    wall = "wall: {grid: {columns: 1, rows: 1, pixels: [8, 6], size: [0.4, 0.3], id: r0c0}}"
    return make_plan(make_layout(loads(text_of(graph, wall=wall), path=Path("wall.yaml"))))


def beats(head: Head, rank: int, event: Event, *, complete: bool) -> None:
    camera, scene = event.number
    now = head.manager._clock.now()
    beat = Heartbeat(rank=rank, time=now, complete=complete, camera_event=camera, scene_event=scene)
    head.manager.heartbeats[rank] = (now, beat)


def test_second_pictures_come_of_all_panels_or_of_none(head: Head) -> None:
    """The head's own panel begins a comparison with `follow`; framelets of the other compositor's may come sooner."""
    compositor = head._compositor
    (own,) = compositor.layers.values()
    assert compositor.compared() == []
    publish(head, parse({"kind": "compare", "value": "framed"}))
    head._newest()
    assert own.compared is not None
    (shown,) = compositor.compared()
    assert len(shown.pictures()) == 2
