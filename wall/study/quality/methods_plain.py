"""The project's blind samplers as methods, with the compositor's own buffer behind their own packets.

A batch is chosen under the newest event, takes its rays' time to trace, and is shown when its last ray is done. Their
free image is whatever completes the sampler at time 0: a sample a pixel, or four for `hilbert`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from wall.config.sampling import HilbertSampling
from wall.core.data import Batch, Float32
from wall.deepbuffer.pixel_buffer import PixelBuffer
from wall.packets.samples import MAX_SAMPLES
from wall.sampling.base import Sampler, Targets
from wall.sampling.framed import FrameCounter, FramedSampler
from wall.sampling.frameless import FramelessSampler
from wall.sampling.hilbert import HilbertSampler
from wall.study.quality.method import Inputs, MeteredTracer, Method, Setup, steps

FRAMED_BATCH = 4096  # rays of a frame share one event, so a batch may last as long as it likes


class SamplerMethod:
    """Any of the blind samplers: choose, trace, send, insert."""

    def __init__(self, setup: Setup, sampler: Sampler) -> None:
        self._rate, self._sampler, self._inputs = setup.rate, sampler, Inputs(setup.plan)
        self._tracer = MeteredTracer(setup, coherent=sampler.coherent, surfaces=False, receive=self._insert)
        self._buffer = PixelBuffer(*setup.size)
        self._frame: list[Batch] = []  # of double buffering, so far
        self._now = 0.0
        self._step = setup.input_step_s
        self._targets: Targets | None = None  # under way
        self._used = self._allowed = 0  # time, in rays: of finished batches and waiting; let pass so far
        while (targets := sampler.choose(self._inputs.event_at(0.0))) is not None:
            self._trace(targets)
        self._tracer.reset()
        self.rays, self.secondary, self.bytes = self._tracer.counts

    def advance(self, until: float, rays: int | None = None) -> None:
        """See Method."""
        allowed = int(self._rate * until) if rays is None else rays
        for now, owed in steps(self._now, until, self._allowed, allowed, self._step):
            self._now = now
            while self._used < owed:
                self._targets = self._targets or self._sampler.choose(self._inputs.event_at(now))
                if self._targets is None:
                    self._used = owed  # nothing is missing: this time passes unused
                    break
                if self._used + len(self._targets.xy) > owed:
                    break
                self._used += len(self._targets.xy)
                self._trace(self._targets)
                self._targets = None
        self._allowed = allowed
        self.rays, self.secondary, self.bytes = self._tracer.counts

    def show(self, time: float) -> Float32:
        """Returns the pixel buffer's image, (h, w, 3) linear RGB."""
        return self._buffer.radiance

    def _trace(self, targets: Targets) -> None:
        samples = self._tracer.trace(
            targets.xy, targets.event, self._now, frame=targets.frame, frame_samples=targets.frame_samples,
            blend=targets.blend, footprint=targets.footprint,
        )  # fmt: skip
        self._sampler.observe(samples, self._now)

    def _insert(self, batch: Batch) -> None:
        """Show it, or the frame that it completes. Nothing gets lost or repeated here, so samples are counted."""
        if batch.frame == 0:
            self._buffer.insert(batch)
            return
        self._frame.append(replace(batch, frame=0))
        if sum(len(part.samples) + part.skipped for part in self._frame) >= batch.frame_samples:
            for part in self._frame:
                self._buffer.insert(part)
            self._frame.clear()


def framed(setup: Setup) -> SamplerMethod:
    """Double buffering: a frame's event is the one it began under; it is shown from its last ray on."""
    return SamplerMethod(setup, FramedSampler(setup.rect, FrameCounter(1), batch=FRAMED_BATCH))


def framed_x10(setup: Setup) -> SamplerMethod:
    """`framed` with ten times the rays."""
    return framed(replace(setup, rate=10 * setup.rate))


def frameless(setup: Setup) -> SamplerMethod:
    """Bishop et al.'s: random order, each sample shown at once."""
    return SamplerMethod(setup, FramelessSampler(setup.rect, batch=_batch(setup), seed=setup.seed))


def hilbert(setup: Setup) -> SamplerMethod:
    """Parker et al.'s, at the settings that configurations have by default."""
    own = HilbertSampling()
    sampler = HilbertSampler(
        setup.rect,
        batch=_batch(setup),
        seed=setup.seed,
        chunk=own.chunk_pixels,
        camera_update_percent=own.camera_update_percent,
        blend=own.blend,
    )
    return SamplerMethod(setup, sampler)


def _batch(setup: Setup) -> int:
    """Rays that may share an event."""
    return min(MAX_SAMPLES, max(1, int(setup.rate * setup.input_step_s)))


METHODS: dict[str, Callable[[Setup], Method]] = {
    "framed": framed,
    "framed_x10": framed_x10,
    "frameless": frameless,
    "hilbert": hilbert,
}
