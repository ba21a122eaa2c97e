"""Framed rendering at reduced resolution: fewer rays a frame, so younger frames, enlarged bilinearly.

`reduced_N` has N rows for every 256 of the panel, and columns to keep its aspect. Which N is best depends on scene and
rate; a summary may choose it by hindsight.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
from numpy.typing import NDArray

from wall.core.data import Event, Float32, Samples
from wall.study.quality.baseline import FramedMethod
from wall.study.quality.method import Method, Setup

ROWS = (32, 48, 64, 96, 128, 160, 192)  # of FULL_ROWS
FULL_ROWS = 256


class EnlargingDisplay:
    """The newest frame, enlarged; unfiltered where its size is the panel's."""

    jittered = False

    def __init__(self, size: tuple[int, int], grid: tuple[int, int]) -> None:
        self._columns, self._rows = (between(n, m) for n, m in zip(size, grid, strict=True))
        self._frame = np.zeros((grid[1], grid[0], 3), np.float32)
        self._image: Float32 | None = None

    def take(self, raster: Samples, event: Event) -> None:
        """Takes a small frame, (h, w) samples, in place of the last."""
        self._frame[:], self._image = raster["radiance"], None

    def image(self, event: Event) -> Float32:
        """Returns the frame enlarged bilinearly to the display's size, (h, w, 3) linear RGB."""
        if self._image is None:
            (first, second, share), (left, right, part) = self._rows, self._columns
            rows = self._frame[first] * (1 - share)[:, None, None] + self._frame[second] * share[:, None, None]
            columns = rows[:, left] * (1 - part)[:, None] + rows[:, right] * part[:, None]
            self._image = columns.astype(np.float32)
        return self._image


def between(fine: int, coarse: int) -> tuple[NDArray[np.intp], NDArray[np.intp], Float32]:
    """For each of `fine` pixel centres: the two of `coarse` centres it lies between, and the second one's share."""
    at = (np.arange(fine) + 0.5) * coarse / fine - 0.5
    first = np.floor(at).astype(np.intp)
    share: Float32 = (at - first).astype(np.float32)
    return np.clip(first, 0, coarse - 1), np.clip(first + 1, 0, coarse - 1), share


def reduced(rows: int, setup: Setup) -> FramedMethod:
    """Frames of `rows` rows for every FULL_ROWS of the panel."""
    width, height = setup.size
    grid = (max(1, round(width * rows / FULL_ROWS)), max(1, round(height * rows / FULL_ROWS)))
    return FramedMethod(setup, grid, EnlargingDisplay(setup.size, grid))


METHODS: dict[str, Callable[[Setup], Method]] = {f"reduced_{rows}": partial(reduced, rows) for rows in ROWS}
