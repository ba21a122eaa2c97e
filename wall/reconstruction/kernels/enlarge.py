"""Enlarge an image of fewer pixels: smooth channels bilinearly, the others by the nearest pixel that shows anything.

Display codes by a Catmull-Rom spline (Catmull and Rom 1974; Keys 1981) that is kept from overshooting.
"""

from __future__ import annotations

import numpy as np

from wall.core.jit import inline_kernel, kernel
from wall.deepbuffer.kernels.pixel_buffer import TILE

uint32 = np.uint32  # as indices: no test whether they count from the end
ZERO, ONE, HALF = np.float32(0.0), np.float32(1.0), np.float32(0.5)


@kernel
def enlarged_tiles(dirty, first_row, last_row, first_column, last_column, out):
    """Which tiles of the large image take from dirty ones of the small image.

    dirty : (rows, columns) bool, tiles of the small image; out : (n, m) bool, of the large one, written
    first_row, last_row : (n,) int32, the small image's tiles that a row of tiles takes from; columns likewise, (m,)
    """
    for i in range(out.shape[0]):
        for j in range(out.shape[1]):
            found = False
            for row in range(first_row[i], last_row[i] + 1):
                for column in range(first_column[j], last_column[j] + 1):
                    found = found or dirty[row, column]
            out[i, j] = found


@kernel
def interpolate(source, row, row_share, column, column_share, dirty, out):
    """Write the dirty tiles of an enlarged image: each pixel between the four around its centre.

    Parameters
    ----------
    source : (h, w, c) float32
    row : (H, 2) int32, the two rows of `source` around each row of `out`; row_share : (H,) float32, of the second
    column, column_share : likewise, (W, 2) and (W,)
    dirty : (rows, columns) bool, tiles of `out`
    out : (H, W, c) float32, written
    """
    for i in range(out.shape[0]):
        for j in range(out.shape[1]):
            if not dirty[i // TILE, j // TILE]:
                continue
            a, b, c, d = row[i, 0], row[i, 1], column[j, 0], column[j, 1]
            down, right = row_share[i], column_share[j]
            for k in range(out.shape[2]):
                upper = (ONE - right) * source[a, c, k] + right * source[a, d, k]
                lower = (ONE - right) * source[b, c, k] + right * source[b, d, k]
                out[i, j, k] = (ONE - down) * upper + down * lower


@kernel
def enlarge_codes(small, row, row_weight, column, weight, dirty, rgb):
    """Write the dirty tiles of an enlarged image of display codes: cubic between four, within the middle two, rounded.

    Parameters
    ----------
    small : (h, 3 w) uint8
    row : (H, 4) int32, the rows of `small` around each row of `rgb`; row_weight : (H, 4) float32
    column, weight : (4, 3 W), likewise, the values of a row of `small` around each value of a row of `rgb`
    dirty : (rows, columns) bool, tiles of `rgb`
    rgb : (H, 3 W) uint8, written
    """
    line, edge = np.empty(small.shape[1], np.float32), 3 * TILE
    for tile in range(dirty.shape[0]):
        start = 0
        while start < dirty.shape[1]:
            end = start + 1
            while end < dirty.shape[1] and dirty[tile, end] == dirty[tile, start]:  # a run of tiles
                end += 1
            left, right = start * edge, min(end * edge, rgb.shape[1])
            for y in range(tile * TILE, min((tile + 1) * TILE, rgb.shape[0]) if dirty[tile, start] else 0):
                first, second, third, fourth = small[row[y, 0]], small[row[y, 1]], small[row[y, 2]], small[row[y, 3]]
                p, q, r, s = row_weight[y]
                for k in range(column[0, left], column[3, right - 1] + 1):
                    b, c = np.float32(second[k]), np.float32(third[k])
                    line[k] = limited(p * np.float32(first[k]) + q * b + r * c + s * np.float32(fourth[k]), b, c)
                for k in range(left, right):
                    b, c = line[uint32(column[1, k])], line[uint32(column[2, k])]
                    outer = weight[0, k] * line[uint32(column[0, k])] + weight[3, k] * line[uint32(column[3, k])]
                    value = limited(outer + weight[1, k] * b + weight[2, k] * c, b, c)
                    rgb[y, k] = np.uint8(np.int32(value + HALF))
            start = end


@inline_kernel
def limited(value, a, b):
    """The value, or the one of a and b that it lies beyond: what overshoots at an edge would ring."""
    return min(max(value, min(a, b)), max(a, b))


@kernel
def nearest_shown(alpha, width, row, row_share, column, column_share, dirty, source):
    """Which pixel of the small image each pixel of the enlarged one has its surface of, in the dirty tiles.

    Of the four around its centre the nearest that is covered at all, or else the nearest: so what has a colour has a
    depth, and no depth lies between two surfaces.

    Parameters
    ----------
    alpha : (h, w) float32 | None, share of each pixel that is covered; None: all are
    width : int, w
    row, row_share, column, column_share, dirty : see interpolate
    source : (H, W) int32, written: index of the pixel
    """
    for i in range(source.shape[0]):
        for j in range(source.shape[1]):
            if not dirty[i // TILE, j // TILE]:
                continue
            best, found = -ONE, 0
            for m in range(2):
                for n in range(2):
                    share = side(row_share[i], m) * side(column_share[j], n)
                    if alpha is not None:
                        covered = alpha[row[i, m], column[j, n]] > ZERO
                        share = share if covered and share > ZERO else share - ONE
                    if share > best:
                        best, found = share, row[i, m] * width + column[j, n]
            source[i, j] = found


@inline_kernel
def side(share, second):
    """The share of the first or of the second of two pixels."""
    return share if second else ONE - share


@kernel
def take(values, source, dirty, out):
    """Copy one value for each pixel of the dirty tiles: out[i, j] = values[source[i, j]].

    values : (n,); source : (H, W) int32; dirty : (rows, columns) bool, tiles of `out`; out : (H, W), written
    """
    for i in range(out.shape[0]):
        for j in range(out.shape[1]):
            if dirty[i // TILE, j // TILE]:
                out[i, j] = values[source[i, j]]
