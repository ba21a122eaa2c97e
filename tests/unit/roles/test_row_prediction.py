"""Rows of a scanning display are traced for their moments: an upright edge leans in the image, and stands to the eye.

A camera slides to the right at speed v before the upright edge of a square, d away: with a focal length of f pixels the
edge moves f v / d pixels a second to the left. A display that shows row y at t + y r is to show it there in that
row: the edge leans by f v r / d pixels a row, and an eye that follows it sees it upright. Made for one moment, the edge
is upright in the image, and leans by as much the other way on the display.
"""

from __future__ import annotations

import math
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from small_scenes import instance, quad, scene_of, with_every_feature

from wall.config.loading import loads
from wall.core.clock import ManualClock
from wall.core.data import Batch, Event, Float64
from wall.geometry.cameras import look_at
from wall.geometry.prediction import GONE_S
from wall.geometry.scan import LEAST_ROWS
from wall.roles.plan import Plan, first_event, make_layout, make_plan
from wall.roles.row_prediction import RowPrediction
from wall.roles.worker import Worker, make_samplers
from wall.tracing.tracer_scene import make_tracer_scene

WIDTH, HEIGHT, DISTANCE, SPEED, FOV = 64, 96, 5.0, 20.0, 53.130102
FOCUS = HEIGHT / 2 / math.tan(math.radians(FOV) / 2)  # pixels
REFRESH_S, ROW_S, TICK_S = 1 / 60, 1 / 60 / HEIGHT, 1 / 120
PIXELS_A_SECOND = FOCUS * SPEED / DISTANCE  # 384: 6.4 from the first row to the last
IN_MIDDLE_S = 0.1  # when the edge is in the middle of the panel
METHODS = {
    "framed": "method: framed",
    "frameless": "method: frameless",
    "hilbert": "method: hilbert",
    "progressive": "method: progressive, first_stage: 1, samples_per_pixel: 1",
}
TEXT = f"""\
version: 1
scene: {{source: courtyard}}
wall: {{grid: {{columns: 1, rows: 1, pixels: [{WIDTH}, {HEIGHT}], size: [0.2, 0.3], row_time: ROW}}}}
views: [{{camera: {{position: [0, 0, {DISTANCE}], target: [0, 0, 0], fov: {FOV}}}, refresh_hz: 60}}]
sampling: {{SAMPLING}}
"""


def plan_of(sampling: str, row_s: float) -> Plan:
    plan = make_plan(
        make_layout(loads(TEXT.replace("ROW", f"{row_s:.9f}").replace("SAMPLING", sampling), path=Path("wall.yaml")))
    )
    left = instance(0, at=(SPEED * IN_MIDDLE_S - 50.0, 0.0, 0.0))
    return replace(plan, scene=with_every_feature(scene_of([quad(100.0, 100.0)], [left])))


class Renderer:
    """One worker of one region, told where the camera is at every tick."""

    def __init__(self, plan: Plan) -> None:
        region = plan.layout.region(plan.layout.renderers()[0])
        scanned = plan.layout.panel(region).scan is not None
        self.plan, self.clock = plan, ManualClock(0.0)
        self.worker = Worker(
            plan, make_tracer_scene(plan.scene), plan.layout.renderers()[0], self.clock,
            make_samplers(plan, "", region, self.clock), 0, region,
            rows=RowPrediction(plan, region, nullcontext()) if scanned else None,
        )  # fmt: skip
        self.edge = np.full((HEIGHT, WIDTH), -1, np.int64)  # 1 where a pixel shows the square, 0 the sky

    def event(self, tick: int) -> Event:
        time = tick * TICK_S
        camera = look_at((SPEED * time, 0, DISTANCE), (SPEED * time, 0, 0), (0, 1, 0))
        return replace(first_event(self.plan, 0.0), camera_event=tick, input_time=time, camera=camera)

    def slide(self, ticks: int) -> list[Batch]:
        """All that is traced in the last tick; the clock stands while its batches are traced."""
        batches: list[Batch] = []
        for tick in range(ticks):
            self.clock.time = tick * TICK_S
            batches = self.drain(self.event(tick))
        return batches

    def drain(self, event: Event) -> list[Batch]:
        batches, traced = [], -1
        while traced < (traced := self.worker.work.samples) and (batch := self.worker.trace(event)) is not None:
            if not len(batch.samples):  # of probes, or of nothing: then no more were traced
                continue
            batches.append(batch)
            x, y = batch.samples["xy"].astype(int).T
            self.edge[y, x] = batch.samples["object_id"] == 1
        return batches

    def edges(self) -> Float64:
        """(h,) where each row has the edge, pixels."""
        assert self.edge.min() >= 0, "not every pixel was traced"
        return self.edge.sum(axis=1).astype(np.float64)


def where(time: float, rows: Float64, row_s: float) -> Float64:
    """(h,) where the edge is to be in each row of an image whose first row is seen at a time."""
    return WIDTH / 2 - PIXELS_A_SECOND * (time - IN_MIDDLE_S + (rows + 0.5) * row_s)


@pytest.mark.parametrize("method", METHODS)
def test_edge_leans_in_the_image_as_the_closed_form_says_and_stands_to_a_following_eye(
    compiled_only: None, method: str
) -> None:
    """Within a pixel, as pixels are traced whole, and the motion of half a band of rows."""
    renderer = Renderer(plan_of(METHODS[method], ROW_S))
    batches = renderer.slide(8)
    rows, now = np.arange(HEIGHT, dtype=np.float64), 7 * TICK_S
    seen = now + REFRESH_S + REFRESH_S  # a refresh: half to wait for, half to be seen in; the delay
    bound = 1.0 + LEAST_ROWS / 2 * ROW_S * PIXELS_A_SECOND

    edges = renderer.edges()

    assert all(batch.foreseen for batch in batches)
    assert np.abs(edges - where(seen, rows, ROW_S)).max() <= bound
    followed = edges + PIXELS_A_SECOND * rows * ROW_S
    assert np.ptp(followed) <= 2 * bound
    assert edges[:8].mean() - edges[-8:].mean() == pytest.approx(PIXELS_A_SECOND * (HEIGHT - 16) * ROW_S, abs=1.0)


def test_without_row_time_the_edge_is_upright_in_the_image_and_leans_to_a_following_eye(compiled_only: None) -> None:
    renderer = Renderer(plan_of(METHODS["framed"], 0.0))
    batches = renderer.slide(8)
    rows = np.arange(HEIGHT, dtype=np.float64)

    edges = renderer.edges()

    assert not any(batch.foreseen for batch in batches)
    assert np.abs(edges - where(7 * TICK_S, rows, 0.0)).max() <= 1.0
    assert np.ptp(edges) == 0.0
    followed = edges + PIXELS_A_SECOND * rows * ROW_S
    assert np.ptp(followed) == pytest.approx(PIXELS_A_SECOND * (HEIGHT - 1) * ROW_S)


@pytest.mark.parametrize("method", METHODS)
def test_a_camera_that_has_stopped_is_traced_anew_where_it_stands(compiled_only: None, method: str) -> None:
    """Nobody says more than the last event; what was traced ahead of it is replaced, and then nothing is missing."""
    renderer = Renderer(plan_of(METHODS[method], ROW_S))
    renderer.slide(8)
    last = renderer.event(7)
    renderer.clock.advance(2 * GONE_S)

    empty = renderer.worker.trace(last)
    batches = renderer.drain(last)

    assert empty is not None
    assert sum(len(batch.samples) for batch in batches) >= HEIGHT * WIDTH
    assert not any(batch.foreseen for batch in batches)
    assert all(batch.camera == last.camera for batch in batches)
    assert np.abs(renderer.edges() - where(7 * TICK_S, np.zeros(HEIGHT), 0.0)).max() <= 1.0
    assert renderer.worker.trace(last) is None


def test_parts_of_one_frame_are_predicted_once_however_long_it_takes(compiled_only: None) -> None:
    """Else the frame would have a seam where its next batch began."""
    renderer = Renderer(plan_of("method: framed, samples_per_batch: 1024", ROW_S))
    renderer.slide(8)
    renderer.clock.time = 8 * TICK_S
    first = renderer.worker.trace(renderer.event(8))
    renderer.clock.advance(0.004)
    second = renderer.worker.trace(renderer.event(9))

    assert first is not None
    assert second is not None
    assert first.frame == second.frame
    apart = np.mean(second.samples["xy"][:, 1]) - np.mean(first.samples["xy"][:, 1])
    moved = second.camera.position[0] - first.camera.position[0]
    assert moved == pytest.approx(SPEED * apart * ROW_S, abs=SPEED * ROW_S)
