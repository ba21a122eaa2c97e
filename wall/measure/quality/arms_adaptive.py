"""The adaptive sampler and its reconstruction as an arm; one picture serves both."""

from __future__ import annotations

from wall.data import Event, Float32
from wall.measure.quality.arm import Inputs, Setup, centres, steps
from wall.reconstruction.picture import Picture
from wall.sampling import kernels_adaptive
from wall.sampling.adaptive import AdaptiveSampler


class AdaptiveArm:
    def __init__(self, setup: Setup) -> None:
        self._setup, self._inputs = setup, Inputs(setup.plan)
        self._tracer = setup.tracer(coherent=True)
        self._picture = Picture(setup.panel, setup.plan.view.eye, setup.plan.scene, judging=True)
        self._sampler = AdaptiveSampler(setup.rect, self._picture, batch=4096, seed=setup.seed)
        self.rays = self.secondary = self.bytes = 0
        self._now, self._spent = 0.0, 0
        event = self._inputs.event_at(0.0)
        self._trace(centres(setup), event, 0.0)
        self.rays = self.secondary = self.bytes = 0

    def advance(self, until: float, rays: int | None = None) -> None:
        allowed = int(self._setup.rate * until) if rays is None else rays
        for now, owed in steps(self._now, until, self._spent, allowed, self._setup.input_step_s):
            if owed - self._spent < kernels_adaptive.PACKET:
                continue
            event = self._inputs.event_at(now)
            targets = self._sampler.choose(event, owed - self._spent)
            if targets is None:
                self._spent = owed  # no pixel gains: this time passes unused
                continue
            self._spent += len(targets.xy)
            self._trace(targets.xy, event, now)
        self._now = until

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
