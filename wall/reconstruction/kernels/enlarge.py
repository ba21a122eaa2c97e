"""Enlarge an image of fewer pixels: smooth channels bilinearly, the others by the nearest pixel that shows anything."""

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
    channels = out.shape[2]
    wide, large = np.empty((2, out.shape[1] * channels), np.float32), out.reshape(out.shape[0], -1)
    for tile in range(dirty.shape[0]):
        for start in range(dirty.shape[1]):
            if not dirty[tile, start]:
                continue
            left, right = start * TILE, min((start + 1) * TILE, out.shape[1])
            held = np.full(2, -1)  # the rows of `source`, that is row k in wide[k % 2]
            for y in range(tile * TILE, min((tile + 1) * TILE, out.shape[0])):
                for side in range(2):
                    k = row[y, side]
                    if held[k % 2] != k:
                        held[k % 2] = k
                        widen_pixels(source[k], column[left:right], column_share[left:right], wide[k % 2])
                upper, lower, f = wide[row[y, 0] % 2], wide[row[y, 1] % 2], row_share[y]
                values = large[y, left * channels : right * channels]
                for n in range(len(values)):
                    values[n] = (ONE - f) * upper[n] + f * lower[n]


@inline_kernel
def widen_pixels(line, column, share, wide):
    """Enlarge a part of a row of pixels, (w, c) float32, see interpolate. wide : (n c,) float32 or more, written"""
    channels = line.shape[1]
    for j in range(len(share)):
        a, b, right = uint32(column[j, 0]), uint32(column[j, 1]), share[j]
        for k in range(channels):
            wide[j * channels + k] = (ONE - right) * line[a, uint32(k)] + right * line[b, uint32(k)]


@kernel
def enlarge_codes(small, row, row_share, first, second, share, dirty, rgb):
    """Write the dirty tiles of an enlarged image of display codes: each between the four around its centre, rounded.

    Parameters
    ----------
    small : (h, 3 w) uint8
    row, row_share : see interpolate
    first, second : (3 W,) int32, the two of a row of `small` around each value of a row of `rgb`
    share : (3 W,) float32, of the second
    dirty : (rows, columns) bool, tiles of `rgb`
    rgb : (H, 3 W) uint8, written
    """
    wide, edge = np.empty((2, rgb.shape[1]), np.float32), 3 * TILE  # two rows of `small`, as wide as `rgb`
    for tile in range(dirty.shape[0]):
        start = 0
        while start < dirty.shape[1]:
            end = start + 1
            while end < dirty.shape[1] and dirty[tile, end] == dirty[tile, start]:  # a run of tiles
                end += 1
            left, right = start * edge, min(end * edge, rgb.shape[1])
            i, j, g = first[left:right], second[left:right], share[left:right]
            held = np.full(2, -1)  # the rows of `small`, that is row k in wide[k % 2]
            for y in range(tile * TILE, min((tile + 1) * TILE, rgb.shape[0]) if dirty[tile, start] else 0):
                for side in range(2):
                    k = row[y, side]
                    if held[k % 2] != k:
                        held[k % 2] = k
                        widen(small[k], i, j, g, wide[k % 2])
                upper, lower, f, out = wide[row[y, 0] % 2], wide[row[y, 1] % 2], row_share[y], rgb[y, left:right]
                for k in range(right - left):
                    out[k] = np.uint8(np.int32(upper[k] + f * (lower[k] - upper[k]) + HALF))
            start = end


@inline_kernel
def widen(line, first, second, share, wide):
    """Enlarge a part of a row of codes, (3 w,) uint8: each value between two, see enlarge_codes. wide : written"""
    for k in range(len(first)):
        a, b = np.float32(line[uint32(first[k])]), np.float32(line[uint32(second[k])])
        wide[k] = a + share[k] * (b - a)


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
