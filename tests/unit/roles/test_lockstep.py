"""`sync: frame`: a frame is shown when all of it is there, or its time is up; what is late is held, and counted."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from small_graphs import WHOLE, built, nodes, text_of

from wall.config.loading import loads
from wall.core.data import SAMPLE, Batch, Event, Rect
from wall.packets.control import serialise
from wall.packets.framelets import FrameletPart
from wall.packets.samples import encode
from wall.roles.composition import Composition
from wall.roles.lockstep import PATIENCE, depth_of
from wall.roles.plan import HEAD, Plan, first_event, make_layout, make_plan

FRAMED = "sampling: {method: framed}\n"
TIMEOUT_S = 0.5
GRAPH = nodes(*WHOLE, head=f"  compositors: 2\n  sync: {{mode: frame, timeout_s: {TIMEOUT_S}}}\n")
RECT = Rect(x=0, y=0, width=8, height=6)


@pytest.fixture(scope="module")
def plan() -> Plan:
    return make_plan(make_layout(loads(text_of(GRAPH, more=FRAMED), path=Path("a.yaml"))))


@pytest.fixture
def head(plan: Plan) -> Composition:
    """It has the left panel and the wall; the right panel's framelet comes from compositor 1."""
    return Composition(plan, HEAD)


def frame_of(event: Event, value: float) -> bytes:
    """All of the left panel's frame of an event."""
    samples = np.zeros(RECT.area, SAMPLE)
    x, y = np.meshgrid(np.arange(8) + 0.5, np.arange(6) + 0.5)
    samples["xy"], samples["radiance"] = np.stack([x.ravel(), y.ravel()], 1), value
    number = event.camera_event + 1
    return encode(
        Batch(
            view=0, panel=0, rect=RECT, rank=2, sequence=number, camera_event=event.camera_event,
            scene_event=event.scene_event, base_time=0.0, samples=samples, frame=number, frame_samples=RECT.area,
            camera=event.camera,
        )
    )  # fmt: skip


def other_panel(head: Composition, event: Event, value: int) -> bytes:
    """The right panel's framelet, as compositor 1 sends it."""
    (far,) = head._nodes.remote.values()
    framelet = replace(far.framelet, colour=np.full_like(far.framelet.colour, value), event=event)
    return serialise(FrameletPart.of(far.step.index, framelet, far.step.rect))


def left_and_right(head: Composition) -> tuple[int, int]:
    left, right = head.shown()[0].images()
    return int(left.rgb.mean()), int(right.rgb.mean())


def test_a_frame_waits_for_all_of_its_parts(plan: Plan, head: Composition) -> None:
    event = first_event(plan, 0.0)
    head.follow(event)
    assert head.refresh(event, 0.0) == {}
    head.insert(frame_of(event, 1.0))
    assert head.refresh(event, 0.1) == {}
    assert left_and_right(head) == (0, 0), "half of a frame is not shown"
    head.insert(other_panel(head, event, 77))
    assert head.refresh(event, 0.2)
    assert left_and_right(head) == (255, 77)
    assert head.lockstep is not None
    assert head.lockstep.done == event.number
    assert head.lockstep.news()
    assert not head.lockstep.news()
    assert head.refresh(event, 0.3) == {}, "it is done"
    assert head.counters == {}


def test_when_its_time_is_up_late_parts_stay_as_they_were_and_are_counted(plan: Plan, head: Composition) -> None:
    first = first_event(plan, 0.0)
    second = replace(first, camera_event=1)
    for event, value in ((first, 1.0), (second, 0.0)):
        head.follow(event)
        head.insert(frame_of(event, value))
        if event is first:
            head.insert(other_panel(head, event, 77))
            head.refresh(event, 0.0)
    wait = TIMEOUT_S * depth_of(plan.layout.graph, HEAD)
    assert head.refresh(second, 1.0) == {}
    assert head.refresh(second, 1.0 + 0.99 * wait) == {}
    assert head.refresh(second, 1.0 + wait)
    assert left_and_right(head) == (0, 77)
    assert head.counters == {"late p1": 1}


def test_what_was_late_is_shown_when_it_comes_if_the_frame_still_stands(plan: Plan, head: Composition) -> None:
    """A still view has no next frame that would show it."""
    event = first_event(plan, 0.0)
    head.follow(event)
    head.insert(frame_of(event, 1.0))
    head.refresh(event, 0.0)
    head.refresh(event, 10.0)
    assert left_and_right(head) == (255, 0)
    head.insert(other_panel(head, event, 77))
    assert head.refresh(event, 10.1)
    assert left_and_right(head) == (255, 77)
    assert head.refresh(event, 10.2) == {}
    assert head.counters == {"late p1": 1}, "it was late once"


def test_parts_of_the_next_frame_are_not_shown_with_this_one(plan: Plan, head: Composition) -> None:
    first = first_event(plan, 0.0)
    second = replace(first, camera_event=1)
    head.follow(first)
    head.insert(frame_of(first, 1.0))
    head.insert(other_panel(head, first, 77))
    head.refresh(first, 0.0)
    head.insert(other_panel(head, second, 99))
    assert head.refresh(first, 0.1) == {}
    assert left_and_right(head) == (255, 77)
    head.follow(second)
    head.insert(frame_of(second, 0.0))
    head.refresh(second, 0.2)
    assert left_and_right(head) == (0, 99)


def test_nobody_waits_any_longer_for_who_misses_frame_after_frame_until_it_is_back(
    plan: Plan, head: Composition
) -> None:
    event, now = first_event(plan, 0.0), 0.0
    for number in range(PATIENCE):  # compositor 1 is gone
        event = replace(event, camera_event=number + 1)
        head.follow(event)
        head.insert(frame_of(event, 0.5))
        assert head.refresh(event, now) == {}, "it is waited for"
        now += 3 * TIMEOUT_S
        assert head.refresh(event, now)
        now += 0.01
    event = replace(event, camera_event=PATIENCE + 1)
    head.follow(event)
    head.insert(frame_of(event, 0.5))
    assert head.refresh(event, now), "not any more"
    event = replace(event, camera_event=PATIENCE + 2)
    head.follow(event)
    head.insert(frame_of(event, 0.5))
    head.insert(other_panel(head, event, 200))
    assert head.refresh(event, now)
    event = replace(event, camera_event=PATIENCE + 3)
    head.follow(event)
    head.insert(frame_of(event, 0.5))
    assert head.refresh(event, now) == {}, "it is back, and waited for again"


def test_at_the_end_of_a_run_what_is_there_is_shown(plan: Plan, head: Composition) -> None:
    event = first_event(plan, 0.0)
    head.follow(event)
    head.insert(frame_of(event, 1.0))
    assert head.refresh(event, 0.0, force=True)
    assert left_and_right(head) == (255, 0)


def test_whoever_waits_for_others_waits_longer() -> None:
    graph = built(GRAPH, more=FRAMED)
    assert [depth_of(graph, place) for place in (HEAD, 1)] == [2, 1]


def test_a_frame_with_very_many_late_parts_still_fits_a_heartbeat(plan: Plan, head: Composition) -> None:
    head.counters.update({f"late n{k}": 1 for k in range(32)})
    event = first_event(plan, 0.0)
    head.follow(event)
    head.refresh(event, 0.0)
    head.refresh(event, 10.0)
    assert head.counters["late others"] == 2
