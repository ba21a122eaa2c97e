"""Resolve splat sums to an image without holes: a pyramid of ever coarser sums, kept from image to image."""

from __future__ import annotations

from functools import partial
from itertools import pairwise

import numpy as np

from wall.core.data import Float32
from wall.core.threads import Threads
from wall.deepbuffer.kernels.pixel_buffer import TILE
from wall.reconstruction.kernels import fill as kernels

ALONE = Threads()


class Pyramid:
    """The levels of one image size; `levels[k]` holds pixels of 2^(k + 1) on an edge, radiance and weight."""

    def __init__(self, height: int, width: int) -> None:
        self.levels: list[Float32] = [np.zeros((*size, 4), np.float32) for size in pyramid_sizes(height, width)]
        self._holes = np.zeros(height * width, np.uint32)

    @property
    def bytes(self) -> int:
        """Memory of all its arrays."""
        return self._holes.nbytes + sum(level.nbytes for level in self.levels)

    def resolve(self, sums: Float32, resolved: Float32, threads: Threads = ALONE) -> None:
        """Write means, and fill holes (push-pull).

        sums : (h + 2, w + 2, 4) float32, see kernels.splat; resolved : (h, w, 3) float32, written
        threads : they share the rows
        """
        levels, (height, width) = self.levels, resolved.shape[:2]

        def resolve(top: int, bottom: int) -> tuple[int, int]:
            count = kernels.resolve_splats(sums, levels[0], resolved, self._holes, top, bottom)
            return top * width, count

        holes = threads.share(height, resolve, unit=TILE)
        for fine, coarse in pairwise(levels):
            kernels.halve(fine, coarse)
        filled: Float32 | None = None
        for level in reversed(levels):
            threads.share(len(level), partial(kernels.expand, level, filled), unit=TILE)
            filled = level

        def fill(first: int, last: int) -> None:
            for start, count in holes[first:last]:
                kernels.fill_holes(sums, levels[0], self._holes[start:], count, resolved)

        threads.share(len(holes), fill)


def pyramid_sizes(height: int, width: int) -> list[tuple[int, int]]:
    """Rows and columns of a pyramid's levels: at least one, down to one pixel."""
    sizes: list[tuple[int, int]] = []
    while not sizes or width > 1 or height > 1:
        height, width = -(-height // 2), -(-width // 2)
        sizes.append((height, width))
    return sizes
