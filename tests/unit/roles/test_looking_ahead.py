"""Rays are traced for the moment when they are seen; at rest that is the newest event itself."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from wall.config.loading import loads
from wall.config.sampling import AdaptiveSampling
from wall.core.clock import ManualClock
from wall.core.data import Event
from wall.roles.adaptive_renderer import AdaptiveRenderer
from wall.roles.plan import Plan, first_event, make_layout, make_plan

TEXT = """\
version: 1
scene: {source: courtyard}
wall: {grid: {columns: 1, rows: 1, pixels: [32, 24], size: [0.4, 0.3]}}
views: [{camera: {position: [6, 4.5, 10], target: [0, 0.6, 0]}, path: {type: orbit, period_s: 6}, EXTRA}]
sampling: {method: adaptive}
"""
TICK_S = 1 / 120


def plan_of(extra: str = "refresh_hz: 60") -> Plan:
    return make_plan(make_layout(loads(TEXT.replace("EXTRA", extra), path=Path("wall.yaml"))))


@pytest.fixture(scope="module")
def plan() -> Plan:
    return plan_of()


def moving(plan: Plan, k: int) -> Event:
    """What the manager publishes at tick k."""
    time = k * TICK_S
    event = first_event(plan, now=time)
    return replace(event, camera_event=k, scene_event=k, scene_time=time, camera=plan.view.camera_at(time))


def sampler_of(plan: Plan, clock: ManualClock) -> AdaptiveRenderer:
    sampling, region = plan.layout.sampling, plan.layout.region(1)
    assert isinstance(sampling, AdaptiveSampling)
    return AdaptiveRenderer(plan, sampling, region, region.rect, clock)


def test_display_is_a_refresh_late_unless_the_view_says_otherwise() -> None:
    assert plan_of("refresh_hz: 40").view.display_delay_s == 1 / 40
    assert plan_of("refresh_hz: 40, display_delay_s: 0.003").view.display_delay_s == 0.003
    assert plan_of("refresh_hz: 40").view.predicted
    assert not plan_of("prediction: none").view.predicted


def test_rays_are_traced_where_the_path_will_be_and_keep_their_events_number(
    plan: Plan, manual_clock: ManualClock
) -> None:
    manual_clock.time = 0.0
    sampler = sampler_of(plan, manual_clock)
    for k in range(12):
        targets = sampler.choose(moving(plan, k))
        manual_clock.advance(TICK_S)

    assert targets is not None
    seen = 11 * TICK_S + plan.view.display_delay_s
    assert targets.event.number == moving(plan, 11).number
    assert targets.event.scene_time == pytest.approx(seen)
    assert targets.event.camera.position == pytest.approx(plan.view.camera_at(seen).position, abs=1e-3)


def test_rays_of_a_view_at_rest_or_without_prediction_are_traced_under_the_newest_event(
    plan: Plan, manual_clock: ManualClock
) -> None:
    unforeseen = plan_of("prediction: none")
    for chosen, events in (
        (plan, [first_event(plan, now=100.0)] * 12),
        (unforeseen, [moving(plan, k) for k in range(12)]),
    ):
        sampler = sampler_of(chosen, manual_clock)
        for event in events:
            targets = sampler.choose(event)
            assert targets is not None
            assert targets.event is event
            manual_clock.advance(TICK_S)
