"""Divisions of a region into tiles: what the adaptive sampler asks of one, and the fixed grid."""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from wall.core.data import Float32
from wall.deepbuffer.kernels.pixel_buffer import TILE
from wall.geometry.hilbert import hilbert_order
from wall.sampling.kernels.adaptive import Tiles


class Measured(NamedTuple):
    """What the sampler knows of each tile."""

    rects: NDArray[np.uint16]  # (n, 4) x, y, width, height, panel pixels
    contrast: Float32  # (n,) mean difference of brightness between neighbouring pixels, display units
    density: Float32  # (n,) samples a pixel


class Division(Protocol):
    """A way to divide a region: the grid here, or the K-D cut."""

    tiles: Tiles

    def adjust(self, score: Float32, steps: int) -> int:
        """Take at most so many steps towards the division that suits the scores (h, w); returns how many."""
        ...

    def balance(self, contrast: Float32, change: float) -> None:
        """Learn how much the image varies: in space, (h, w) squared, and over the age of its samples."""
        ...


class Grid:
    """A Division into squares of 16 pixels, cut off at the right and lower borders; it never changes.

    They follow each other along a Hilbert curve: 16 rays of four tiles lie in a square, not in a row, so packets find
    more in common.
    """

    def __init__(self, width: int, height: int) -> None:
        rows, columns = -(-height // TILE), -(-width // TILE)
        y, x = np.mgrid[0:height:TILE, 0:width:TILE].reshape(2, -1)
        rects = np.stack([x, y, np.minimum(TILE, width - x), np.minimum(TILE, height - y)], axis=1).astype(np.int32)
        across, down = hilbert_order(columns, rows).T
        tile_of = np.arange(height)[:, None] // TILE * columns + np.arange(width) // TILE
        sums = rects[:, 2].astype(np.float64) * rects[:, 3]
        self.tiles = Tiles(rects=rects, sums=sums, tile_of=tile_of.astype(np.int32), order=down * columns + across)

    def adjust(self, score: Float32, steps: int) -> int:
        """Change nothing."""
        return 0

    def balance(self, contrast: Float32, change: float) -> None:
        """Learn nothing."""
