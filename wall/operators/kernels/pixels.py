"""What compositing does to every pixel: choose between two, lay one over another, encode.

Arrays are whole framelets' channels, C-contiguous; where to work is said by corners in pixels of each array.
"""

from __future__ import annotations

import math

import numpy as np

from wall.core.jit import inline_kernel, kernel

uint = np.uint64  # indices: no test whether they count from the end
CHUNK = 512  # pixels of a row that are copied before they are replaced: 8 kB, in the fastest cache
ZERO, ONE, HALF = np.float32(0.0), np.float32(1.0), np.float32(0.5)


@kernel
def choose(
    a_colour, a_key, ax, ay, a_shift, b_colour, b_key, bx, by, b_shift, sign, colour, key, x, y, width, height, taken
):  # fmt: skip
    """Take each pixel from b where sign * b_key is below sign * a_key, else from a. NaN keys never win.

    Parameters
    ----------
    a_colour, b_colour : (h, w, 3) uint32 or uint8, bits that are moved; a_key, b_key : (h, w) float32, depths or times
    ax, ay, bx, by : int, corners in a and b
    a_shift, b_shift : float32, added to the keys
    sign : float32, 1: the smallest wins, -1: the largest
    colour, key : (h, w, 3) and (h, w) of the same types, written: the winner's. Must not be a's or b's
    x, y, width, height : int, the part of `colour` and `key` that is written
    taken : (>= height, >= width) uint8, written: 1 where b won, else 0

    Returns
    -------
    nothing : int, pixels where neither key is a number; their key is NaN
    """
    nothing = 0
    for row in range(height):
        a, b, o = (ay + row) * a_key.shape[1] + ax, (by + row) * b_key.shape[1] + bx, (y + row) * key.shape[1] + x
        t = row * taken.shape[1]
        won, missing = choose_keys(a_key, a, a_shift, b_key, b, b_shift, sign, key, o, taken, t, width)
        nothing += missing
        if won == 0:
            copy_colours(a_colour, a, colour, o, width)
        elif won == width:
            copy_colours(b_colour, b, colour, o, width)
        else:
            mix_colours(a_colour, a, b_colour, b, taken, t, colour, o, width)
    return nothing


@kernel
def challenge(b_colour, b_key, bx, by, b_shift, sign, colour, key, x, y, width, height, taken):
    """The same with what is in `colour` and `key` already as a.

    Rows are copied before they are replaced: what is not written while it is read becomes vector code.
    """
    before, colours = np.empty(CHUNK, np.float32), np.empty((CHUNK, 3), colour.dtype)
    nothing, none = 0, np.float32(0.0)
    for row in range(height):
        for first in range(0, width, CHUNK):
            n = min(CHUNK, width - first)
            b, o = (by + row) * b_key.shape[1] + bx + first, (y + row) * key.shape[1] + x + first
            t = row * taken.shape[1] + first
            for j in range(n):
                before[j] = key[y + row, x + first + j]
            won, missing = choose_keys(before, 0, none, b_key, b, b_shift, sign, key, o, taken, t, n)
            nothing += missing
            if won == n:
                copy_colours(b_colour, b, colour, o, n)
            elif won > 0:
                copy_colours(colour, o, colours, 0, n)
                mix_colours(colours, 0, b_colour, b, taken, t, colour, o, n)
    return nothing


@inline_kernel
def choose_keys(a_key, a, a_shift, b_key, b, b_shift, sign, key, o, taken, t, n):
    """n keys in a row: how many b won, and how many are no number in both."""
    one, other, out, mask = a_key.reshape(-1), b_key.reshape(-1), key.reshape(-1), taken.reshape(-1)
    won, missing = np.int32(0), np.int32(0)
    for j in range(n):
        p, q = one[uint(a) + uint(j)] + a_shift, other[uint(b) + uint(j)] + b_shift
        win = (sign * q < sign * p) | ((p != p) & (q == q))
        out[uint(o) + uint(j)] = q if win else p
        mask[uint(t) + uint(j)] = np.uint8(win)
        won += np.int32(win)
        missing += np.int32((p != p) & (q != q))
    return won, missing


@inline_kernel
def copy_colours(source, s, colour, o, n):
    """n colours in a row."""
    one, out = source.reshape(-1), colour.reshape(-1)
    first, to = uint(s) * uint(3), uint(o) * uint(3)
    for j in range(3 * n):
        out[to + uint(j)] = one[first + uint(j)]


@inline_kernel
def mix_colours(a_colour, a, b_colour, b, taken, t, colour, o, n):
    """n colours in a row, b's where taken; by bits, for a branch would be mispredicted where depths are noisy."""
    one, other, out, mask = a_colour.reshape(-1), b_colour.reshape(-1), colour.reshape(-1), taken.reshape(-1)
    p, q, to = uint(a) * uint(3), uint(b) * uint(3), uint(o) * uint(3)
    for j in range(n):
        bits, k = np.uint32(-np.int32(mask[uint(t) + uint(j)])), uint(3) * uint(j)
        for c in range(3):
            first, second = one[p + k + uint(c)], other[q + k + uint(c)]
            out[to + k + uint(c)] = np.uint32(first ^ np.uint32(np.uint32(first ^ second) & bits))


@kernel
def lay_under(source, source_alpha, sx, sy, colour, alpha, x, y, width, height):
    """Put a picture beneath what is there already: Porter and Duff's over, front to back, premultiplied.

    Parameters
    ----------
    source : (h, w, 3) float32, linear, premultiplied; source_alpha : (h, w) float32, clipped to 0..1; where it is NaN
        there is nothing
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
def gather(source, weight, sx, sy, colour, total, x, y, width, height):
    """Fold one picture into weighted means by running update, which cannot cancel: mean += (value - mean) w / sum of w.

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
def display_code(value, curve):
    """8-bit sRGB of linear light, clipped to 0..1, NaN as 0; see wall.core.colour.srgb_curve."""
    value = min(value, ONE) if value > ZERO else ZERO
    return curve[uint(math.sqrt(value) * np.float32(curve.shape[0] - 1) + HALF)]


@kernel
def encode(source, sx, sy, curve, rgb, x, y, width, height):
    """Linear light to display values.

    source : (h, w, 3) float32, linear; sx, sy : int, corner in it
    curve : (4097,) uint8, see wall.core.colour.srgb_curve
    rgb : (h, w, 3) uint8, sRGB, the part x, y, width, height is written
    """
    one, out = source.reshape(-1), rgb.reshape(-1)
    for row in range(height):
        s, o = uint(3 * ((sy + row) * source.shape[1] + sx)), uint(3 * ((y + row) * rgb.shape[1] + x))
        for j in range(3 * width):
            out[o + uint(j)] = display_code(one[s + uint(j)], curve)
