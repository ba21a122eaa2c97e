"""The head: whatever the manager publishes meanwhile, a refresh is of one event from its first step to its last."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from wall.config.loading import loads
from wall.display.base import Status, WallPicture
from wall.geometry.steering import Command, parse
from wall.processes.bootstrap_threads import ThreadBootstrap
from wall.processes.clock import ManualClock
from wall.processes.head import Head
from wall.processes.plan import Plan, make_layout, make_plan
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
def head(plan: Plan, kept: Kept, manual_clock: ManualClock) -> Iterator[Head]:
    """One whose manager's thread does not run: what it publishes between two steps, a test decides."""
    hubs = [LoopbackHub(credit_bytes=1 << 16) for _ in range(2)]
    bootstrap = ThreadBootstrap.start(1, lambda _: None)
    yield Head(plan, bootstrap, hubs[0], hubs[1], manual_clock, {}, [kept], list, still=True)
    for hub in hubs:
        hub.close()


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
