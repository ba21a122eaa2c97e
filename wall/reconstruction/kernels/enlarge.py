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


@kernel
def enlarge_light(small, row, row_weight, column, column_weight, light):
    """Write an enlarged image of light: its square roots are on a cubic between four, within the middle two.

    small : (h, w, 3) float32, square roots; light : (H, W, 3) float32, written; others see enlarge_codes
    """
    wide, values = np.empty((small.shape[0], 3 * light.shape[1]), np.float32), light.reshape(light.shape[0], -1)
    for i in range(small.shape[0]):
        widen(small[i].reshape(-1), column, column_weight, wide[i])
    for i in range(light.shape[0]):
        p, q, r, s = row_weight[i]
        first, second, third, fourth = wide[row[i, 0]], wide[row[i, 1]], wide[row[i, 2]], wide[row[i, 3]]
        for k in range(values.shape[1]):
            b, c = second[k], third[k]
            root = limited(p * first[k] + q * b + r * c + s * fourth[k], b, c)
            values[i, k] = root * root


@inline_kernel
def widen_pixels(line, column, share, wide):
    """Enlarge a part of a row of pixels, (w, c) float32, see interpolate. wide : (n c,) float32 or more, written"""
    channels = line.shape[1]
    for j in range(len(share)):
        a, b, right = uint32(column[j, 0]), uint32(column[j, 1]), share[j]
        for k in range(channels):
            wide[j * channels + k] = (ONE - right) * line[a, uint32(k)] + right * line[b, uint32(k)]


@kernel
def enlarge_codes(small, row, row_weight, column, column_weight, dirty, rgb):
    """Write the dirty tiles of an enlarged image of display codes: cubic between four, within the middle two, rounded.

    Rows first, then columns.

    Parameters
    ----------
    small : (h, w, 3) uint8
    row, row_weight : (H, 4) int32, the rows of `small` around each row of `rgb`, and float32, what each weighs
    column, column_weight : (W, 4), likewise
    dirty : (rows, columns) bool, tiles of `rgb`
    rgb : (H, W, 3) uint8, written
    """
    wide, values = np.empty((4, 3 * rgb.shape[1]), np.float32), rgb.reshape(rgb.shape[0], -1)
    twice, rows = rgb.shape[1] == 2 * small.shape[1], np.empty((3, 3 * (small.shape[1] + 4)), np.float32)
    for tile in range(dirty.shape[0]):
        start = 0
        while start < dirty.shape[1]:
            end = start + 1
            while end < dirty.shape[1] and dirty[tile, end] == dirty[tile, start]:  # a run of tiles
                end += 1
            left, right = start * TILE, min(end * TILE, rgb.shape[1])
            held = np.full(4, -1)  # the rows of `small`, that is row k in wide[k % 4]
            for y in range(tile * TILE, min((tile + 1) * TILE, rgb.shape[0]) if dirty[tile, start] else 0):
                for tap in range(4):
                    k = row[y, tap]
                    if held[k % 4] != k:
                        held[k % 4] = k
                        if twice:
                            widen_twice(small[k].reshape(-1), left // 2, right // 2, column_weight, rows, wide[k % 4])
                        else:
                            widen(small[k].reshape(-1), column[left:right], column_weight[left:right], wide[k % 4])
                first, second = wide[row[y, 0] % 4], wide[row[y, 1] % 4]
                third, fourth = wide[row[y, 2] % 4], wide[row[y, 3] % 4]
                p, q, r, s = row_weight[y]
                out = values[y, 3 * left : 3 * right]
                for k in range(len(out)):
                    b, c = second[k], third[k]
                    value = limited(p * first[k] + q * b + r * c + s * fourth[k], b, c)
                    out[k] = np.uint8(np.int32(value + HALF))
            start = end


@inline_kernel
def widen(line, column, weight, wide):
    """Enlarge a part of a row of codes, or of light, (3 w,), see enlarge_codes. wide : (3 W,) float32, written"""
    for j in range(len(column)):
        p, q, r, s = weight[j, 0], weight[j, 1], weight[j, 2], weight[j, 3]
        i, k = uint32(3) * uint32(column[j, 0]), uint32(3) * uint32(column[j, 1])
        m, n = uint32(3) * uint32(column[j, 2]), uint32(3) * uint32(column[j, 3])
        for channel in range(3):
            at = uint32(channel)
            b, c = np.float32(line[k + at]), np.float32(line[m + at])
            value = p * np.float32(line[i + at]) + q * b + r * c + s * np.float32(line[n + at])
            wide[uint32(3 * j) + at] = limited(value, b, c)


@inline_kernel
def widen_twice(line, first, last, weight, rows, wide):
    """Do what `widen` does, from the pixels `first` to `last` - 1 of a line half as long: its loops are vector code.

    weight : (W, 4) float32, of which all even rows are alike, and all odd ones; rows : (3, 3 w + 12) float32, scratch
    """
    padded, even, odd = rows[0], rows[1], rows[2]
    end, size = line.shape[0], 3 * (last - first)
    begin = 3 * (first - 2)  # of what the first pixel takes from
    inside, beyond = max(0, -begin), min(size + 12, end - begin)
    for n in range(inside):
        padded[n] = np.float32(line[n % 3])
    for n in range(inside, beyond):
        padded[n] = np.float32(line[begin + n])
    for n in range(beyond, size + 12):
        padded[n] = np.float32(line[end - 3 + n % 3])
    e0, e1, e2, e3 = weight[0, 0], weight[0, 1], weight[0, 2], weight[0, 3]
    o0, o1, o2, o3 = weight[1, 0], weight[1, 1], weight[1, 2], weight[1, 3]
    for n in range(size):
        a, b, c, d, e = padded[n], padded[n + 3], padded[n + 6], padded[n + 9], padded[n + 12]
        even[n] = limited(e0 * a + e1 * b + e2 * c + e3 * d, b, c)
        odd[n] = limited(o0 * b + o1 * c + o2 * d + o3 * e, c, d)
    for i in range(last - first):
        for channel in range(3):
            wide[uint32(6 * i + channel)] = even[uint32(3 * i + channel)]
            wide[uint32(6 * i + 3 + channel)] = odd[uint32(3 * i + channel)]


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
