"""The adaptive sampler and its reconstruction as an arm; one picture serves both."""

from __future__ import annotations

import numpy as np

from wall.data import Event, Float32
from wall.measure.quality.arm import INPUT_STEP_S, Inputs, Setup
from wall.reconstruction.picture import Picture
from wall.sampling.adaptive import AdaptiveSampler


class AdaptiveArm:
    def __init__(self, setup: Setup) -> None:
        self._setup, self._inputs = setup, Inputs(setup.plan)
        self._tracer = setup.tracer(coherent=True)
        self._picture = Picture(setup.panel, setup.plan.view.eye, setup.plan.scene, judging=True)
        self._sampler = AdaptiveSampler(setup.rect, self._picture, batch=4096, seed=setup.seed)
        self.rays = self.secondary = self.bytes = 0
        self._now = 0.0
        event = self._inputs.event_at(0.0)
        width, height = setup.size
        x, y = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
        self._trace(np.stack([x.ravel(), y.ravel()], axis=1).astype(np.float32), event, 0.0)
        self.rays = self.secondary = self.bytes = 0

    def advance(self, until: float) -> None:
        rate = self._setup.rate
        while self._now < until:
            end = min(self._now + INPUT_STEP_S, until)
            owed = int(rate * end) - self.rays
            if owed >= 16:
                event = self._inputs.event_at(end)
                targets = self._sampler.choose(event, owed)
                if targets is not None:
                    self._trace(targets.xy, event, end)
                else:
                    self.rays = int(rate * end)
            self._now = end

    def _trace(self, xy: Float32, event: Event, now: float) -> None:
        self._tracer.take(event)
        samples, cost = self._tracer.trace(xy)
        self._picture.insert(samples, now, event)
        self._sampler.observe(samples)
        self.rays += cost.primary
        self.secondary += cost.shadow + cost.secondary

    def show(self, time: float) -> Float32:
        self._picture.refresh(self._inputs.event_at(time), time)
        self._sampler.replan()
        return self._picture.radiance


ARMS = {"adaptive": AdaptiveArm}
