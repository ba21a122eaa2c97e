"""Frameless sampling over a Hilbert curve, after Parker et al., "Interactive Ray Tracing", 1999.

- The region's pixels lie on a Hilbert curve; the curve is broken into chunks, dealt round-robin to the workers.
- Each worker visits its chunks in a random order, new every sweep.
- It takes the newest camera every `camera_update_percent` of its pixels, not in between.
- A pixel has four sample positions; a visit renews two, so that a pixel is complete after two visits.
- New samples are blended into the image (`blend`): older ones fade exponentially.
- The worker keeps a running mean and variance of each of its pixels.
"""

from __future__ import annotations

import numpy as np

from wall.core.data import Event, Float32, Rect, Samples
from wall.sampling.base import Targets
from wall.sampling.kernels import permutation as kernels
from wall.sampling.ownership import hilbert_chunks, slots_of

SAMPLES_A_VISIT = 2
VISITS_TO_COMPLETE = 2
STATISTICS_WINDOW = 16.0  # samples; four complete visits


class HilbertSampler:
    """One thread's chunks of the curve, in a new random order every sweep."""

    coherent = True

    def __init__(
        self,
        rect: Rect,
        *,
        batch: int,
        seed: int,
        chunk: int = 64,
        camera_update_percent: float = 2.0,
        blend: float = 0.5,
        worker: int = 0,
        workers: int = 1,
    ) -> None:
        chunks = hilbert_chunks(rect, chunk=chunk, worker=worker, workers=workers)
        self._pixels = np.concatenate(chunks) if chunks else np.zeros((0, 2), np.int32)
        self._ends = np.cumsum([0, *(len(c) for c in chunks)])
        self._rect, self._slots = rect, slots_of(rect, self._pixels)
        self._chunk_of = np.repeat(np.arange(len(chunks)), np.diff(self._ends))
        self._visits = np.zeros(len(chunks), np.int64)  # of each chunk, ever; its parity picks the diagonal
        self._fresh = np.zeros(len(chunks), np.int64)  # of them, under the newest event
        self._order = np.arange(len(chunks), dtype=np.int32)
        self._seed, self._sweep, self._at = seed * workers + worker, 0, len(chunks)
        self._chunks_a_batch = max(1, batch // (SAMPLES_A_VISIT * chunk))
        self._update_after = max(1, round(len(self._pixels) * camera_update_percent / 100))
        self._since_update = self._update_after
        self._blend = blend
        self._event: Event | None = None
        self.count, self.mean, self._m2 = (np.zeros(len(self._pixels), np.float32) for _ in range(3))

    @property
    def variance(self) -> Float32:
        """(p,) float32: running variance of each owned pixel's luminance, 0 before its first sample."""
        return (self._m2 / np.maximum(self.count, 1)).astype(np.float32)

    def choose(self, newest: Event) -> Targets | None:
        """Two positions in each pixel of the next chunks; None once all chunks are complete."""
        event = self._take_camera(newest)
        xy = np.empty((self._chunks_a_batch * SAMPLES_A_VISIT * int(np.diff(self._ends).max(initial=0)), 2), np.float32)
        filled = 0
        for _ in range(self._chunks_a_batch):
            chunk = self._next_chunk()
            if chunk is None:
                break
            first, last = int(self._ends[chunk]), int(self._ends[chunk + 1])
            filled = kernels.jittered_pairs(self._pixels, first, last, int(self._visits[chunk] % 2), xy, filled)
            self._visits[chunk] += 1
            self._fresh[chunk] += 1
            self._since_update += last - first
            if self._since_update >= self._update_after:
                break
        return Targets(xy=xy[:filled], event=event, blend=self._blend) if filled else None

    def _take_camera(self, newest: Event) -> Event:
        """The event of the next batch: the newest one, but only after enough pixels, or when there is nothing to do."""
        due = self._since_update >= self._update_after or bool((self._fresh >= VISITS_TO_COMPLETE).all())
        if self._event is None or (due and newest.number != self._event.number):
            self._fresh[:] = 0
        if self._event is None or due:
            self._event, self._since_update = newest, 0
        return self._event

    def _next_chunk(self) -> int | None:
        """The next chunk of the sweep that is not complete yet; None once all are."""
        for _ in range(2):
            while self._at < len(self._order):
                chunk = int(self._order[self._at])
                self._at += 1
                if self._fresh[chunk] < VISITS_TO_COMPLETE:
                    return chunk
            kernels.shuffle(self._order, self._seed, self._sweep)
            self._sweep, self._at = self._sweep + 1, 0
        return None

    def observe(self, samples: Samples, base_time: float) -> None:
        """Update the running statistics of pixels."""
        kernels.running_statistics(
            samples, self._slots, self._rect.x, self._rect.y, self.count, self.mean, self._m2, STATISTICS_WINDOW
        )

    def forget(self, samples: Samples, base_time: float) -> None:
        """Visit the chunks of these samples again."""
        pixels = samples["xy"].astype(np.int32) - np.array([self._rect.x, self._rect.y], np.int32)
        slots = self._slots[pixels[:, 1], pixels[:, 0]]
        self._fresh[self._chunk_of[slots[slots >= 0]]] = (
            0  # slot -1: of another thread's pixel, lost before the sampler was switched
        )

    def restart(self) -> None:
        """Visit every chunk again."""
        self._fresh[:] = 0
