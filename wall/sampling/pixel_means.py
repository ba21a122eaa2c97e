"""Means of many samples of each pixel, for `wall render`, for references and for progressive sampling.

Sample k of pixel (x, y) lies at the k-th point of the R2 sequence, shifted by a hash of (seed, x, y): well spread in
every pixel, different between pixels, and the same however the image is divided among threads and ranks.
R2: M. Roberts, "The Unreasonable Effectiveness of Quasirandom Sequences", 2018.
"""

from __future__ import annotations

import math

import numpy as np

from wall.core.data import Float32, Float64, Rect, Samples
from wall.sampling.kernels import permutation as kernels
from wall.sampling.ownership import block_order

SMALLEST_FOOTPRINT = 1 / 8  # pixels


def footprint_of(spp: int) -> float:
    """Edge of the square, pixels, that each of `spp` samples of a pixel stands for."""
    return max(SMALLEST_FOOTPRINT, 1.0 / math.sqrt(spp))


class PixelMeans:
    """One band of an image: `positions(k)` for sample k of every pixel, `add` what was traced, `mean()` at the end."""

    def __init__(self, rect: Rect, *, seed: int) -> None:
        self._pixels, self._rect, self._seed = block_order(rect, worker=0, workers=1), rect, seed
        self._sums = np.zeros((rect.height, rect.width, 3))
        self.counts = np.zeros((rect.height, rect.width), np.int64)  # samples of each pixel so far

    def positions(self, k: int) -> Float32:
        """(n, 2) float32 panel pixels, 16 of a 4 x 4 block in a row."""
        xy = np.empty((len(self._pixels), 2), np.float32)
        kernels.progressive_positions(self._pixels, self._seed, k, xy)
        return xy

    def add(self, samples: Samples) -> None:
        """Add samples to their pixels' sums."""
        kernels.accumulate(samples, self._rect.x, self._rect.y, self._sums, self.counts)

    def mean(self) -> Float64:
        """(h, w, 3) float64 linear RGB; pixels whose samples were all unusable are 0."""
        return self._sums / np.maximum(self.counts, 1)[:, :, None]
