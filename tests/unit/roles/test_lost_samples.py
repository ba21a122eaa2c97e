"""Samples whose packet was dropped: the renderer's own reconstruction must not keep what no display has."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from wall.config.loading import loads
from wall.core.clock import ManualClock
from wall.core.data import Batch, Event, Samples
from wall.deepbuffer.kernels.columns import COUNT
from wall.packets.samples import decode
from wall.roles.adaptive_renderer import AdaptiveRenderer
from wall.roles.plan import first_event, make_layout, make_plan
from wall.roles.worker import Worker, make_samplers
from wall.sampling.kernels.scores import HOLE
from wall.tracing.tracer_scene import make_tracer_scene

SIZE = (40, 36)
TEXT = f"""\
version: 1
scene: {{source: courtyard}}
wall: {{grid: {{columns: 1, rows: 1, pixels: [{SIZE[0]}, {SIZE[1]}], size: [0.4, 0.36]}}}}
views: [{{camera: {{position: [6, 4.5, 10], target: [0, 0.6, 0]}}}}]
sampling: {{method: adaptive, samples_per_batch: 64}}
graph: {{preset: sort-first}}
"""
REFRESH_S = 0.1  # longer than any refresh takes


class Rank:
    """A renderer's only worker; time passes by `step` alone."""

    def __init__(self) -> None:
        plan = make_plan(make_layout(loads(TEXT, path=Path("wall.yaml"))))
        rank = plan.layout.renderers()[0]
        self._clock = ManualClock(1.0)
        samplers = make_samplers(plan, "", plan.layout.region(rank), self._clock)
        self.worker = Worker(plan, make_tracer_scene(plan.scene), rank, self._clock, samplers, 0)
        self.event = first_event(plan, 0.0)

    def step(self, event: Event) -> Batch:
        """A batch, and the time until the next refresh is due."""
        packet = self.worker.step(event)
        assert packet is not None
        self._clock.advance(REFRESH_S)
        return decode(packet)

    @property
    def renderer(self) -> AdaptiveRenderer:
        assert isinstance(self.worker.sampler, AdaptiveRenderer)
        return self.worker.sampler


@pytest.fixture
def rank() -> Rank:
    return Rank()


def pixels_of(*parts: Samples, reach: int = 0) -> NDArray[np.bool_]:
    """(h, w) bool: pixels of samples, and those up to `reach` pixels away."""
    found = np.zeros((SIZE[1] + 2 * reach, SIZE[0] + 2 * reach), np.bool_)
    for samples in parts:
        x, y = samples["xy"].astype(int).T
        for i in range(2 * reach + 1):
            for j in range(2 * reach + 1):
                found[y + i, x + j] = True
    return found[reach : reach + SIZE[1], reach : reach + SIZE[0]]


def test_after_a_refresh_lost_samples_are_gone_and_their_pixels_are_holes(rank: Rank) -> None:
    """The camera's number changes and its pose does not, so a sample stays in the 3 x 3 pixels that it spreads over."""
    kept = rank.step(rank.event).samples
    lost = rank.step(replace(rank.event, camera_event=1))
    rank.worker.forget(lost)

    later = rank.step(replace(rank.event, camera_event=2)).samples

    alone = pixels_of(lost.samples) & ~pixels_of(kept, reach=1)
    assert alone.sum() > 10
    density = rank.renderer.reconstruction.feedback().sample_density
    assert (density[alone] == 0.0).all()
    assert (density[pixels_of(kept)] > 0.0).all(), "what arrived stays"
    untraced = alone & ~pixels_of(later)
    assert untraced.any()
    assert (rank.renderer.sampler.current.score[untraced] >= HOLE).all()


def test_at_rest_pixels_of_lost_samples_accumulate_anew(rank: Rank) -> None:
    for _ in range(3):
        rank.step(rank.event)  # the second refresh finds that nothing moves
    lost = rank.step(rank.event)
    accumulation = rank.renderer.reconstruction.feedback().accumulation
    pixels = pixels_of(lost.samples)
    assert (accumulation[pixels, COUNT] > 0).all()
    rank.renderer.reconstruction.take_dirty()
    rank.worker.forget(lost)

    later = rank.step(rank.event)

    alone = pixels & ~pixels_of(later.samples)
    assert alone.sum() > 10
    assert (accumulation[alone] == 0.0).all()
    dirty = np.kron(rank.renderer.reconstruction.take_dirty(), np.ones((16, 16)))[: SIZE[1], : SIZE[0]]
    assert dirty[alone].all(), "the image shows it"
