"""The same samples to the image on the CPU and to the one on a GPU, and what may differ between the two."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest
from adaptive_images import traced
from numpy.testing import assert_array_equal
from small_scenes import View

from wall.core.data import Event, Rect, Samples
from wall.reconstruction.gpu.reconstruction import GpuReconstruction
from wall.reconstruction.reconstruction import Ingredients, Reconstruction
from wall.scene.build import Scene

# Both place a sample to within some float32 roundings, so to 1e-4 pixels at pixel 97, and weights add up to 1 or more
# almost everywhere: so much of a neighbour's radiance (at most 0.75) comes in. Seen: 1.5e-5.
ROUNDING = 1e-4
# A rounding may also decide which of two samples is nearer, or whether one hides another: up to four pixels each.
# By their density the next refresh spreads samples, so it shows there once more. Seen: 36 pixels of 6,305.
DECIDED_BY_ROUNDING = 0.008


class Twins:
    """The same calls to both."""

    def __init__(self, scene: Scene, seen: View, rect: Rect | None = None, *, kept: float = 4.0) -> None:
        self.scene, self.seen = scene, seen
        self.cpu = Reconstruction(
            seen.panel, seen.eye, scene, detects_change=False, rect=rect, samples_per_pixel=kept,
            ingredients=Ingredients(parts=False),
        )  # fmt: skip
        self.gpu = GpuReconstruction(seen.panel, seen.eye, scene, rect=rect, samples_per_pixel=kept)

    def insert(self, samples: Samples, time: float, event: Event) -> None:
        self.cpu.insert(samples.copy(), time, event)
        self.gpu.insert(samples.copy(), time, event)

    def refresh(self, event: Event, now: float) -> None:
        self.cpu.refresh(event, now)
        self.gpu.refresh(event, now)

    def agree(self, *, rounding: float = ROUNDING, decided: float = 0.0) -> None:
        """Assert the same image, the same changed tiles, the same number of samples stored."""
        height, width = self.cpu.radiance.shape[:2]
        assert self.gpu.radiance.shape == (height, width, 3)
        assert np.isfinite(self.gpu.radiance).all()
        error = np.abs(self.gpu.radiance - self.cpu.radiance).max(axis=2)
        assert (error > rounding).mean() <= decided, f"{(error > rounding).sum()} pixels, up to {error.max()}"
        assert self.gpu.nothing_moves == self.cpu.nothing_moves
        assert self.gpu.count == pytest.approx(self.cpu.count, rel=decided)
        assert_array_equal(self.gpu.take_dirty(), self.cpu.take_dirty())


class Noise(NamedTuple):
    """Samples at random places, each of its own brightness, one in ten a contradiction."""

    random: np.random.Generator
    count: int

    def of(self, twins: Twins, event: Event) -> Samples:
        width, height = twins.seen.panel.pixels
        xy = (self.random.random((self.count, 2)) * (width, height)).astype(np.float32)
        samples = traced(twins.scene, event, xy, twins.seen)
        samples["radiance"] *= (0.5 + self.random.random((self.count, 1))).astype(np.float32)
        contradicts = self.random.random(self.count) < 0.1
        samples["change"] = np.where(contradicts, np.round(self.random.random(self.count), 2), 0.0)
        return samples
