"""A sweep: one ray near the middle of each pixel of an image that has none yet, in packets of neighbours.

Sweeps of ever finer images follow each other: a finer one leaves out the pixels that coarser ones have sampled, so that
all together cost as many rays as the finest alone.
"""

from __future__ import annotations

import numpy as np

from wall.core.data import Float32, Rect
from wall.sampling.ownership import block_order


class Sweep:
    """The rays of one sweep: `take` batches until there is none left."""

    def __init__(self, size: tuple[int, int], grid: tuple[int, int], known: Float32) -> None:
        """`size`: pixels of the panel; `grid`: of the image; `known`: (n, 2) positions on the panel that have rays."""
        pixels = block_order(Rect(x=0, y=0, width=grid[0], height=grid[1]), worker=0, workers=1)
        edge = np.array(size, np.float32) / np.array(grid, np.float32)
        has_ray = np.zeros((grid[1], grid[0]), np.bool_)
        column, row = np.minimum((known / edge).astype(np.intp), np.array(grid) - 1).T
        has_ray[row, column] = True
        missing = pixels[~has_ray[pixels[:, 1], pixels[:, 0]]]
        middle = np.floor((missing + np.float32(0.5)) * edge) + np.float32(0.5)  # of a pixel of the panel: no border's
        self.xy: Float32 = middle.astype(np.float32)
        self._taken = 0

    def take(self, rays: int) -> Float32:
        """The next positions, (n, 2) float32 panel pixels, none once all are taken."""
        batch = self.xy[self._taken : self._taken + rays]
        self._taken += len(batch)
        return batch

    @property
    def left(self) -> int:
        """Rays that are still to be taken."""
        return len(self.xy) - self._taken
