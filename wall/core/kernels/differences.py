"""Where two images differ."""

from __future__ import annotations

import numpy as np

from wall.core.jit import inline_kernel, kernel


@kernel
def mark_differing(a, b, rows, columns, differs):
    """Mark the tiles in which two images differ. Stops at a tile's first row that differs.

    a, b : (h, n) uint8, of one shape; rows, columns : int, of a tile, numbers
    differs : (ceil(h / rows), ceil(n / columns)) bool, written
    """
    height, width = a.shape
    for m in range(differs.shape[0]):
        for n in range(differs.shape[1]):
            left, right = n * columns, min((n + 1) * columns, width)
            i, last = m * rows, min((m + 1) * rows, height)
            while i < last and same(a[i, left:right], b[i, left:right]):
                i += 1
            differs[m, n] = i < last


@inline_kernel
def same(a, b):
    """Whether two rows (n,) uint8 are the same. No early exit, so that the loop is vector code."""
    different = np.uint8(0)
    for k in range(a.shape[0]):
        different |= a[k] ^ b[k]
    return different == 0
