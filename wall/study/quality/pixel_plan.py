"""Pixels by their priority, for methods that choose about one refresh's rays at a time."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from wall.core.data import Float32
from wall.study.quality.kernels import render_cache as kernels

TURN = 0.6180339887  # golden ratio: first errors of the dithering are spread evenly from plan to plan


class PixelPlan:
    """`make` a plan from priorities, then `take` its pixels in parts, in random order."""

    def __init__(self, priority: Float32, seed: int) -> None:
        """`priority`: (h, w) float32, the method's own, read at every plan."""
        self._priority, self._seed = priority, seed
        self._chosen = np.zeros((priority.size, 2), np.int32)
        self._count = self._at = self._plans = 0

    def make(self, wanted: float) -> None:
        """Choose about so many pixels."""
        self._plans += 1
        first_error = self._plans * TURN % 1.0 - 0.5
        self._count = kernels.choose_pixels(self._priority, float(math.ceil(wanted)), first_error, self._chosen)
        self._at = 0
        kernels.shuffle_rows(self._chosen, self._count, self._seed * 1_000_003 + self._plans)

    def take(self, count: int, wanted: float) -> NDArray[np.int32]:
        """(n, 2) the next pixels, up to `count`; of a new plan of about `wanted` where none is left."""
        if self._at >= self._count:
            self.make(wanted)
        first, self._at = self._at, min(self._at + count, self._count)
        return self._chosen[first : self._at]
