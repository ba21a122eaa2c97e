"""What one core of this machine does for a wall, measured."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from statistics import median

from wall.core.data import Event, Region
from wall.geometry.cameras import PanelView
from wall.roles.adaptive_renderer import AdaptiveRenderer
from wall.roles.plan import Plan, first_event
from wall.roles.worker import Worker, make_samplers
from wall.run.clock import HeadClock
from wall.sampling.base import Sampler
from wall.tracing.tracer_scene import TracerScene

MEASURED_S = 0.15  # seconds of tracing: some 50,000 samples
REFRESHES = 3


@dataclass(frozen=True, slots=True, kw_only=True)
class OneCore:
    """What one core of this machine does for the first renderer's region."""

    rate: float  # samples/s, if it only traces
    size: float  # bytes a sample
    refresh_s: float = 0.0  # of its image while the camera moves; 0 where samples stay where they were traced


def measured_core(plan: Plan, tracer_scene: TracerScene) -> OneCore:
    """Measure one core of this machine: it traces and encodes, then refreshes."""
    rank = plan.layout.renderers()[0]
    region, clock = plan.layout.region(rank), HeadClock()
    samplers = make_samplers(plan, "", region, clock)
    worker = Worker(plan, tracer_scene, rank, clock, samplers, 0)
    event = first_event(plan, 0.0, region.view)
    worker.step(event)  # which compiles its kernels, or loads them
    before, began, size = worker.work.samples, time.perf_counter(), 0
    while time.perf_counter() - began < MEASURED_S:
        packet = worker.step(event)
        size += len(packet or b"")
        if packet is None:
            worker.sampler.restart()
    traced = worker.work.samples - before
    rate = traced / (time.perf_counter() - began)
    return OneCore(
        rate=rate, size=size / max(traced, 1), refresh_s=_refresh_s(plan, region, worker.sampler, event, clock)
    )


def _refresh_s(plan: Plan, region: Region, sampler: Sampler, event: Event, clock: HeadClock) -> float:
    """CPU seconds of a refresh of the adaptive sampler's image while the camera slides; 0 of other samplers."""
    if not isinstance(sampler, AdaptiveRenderer):
        return 0.0
    panel = plan.layout.panel(region)
    panel_view = PanelView(plan.view_of(panel), panel)
    (x, y, z), took = event.camera.position, []
    for number in range(1, REFRESHES + 1):
        camera = replace(event.camera, position=(x + 1e-3 * plan.scene.radius * number, y, z))
        moved = replace(event, camera_event=event.camera_event + number, camera=camera)
        began = time.thread_time()
        sampler.reconstruction.refresh(panel_view(moved), clock.now())
        took.append(time.thread_time() - began)
    return median(took)
