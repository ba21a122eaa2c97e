"""Rays are traced for the moment when they are seen; at rest that is the newest event itself."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from wall.config.loading import loads
from wall.config.sampling import AdaptiveSampling
from wall.core.clock import ManualClock
from wall.core.data import SAMPLE, Camera, Event
from wall.roles.adaptive_renderer import AdaptiveRenderer
from wall.roles.plan import Plan, first_event, make_layout, make_plan
from wall.run.single_process import SingleProcess
from wall.tracing.tracer_scene import make_tracer_scene

TEXT = """\
version: 1
scene: {source: courtyard}
wall: {grid: {columns: 1, rows: 1, pixels: [32, 24], size: [0.4, 0.3]}}
views: [{camera: {position: [6, 4.5, 10], target: [0, 0.6, 0]}, path: {type: orbit, period_s: 6}, EXTRA}]
sampling: {method: adaptive}
"""
TICK_S, REFRESH_S = 1 / 120, 1 / 60


def plan_of(extra: str = "refresh_hz: 60", text: str = TEXT) -> Plan:
    return make_plan(make_layout(loads(text.replace("EXTRA", extra), path=Path("wall.yaml"))))


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
    seen = 11 * TICK_S + REFRESH_S + plan.view.display_delay_s  # by the refresh of a compositor that shows them first
    assert targets.event.number == moving(plan, 11).number
    assert targets.event.scene_time == pytest.approx(seen)
    assert targets.event.camera.position == pytest.approx(plan.view.camera_at(seen).position, abs=1e-3)


def test_what_a_renderer_traces_for_its_own_image_is_for_the_moment_that_shows_it_first(compiled_only: None) -> None:
    """The camera of rays that were chosen between two refreshes is that of the later one, on a steady path."""
    plan = plan_of("refresh_hz: 30", TEXT.replace("period_s: 6", "period_s: 60").replace("32, 24", "96, 72"))
    chain = SingleProcess(plan, make_tracer_scene(plan.scene))
    [worker], [renderer] = chain.workers, chain._roles
    assert renderer.image is not None
    [shown] = renderer.image.images
    angles = []
    for k in range(400):
        time = chain.clock.now()
        chain.event = replace(moving(plan, k), input_time=time, scene_time=time, camera=plan.view.camera_at(time))
        refreshes, traced = shown.view.refreshes, getattr(worker._placed, "camera", None)
        chain.step()
        if shown.view.refreshes > refreshes > 4 and shown.expected is not None and traced is not None:
            angles.append([angle_of(camera) for camera in (traced, shown.expected.camera)])
    ahead = np.diff(np.unwrap(angles, axis=0))[:, 0] * 60.0 / (2.0 * np.pi)  # seconds of the path
    assert len(angles) > 5
    assert np.abs(ahead).max() < 0.004, "not 33 ms, the time between two refreshes"


def angle_of(camera: Camera) -> float:
    return float(np.arctan2(camera.position[0], camera.position[2]))


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


def test_a_batch_of_a_scanning_display_is_traced_in_bands_of_rows_each_for_its_own_moment(
    manual_clock: ManualClock, compiled_only: None
) -> None:
    row_s, rows = 1.0 / 60 / 80, 80
    scanned = plan_of(
        text=TEXT.replace("[32, 24], size: [0.4, 0.3]", f"[32, {rows}], size: [0.12, 0.3], row_time: {row_s}")
    )
    manual_clock.time = 0.0
    sampler, found = sampler_of(scanned, manual_clock), []
    for k in range(24):
        targets = sampler.choose(moving(scanned, k))
        assert targets is not None
        sampler.observe(np.empty(0, SAMPLE), manual_clock.time)
        if k > 18:
            found.append(targets)
        manual_clock.advance(TICK_S)

    assert len({targets.event.scene_time for targets in found}) == len(found)
    for k, targets in enumerate(found, start=19):
        y = targets.xy[:, 1]
        seen = k * TICK_S + REFRESH_S + scanned.view.display_delay_s + 0.5 * float(y.min() + y.max()) * row_s
        assert np.ptp(y) <= 16
        assert targets.event.number == moving(scanned, k).number
        assert targets.event.scene_time == pytest.approx(seen, abs=1.1 * TICK_S)  # predicted when it was refreshed last
        assert targets.event.camera.position == pytest.approx(
            scanned.view.camera_at(targets.event.scene_time).position, abs=1e-3
        )
    tops = [float(targets.xy[:, 1].min()) for targets in found]
    assert max(tops) > 16 + min(tops)


def test_a_scanning_display_at_rest_gets_whole_batches_under_the_newest_event(
    manual_clock: ManualClock, compiled_only: None
) -> None:
    scanned = plan_of(text=TEXT.replace("[32, 24], size: [0.4, 0.3]", "[32, 80], size: [0.12, 0.3], row_time: 0.0002"))
    sampler, event = sampler_of(scanned, manual_clock), first_event(scanned, now=100.0)

    targets = sampler.choose(event)

    assert targets is not None
    assert targets.event is event
    assert np.ptp(targets.xy[:, 1]) > 64
