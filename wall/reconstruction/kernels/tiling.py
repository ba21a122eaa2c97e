"""What another process measured in its tiles, brought to the picture's own 16-pixel squares."""

from __future__ import annotations

import numpy as np

from wall.core.jit import kernel
from wall.deepbuffer.kernels.pixel_buffer import TILE


@kernel
def spread(rects, values, x0, y0, height, width, squares, covered):
    """Mean of tiles' values over each 16-pixel square, by area; what tiles do not cover keeps its value.

    Parameters
    ----------
    rects : (n, 4) uint16, x, y, width, height, panel pixels; values : (n,) float32
    x0, y0 : panel pixel of the picture's corner; height, width : of the picture, pixels
    squares : (rows, columns) float32, updated
    covered : (rows, columns, 2) float32, scratch: area, area times value
    """
    covered[:] = np.float32(0.0)
    for k in range(rects.shape[0]):
        left, top = np.int64(rects[k, 0]) - x0, np.int64(rects[k, 1]) - y0
        right, bottom = min(left + np.int64(rects[k, 2]), width), min(top + np.int64(rects[k, 3]), height)
        left, top = max(left, 0), max(top, 0)
        if left >= right or top >= bottom:
            continue
        for r in range(top // TILE, (bottom - 1) // TILE + 1):
            rows = min(bottom, (r + 1) * TILE) - max(top, r * TILE)
            for c in range(left // TILE, (right - 1) // TILE + 1):
                area = np.float32(rows * (min(right, (c + 1) * TILE) - max(left, c * TILE)))
                covered[r, c, 0] += area
                covered[r, c, 1] += area * values[k]
    for r in range(squares.shape[0]):
        for c in range(squares.shape[1]):
            whole = np.float32((min((r + 1) * TILE, height) - r * TILE) * (min((c + 1) * TILE, width) - c * TILE))
            area = min(covered[r, c, 0], whole)  # tiles that lie over each other count no more than the square
            if area > np.float32(0.0):
                mean = covered[r, c, 1] / covered[r, c, 0]
                squares[r, c] += (area / whole) * (mean - squares[r, c])
