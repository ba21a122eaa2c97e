"""Samplers that show samples where they were traced: framed, frameless, hilbert, by the project's own stages."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from wall.data import Batch, Event, Float32
from wall.deepbuffer.buffer import DeepBuffer
from wall.measure.quality.arm import INPUT_STEP_S, Arm, Inputs, Setup, centres, steps
from wall.packets.samples import Codec, decode, encode
from wall.sampling.base import Sampler, Targets
from wall.sampling.framed import FrameCounter, FramedSampler
from wall.sampling.frameless import FramelessSampler
from wall.sampling.hilbert import HilbertSampler


class PlainArm:
    """One of the plain samplers, its packets, and the newest-sample buffer of a compositor."""

    def __init__(self, setup: Setup, make: Callable[[Setup, int], Sampler]) -> None:
        self._setup, self._inputs = setup, Inputs(setup.plan)
        self._batch = max(16, int(setup.rate * INPUT_STEP_S))
        self._sampler = make(setup, self._batch)
        self._tracer = setup.tracer(coherent=self._sampler.coherent)
        self._buffer = DeepBuffer(*setup.size)
        self.rays = self.secondary = self.bytes = self._spent = self._sequence = 0
        self._last = 0.0
        self._placed: Event | None = None
        first = self._inputs.event_at(0.0)
        self._send(Targets(xy=centres(setup), event=first), 0.0)
        self.rays = self.secondary = self.bytes = 0

    def advance(self, until: float, rays: int | None = None) -> None:
        """See Arm. A batch may run ahead by less than its length."""
        allowed = int(self._setup.rate * until) if rays is None else rays
        for now, owed in steps(self._last, until, self._spent, allowed):
            while self._spent < owed:
                targets = self._sampler.choose(self._inputs.event_at(now))
                if targets is None:
                    self._spent = owed  # nothing is missing: this time passes unused
                    break
                self._spent += len(targets.xy)
                self._send(targets, now)
        self._last = until

    def _send(self, targets: Targets, now: float) -> None:
        event = targets.event
        if event is not self._placed:
            self._tracer.take(event)
            self._placed = event
        samples, cost = self._tracer.trace(targets.xy)
        self._sampler.observe(samples)
        self._sequence += 1
        batch = Batch(
            view=0, panel=0, rect=self._setup.rect, rank=1, sequence=self._sequence, camera_event=event.camera_event,
            scene_event=event.scene_event, base_time=now, samples=samples, frame=targets.frame,
            frame_samples=targets.frame_samples, skipped=cost.bad, blend=targets.blend,
        )  # fmt: skip
        packet = encode(batch, Codec.ZSTD)
        self.rays += cost.primary
        self.secondary += cost.shadow + cost.secondary
        self.bytes += len(packet)
        self._buffer.insert(decode(packet))

    def show(self, time: float) -> Float32:
        return self._buffer.radiance


def framed(setup: Setup) -> Arm:
    return PlainArm(setup, lambda s, batch: FramedSampler(s.rect, FrameCounter(1), batch=batch))


def framed_x10(setup: Setup) -> Arm:
    """Framed with ten times the rays."""
    return framed(replace(setup, rate=10.0 * setup.rate))


def frameless(setup: Setup) -> Arm:
    return PlainArm(setup, lambda s, batch: FramelessSampler(s.rect, batch=batch, seed=s.seed))


def hilbert(setup: Setup) -> Arm:
    def make(s: Setup, batch: int) -> Sampler:
        return HilbertSampler(
            s.rect, batch=batch, seed=s.seed, chunk=min(64, batch), blend=0.5, camera_update_percent=2.0
        )

    return PlainArm(setup, make)


ARMS: dict[str, Callable[[Setup], Arm]] = {
    "framed": framed, "framed_x10": framed_x10, "frameless": frameless, "hilbert": hilbert,
}  # fmt: skip
