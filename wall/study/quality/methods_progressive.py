"""What converges when everything stands still.

`progressive`: the yardstick of images at rest, no way to show motion. While anything moves it keeps its last image.
From the first step on in which nothing did it starts empty, and adds whole sweeps of samples, spread over each pixel,
to a mean; pixels that have none yet show what was there before.

`accumulating`: what viewports do. Frames of one jittered sample a pixel, double-buffered; while nothing moves it shows
their mean, and the newest one else.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from wall.core.data import Event, Float32, Samples
from wall.packets.samples import MAX_SAMPLES
from wall.sampling.pixel_means import PixelMeans, footprint_of
from wall.study.quality.baseline import FramedMethod
from wall.study.quality.method import Inputs, MeteredTracer, Method, Setup, centres, steps


class ProgressiveMethod:
    """Accumulates samples while nothing moves, and starts again at each event."""

    def __init__(self, setup: Setup) -> None:
        self._setup, self._inputs = setup, Inputs(setup.plan)
        self._tracer = MeteredTracer(setup, coherent=True)
        self._event = self._inputs.event_at(0.0)
        self._sampler: PixelMeans | None = None
        self._xy, self._at, self._sweep = centres(setup)[:0], 0, 0
        self._now, self._spent = 0.0, 0
        self.rays = self.secondary = self.bytes = 0
        width, height = setup.size
        self._before = np.zeros((height, width, 3), np.float32)
        first = self._fresh()
        first.add(self._tracer.trace(centres(setup), self._event, 0.0))
        self._tracer.reset()
        self._before[:] = first.mean()

    def advance(self, until: float, rays: int | None = None) -> None:
        """See Method."""
        allowed = int(self._setup.rate * until) if rays is None else rays
        for now, owed in steps(self._now, until, self._spent, allowed, self._setup.input_step_s):
            event = self._inputs.event_at(now)
            if event is self._event:
                self._add(event, min(owed - self._spent, MAX_SAMPLES), now)
            elif self._sampler is not None:
                self._before, self._sampler = self.show(now), None
            self._event, self._spent = event, owed
        self._now = until
        self.rays, self.secondary, self.bytes = self._tracer.counts

    def show(self, time: float) -> Float32:
        """Returns the means so far; pixels without a sample keep the image before the event."""
        if self._sampler is None:
            return self._before
        return np.where(self._sampler.counts[:, :, None] > 0, self._sampler.mean(), self._before).astype(np.float32)

    def _add(self, event: Event, count: int, now: float) -> None:
        if self._sampler is None:
            self._sampler, self._sweep, self._at = self._fresh(), 0, 0
        while count > 0:
            if self._at == 0:
                self._xy = self._sampler.positions(self._sweep)
                self._sweep += 1
            xy = self._xy[self._at : self._at + count]
            self._at = (self._at + len(xy)) % len(self._xy)
            count -= len(xy)
            self._sampler.add(self._tracer.trace(xy, event, now, footprint=footprint_of(self._sweep)))

    def _fresh(self) -> PixelMeans:
        return PixelMeans(self._setup.rect, seed=self._setup.seed)


class AccumulatingDisplay:
    """Mean of the frames of the newest event."""

    jittered = True

    def __init__(self) -> None:
        self._event: Event | None = None
        self._mean: Float32 = np.zeros((0, 0, 3), np.float32)
        self._frames = 0

    def take(self, raster: Samples, event: Event) -> None:
        """Adds a frame, (h, w) samples, to those of its event."""
        if self._event is None or event.number != self._event.number:
            self._mean, self._frames = np.zeros_like(raster["radiance"]), 0
        self._frames += 1
        self._mean += (raster["radiance"] - self._mean) / np.float32(self._frames)
        self._event = event

    def image(self, event: Event) -> Float32:
        """Returns the mean, (h, w, 3) linear RGB; of whatever event it is."""
        return self._mean


def accumulating(setup: Setup) -> FramedMethod:
    """Frames of one sample a pixel."""
    return FramedMethod(setup, setup.size, AccumulatingDisplay())


METHODS: dict[str, Callable[[Setup], Method]] = {"progressive": ProgressiveMethod, "accumulating": accumulating}
