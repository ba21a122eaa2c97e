"""Division of a region's pixels among the threads of a rank, made once.

A static division lets every thread keep what it likes about its pixels without locks (Parker et al. 1999).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wall.core.data import Rect
from wall.geometry.hilbert import hilbert_order
from wall.sampling.base import Pixels

BLOCK = 4  # a packet of 16 rays is a block of 4 x 4 pixels where the region allows


def hilbert_chunks(rect: Rect, *, chunk: int, worker: int, workers: int) -> list[Pixels]:
    """The worker's share of a region: runs of `chunk` pixels along a Hilbert curve, dealt round-robin."""
    order = hilbert_order(rect.width, rect.height) + np.array([rect.x, rect.y], np.int32)
    starts = range(0, len(order), chunk)
    return [order[start : start + chunk] for start in list(starts)[worker::workers]]


def block_order(rect: Rect, *, worker: int, workers: int) -> Pixels:
    """The worker's share of a region in raster order of 4 x 4 blocks, blocks dealt in bands of rows."""
    rows = np.arange(rect.height, dtype=np.int32)
    ys, xs = np.meshgrid(rows[rows // BLOCK % workers == worker], np.arange(rect.width, dtype=np.int32), indexing="ij")
    order = np.lexsort((xs.ravel(), ys.ravel(), xs.ravel() // BLOCK, ys.ravel() // BLOCK))
    return np.stack([xs.ravel()[order] + rect.x, ys.ravel()[order] + rect.y], axis=1).astype(np.int32)


def slots_of(rect: Rect, pixels: Pixels) -> NDArray[np.int32]:
    """(h, w) int32: each pixel of the region to its place in `pixels`, -1 where another thread owns it."""
    slots = np.full((rect.height, rect.width), -1, np.int32)
    slots[pixels[:, 1] - rect.y, pixels[:, 0] - rect.x] = np.arange(len(pixels), dtype=np.int32)
    return slots
