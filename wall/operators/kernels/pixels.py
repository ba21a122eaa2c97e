"""Compiled loops of compositing: select between two images pixel by pixel, blend, average, encode.

Arrays are whole channels of framelets, C-contiguous; corners in pixels say where in each array to work.
"""

from __future__ import annotations

import math
from typing import Any, TypeAlias

import numpy as np

from wall.core.data import Float32
from wall.core.jit import inline_kernel, kernel

uint = np.uint64  # type of indices: numba need not test whether they count from the end
CHUNK = 512  # pixels of a row that are copied before they are replaced: 8 kB, in the fastest cache
ZERO, ONE, HALF = np.float32(0.0), np.float32(1.0), np.float32(0.5)


# An image whose pixels are selected by a key: colour (h, w, 3) uint32 or uint8, bits that are moved; key (h, w), depths
# or times; x, y of the corner that is worked on; what is added to the keys. A plain tuple: calls for small bands are
# many, and numba takes some 10 us to recognise each NamedTuple.
Keyed: TypeAlias = tuple[Any, Float32, int, int, np.float32]


@kernel
def write_better(a, b, sign, out, width, height, taken):
    """Take each pixel from b where sign * key of b is below sign * key of a, else from a. NaN keys never win.

    Parameters
    ----------
    a, b, out : Keyed; `out` is written, its shift is not used. Its arrays must not be those of a or b
    sign : float32, 1: the smallest wins, -1: the largest
    width, height : int, of the part that is written
    taken : (>= height, >= width) uint8, written: 1 where b won, else 0

    Returns
    -------
    missing : int, pixels where neither key is a number; their key is NaN
    """
    a_colour, a_key, ax, ay, a_shift = a
    b_colour, b_key, bx, by, b_shift = b
    colour, key, x, y, _ = out
    missing = 0
    for row in range(height):
        i, j, o = (ay + row) * a_key.shape[1] + ax, (by + row) * b_key.shape[1] + bx, (y + row) * key.shape[1] + x
        t = row * taken.shape[1]
        won, neither = better_keys((a_key, i, a_shift), (b_key, j, b_shift), sign, (key, o), (taken, t), width)
        missing += neither
        if won == 0:
            copy_colours(a_colour, i, colour, o, width)
        elif won == width:
            copy_colours(b_colour, j, colour, o, width)
        else:
            mix_colours((a_colour, i), (b_colour, j), (taken, t), colour, o, width)
    return missing


@kernel
def replace_worse(b, sign, out, width, height, taken):
    """Replace the pixels of `out` whose key is worse than b's; else as `write_better`.

    Rows are copied before they are replaced, so that the compiler sees that reads and writes do not overlap and makes
    vector code.
    """
    b_colour, b_key, bx, by, b_shift = b
    colour, key, x, y, _ = out
    before, colours = np.empty(CHUNK, np.float32), np.empty((CHUNK, 3), colour.dtype)
    missing, none = 0, np.float32(0.0)
    for row in range(height):
        for first in range(0, width, CHUNK):
            n = min(CHUNK, width - first)
            j, o = (by + row) * b_key.shape[1] + bx + first, (y + row) * key.shape[1] + x + first
            t = row * taken.shape[1] + first
            for k in range(n):
                before[k] = key[y + row, x + first + k]
            won, neither = better_keys((before, 0, none), (b_key, j, b_shift), sign, (key, o), (taken, t), n)
            missing += neither
            if won == n:
                copy_colours(b_colour, j, colour, o, n)
            elif won > 0:
                copy_colours(colour, o, colours, 0, n)
                mix_colours((colours, 0), (b_colour, j), (taken, t), colour, o, n)
    return missing


@inline_kernel
def better_keys(a, b, sign, out, mask, n):
    """Write the better of n keys in a row, and to the mask 1 where b's is; returns their number, and how many are NaN.

    a, b : (array, first index, shift); out, mask : (array, first index)
    """
    one, other, keys, taken = a[0].reshape(-1), b[0].reshape(-1), out[0].reshape(-1), mask[0].reshape(-1)
    i, j, o, t = uint(a[1]), uint(b[1]), uint(out[1]), uint(mask[1])
    won, missing = np.int32(0), np.int32(0)
    for k in range(n):
        p, q = one[i + uint(k)] + a[2], other[j + uint(k)] + b[2]
        win = (sign * q < sign * p) | ((p != p) & (q == q))
        keys[o + uint(k)] = q if win else p
        taken[t + uint(k)] = np.uint8(win)
        won += np.int32(win)
        missing += np.int32((p != p) & (q != q))
    return won, missing


@inline_kernel
def copy_colours(source, s, colour, o, n):
    """Copy n colours in a row."""
    one, out = source.reshape(-1), colour.reshape(-1)
    first, to = uint(s) * uint(3), uint(o) * uint(3)
    for j in range(3 * n):
        out[to + uint(j)] = one[first + uint(j)]


@inline_kernel
def mix_colours(a, b, taken, colour, o, n):
    """Write n colours in a row, b's where taken is 1, else a's; by bits, as noisy depths would mispredict a branch.

    a, b, taken : (array, first index); colour, o : output and its first index
    """
    one, other, out, mask = a[0].reshape(-1), b[0].reshape(-1), colour.reshape(-1), taken[0].reshape(-1)
    p, q, t, to = uint(a[1]) * uint(3), uint(b[1]) * uint(3), uint(taken[1]), uint(o) * uint(3)
    for j in range(n):
        bits, k = np.uint32(-np.int32(mask[t + uint(j)])), uint(3) * uint(j)
        for c in range(3):
            first, second = one[p + k + uint(c)], other[q + k + uint(c)]
            out[to + k + uint(c)] = np.uint32(first ^ np.uint32(np.uint32(first ^ second) & bits))


@kernel
def add_behind(source, source_alpha, sx, sy, colour, alpha, x, y, width, height):
    """Add an image behind what is there already: Porter and Duff's over, front to back, premultiplied.

    Parameters
    ----------
    source : (h, w, 3) float32, linear, premultiplied; source_alpha : (h, w) float32, clipped to 0..1; NaN
        counts as 0
    sx, sy : int, corner in them
    colour, alpha : (h, w, 3) and (h, w) float32, updated
    x, y, width, height : int, the part of them

    Source: Porter and Duff, Compositing digital images, SIGGRAPH 1984. What is fully hidden has no influence, not even
    if it is infinite or NaN.
    """
    share = np.empty(3 * width, np.float32)
    coverage, total = source_alpha.reshape(-1), alpha.reshape(-1)
    for row in range(height):
        s, o = (sy + row) * source_alpha.shape[1] + sx, (y + row) * alpha.shape[1] + x
        for j in range(width):
            through, a = ONE - total[uint(o) + uint(j)], coverage[uint(s) + uint(j)]
            there = (through > ZERO) & (a == a)
            a = min(max(a, ZERO), ONE)
            total[uint(o) + uint(j)] += through * a if there else ZERO
            for c in range(3):
                share[uint(3) * uint(j) + uint(c)] = through if there else ZERO
        add_shares(source, 3 * s, share, colour, 3 * o, 3 * width)


@inline_kernel
def add_shares(source, s, share, colour, o, n):
    """colour += share * source, n values in a row; where the share is 0, the source may be anything."""
    one, out = source.reshape(-1), colour.reshape(-1)
    for k in range(n):
        value, w = one[uint(s) + uint(k)], share[k]
        out[uint(o) + uint(k)] += w * (value if w > ZERO else ZERO)


@kernel
def add_to_means(source, weight, sx, sy, colour, total, x, y, width, height):
    """Add an image to weighted means by a running update, which cannot cancel: mean += (value - mean) w / sum of w.

    Parameters
    ----------
    source : (h, w, c) float32; sx, sy : int, corner in it
    weight : (height, width) float32; what is not above 0 has no influence
    colour : (h, w, c) float32, the means so far, updated
    total : (height, width) float32, sum of the weights so far, updated
    x, y, width, height : int, the part of `colour`

    Source: West, Updating mean and variance estimates, CACM 22(9), 1979.
    """
    channels = colour.shape[2]
    one, out, share = source.reshape(-1), colour.reshape(-1), np.empty(channels * width, np.float32)
    for i in range(height):
        for j in range(width):
            w = weight[i, j] if weight[i, j] > ZERO else ZERO
            total[i, j] += w
            for c in range(channels):
                share[uint(channels) * uint(j) + uint(c)] = w / total[i, j] if w > ZERO else ZERO
        s, o = channels * ((sy + i) * source.shape[1] + sx), channels * ((y + i) * colour.shape[1] + x)
        for k in range(channels * width):
            mean, w = out[uint(o) + uint(k)], share[k]
            value = one[uint(s) + uint(k)] if w > ZERO else mean
            out[uint(o) + uint(k)] = mean + (value - mean) * w


@inline_kernel
def encode_row(values, curve, places, codes):
    """8-bit sRGB of linear light, clipped to 0..1, NaN as 0; its first loop is vector code.

    values : (n,) float32; curve : (4097,) uint8, see wall.core.colour.srgb_curve
    places : (n,) int32 or longer, scratch; codes : (n,) uint8, written
    """
    steps = np.float32(curve.shape[0] - 1)
    for k in range(values.shape[0]):
        value = min(values[k], ONE) if values[k] > ZERO else ZERO
        places[k] = np.int32(math.sqrt(value) * steps + HALF)
    for k in range(values.shape[0]):
        codes[k] = curve[uint(places[k])]


@kernel
def encode(source, sx, sy, curve, rgb, x, y, width, height):
    """Linear light to display values.

    source : (h, w, 3) float32, linear; sx, sy : int, corner in it
    curve : (4097,) uint8, see wall.core.colour.srgb_curve
    rgb : (h, w, 3) uint8, sRGB, the part x, y, width, height is written
    """
    one, out, places = source.reshape(-1), rgb.reshape(-1), np.empty(3 * width, np.int32)
    for row in range(height):
        s, o = 3 * ((sy + row) * source.shape[1] + sx), 3 * ((y + row) * rgb.shape[1] + x)
        encode_row(one[s : s + 3 * width], curve, places, out[o : o + 3 * width])
