"""Frameless sampling: every pixel in random order without replacement, each under the newest input.

After Bishop, Fuchs, McMillan and Scher Zagier, "Frameless Rendering: Double Buffering Considered Harmful", 1994:
the order is a random permutation of the pixels, so that all are updated once a sweep and no structure shows. Within a
batch, which is traced under one event and sent at once, the order is free: there it follows a Hilbert curve.
"""

from __future__ import annotations

import numpy as np

from wall.core.data import Event, Rect, Samples
from wall.sampling.base import Targets
from wall.sampling.kernels import permutation as kernels
from wall.sampling.ownership import hilbert_chunks, slots_of

CHUNK = 64  # pixels of the Hilbert curve that are dealt to a thread at a time


class FramelessSampler:
    """One thread's pixels; a new permutation every sweep. Complete once each has a sample of the newest event."""

    coherent = False

    def __init__(self, rect: Rect, *, batch: int, seed: int, worker: int = 0, workers: int = 1) -> None:
        chunks = hilbert_chunks(rect, chunk=CHUNK, worker=worker, workers=workers)
        pixels = np.concatenate(chunks) if chunks else np.zeros((0, 2), np.int32)
        self._pixels, self._centres = pixels, (pixels + 0.5).astype(np.float32)
        self._slots, self._rect, self._batch = slots_of(rect, pixels), rect, batch
        self._order = np.arange(len(self._pixels), dtype=np.int32)
        self._epochs = np.zeros(len(self._pixels), np.uint32)  # epoch of each pixel's newest sample; 0: none
        self._epoch, self._number = 1, (-1, -1)
        self._missing = len(self._pixels)
        self._seed, self._sweep, self._at = seed * workers + worker, 0, len(self._pixels)

    def choose(self, newest: Event) -> Targets | None:
        """The next pixels of the permutation without a sample of `newest`; None once there are none."""
        if newest.number != self._number:
            self._number, self._epoch, self._missing = newest.number, self._epoch + 1, len(self._pixels)
        if self._missing == 0:
            return None
        numbers = np.empty(min(self._batch, self._missing), np.int32)
        filled = 0
        while filled < len(numbers):
            if self._at >= len(self._order):
                kernels.shuffle(self._order, self._seed, self._sweep)
                self._sweep, self._at = self._sweep + 1, 0
            taken, self._at = kernels.next_pixels(
                self._order, self._at, self._epochs, np.uint32(self._epoch), numbers[filled:]
            )
            filled += taken
        self._missing -= filled
        numbers.sort()  # along the curve: 16 in a row are neighbours, which doubles the tracing rate
        return Targets(xy=self._centres.take(numbers, axis=0), event=newest)

    def observe(self, samples: Samples, base_time: float) -> None:
        """Ignore the samples: the order is random."""

    def forget(self, samples: Samples, base_time: float) -> None:
        """Choose the pixels of these samples again."""
        self._missing += kernels.clear_epochs(
            samples["xy"], self._slots, self._rect.x, self._rect.y, self._epochs, np.uint32(self._epoch)
        )

    def restart(self) -> None:
        """Choose every pixel again."""
        self._epochs[:] = 0
        self._missing = len(self._pixels)
