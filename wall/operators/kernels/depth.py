"""Several pictures of one view whose pixels are covered in part: nearest first, each fills what is left of a pixel."""

from __future__ import annotations

import numpy as np

from wall.core.jit import inline_kernel, kernel
from wall.operators.kernels.pixels import CHUNK, copy_colours, mix_colours, uint

INFINITE = np.float32(np.inf)
ZERO, ONE = np.float32(0.0), np.float32(1.0)
FULL = np.float32(0.999)  # coverage above which nothing behind is looked for: a quarter of a display step at most


@kernel
def fill_by_depth(colour, depth, alpha, thing, out_colour, out_depth, out_alpha, out_thing):
    """Fill each pixel from its nearest surface on, as far as each covers it, until it is full.

    Coverages are taken as disjoint: surfaces that meet in a pixel fill it together, and nothing shows through between
    them (Porter and Duff 1984 call the case where one begins where the other ends; OpenGL SRC_ALPHA_SATURATE).

    Parameters
    ----------
    colour : (n, p, 3) float32, linear, times alpha; depth, alpha : (n, p) float32; thing : (n, p) uint32 | None
    out_colour : (p, 3) float32; out_depth, out_alpha : (p,) float32 | None; out_thing : (p,) uint32 | None; written:
        depth and object are those of the nearest surface that covers anything
    """
    for k in range(depth.shape[1]):
        red = green = blue = covered = ZERO
        near, name = INFINITE, np.uint32(0)
        last, first = -INFINITE, 0  # the surfaces before (last, first) are in already
        while covered < FULL:
            best, found = INFINITE, -1
            for i in range(depth.shape[0]):
                z = depth[i, k]
                if alpha[i, k] > ZERO and (z > last or (z == last and i >= first)) and (z < best or found < 0):
                    best, found = z, i
            if found < 0:
                break
            if covered == ZERO:
                near = best
                name = thing[found, k] if thing is not None else name
            a = alpha[found, k]
            share = min(a, ONE - covered) / a
            red += share * colour[found, k, 0]
            green += share * colour[found, k, 1]
            blue += share * colour[found, k, 2]
            covered += share * a
            last, first = best, found + 1
        out_colour[k, 0], out_colour[k, 1], out_colour[k, 2] = red, green, blue
        if out_depth is not None:
            out_depth[k] = near
        if out_alpha is not None:
            out_alpha[k] = covered
        if out_thing is not None:
            out_thing[k] = name


@kernel
def put_before(
    colour, depth, alpha, sx, sy, out_colour, x, y, near, covered, partial, taken, tx, ty, width, height
):  # fmt: skip
    """Let a picture's pixels replace farther ones, as if each covered its pixel or not; what does so in part is marked.

    Parameters
    ----------
    colour : (h, w, 3) uint32, the bits of float32; depth : (h, w) float32; alpha : (h, w) float32 | None, opaque
    sx, sy : int, corner in them; of equals what is there already stays, and NaN depth never wins
    out_colour : (h, w, 3) uint32, updated from the corner x, y on
    near, covered : (h, w) float32, depth and alpha of what is there, updated from the corner tx, ty on
    partial : (h, w) uint8, likewise, set to 1 where alpha is neither 0 nor full
    taken : (h, w) uint8, likewise, written: 1 where this picture won
    width, height : int, the part
    """
    z_before, a_before = np.empty(CHUNK, np.float32), np.empty(CHUNK, np.float32)
    colours = np.empty((CHUNK, 3), colour.dtype)
    for row in range(height):
        for first in range(0, width, CHUNK):
            n = min(CHUNK, width - first)
            s, o = (sy + row) * depth.shape[1] + sx + first, (y + row) * out_colour.shape[1] + x + first
            t = (ty + row) * near.shape[1] + tx + first
            for j in range(n):
                z_before[j], a_before[j] = near[ty + row, tx + first + j], covered[ty + row, tx + first + j]
            won = nearer(depth, alpha, s, z_before, a_before, near, covered, partial, taken, t, n)
            if won == n:
                copy_colours(colour, s, out_colour, o, n)
            elif won > 0:
                copy_colours(out_colour, o, colours, 0, n)
                mix_colours(colours, 0, colour, s, taken, t, out_colour, o, n)


@inline_kernel
def nearer(depth, alpha, s, z_before, a_before, near, covered, partial, taken, t, n):
    """n pixels in a row: how many are won."""
    far, out_z, out_a, mask = depth.reshape(-1), near.reshape(-1), covered.reshape(-1), taken.reshape(-1)
    some, won = partial.reshape(-1), np.int32(0)
    if alpha is None:
        for j in range(n):
            z = far[uint(s) + uint(j)]
            win = (z == z) & ((z < z_before[j]) | (a_before[j] == ZERO))
            out_z[uint(t) + uint(j)] = z if win else z_before[j]
            out_a[uint(t) + uint(j)] = ONE if win else a_before[j]
            mask[uint(t) + uint(j)] = np.uint8(win)
            won += np.int32(win)
    else:
        cover = alpha.reshape(-1)
        for j in range(n):
            z, a = far[uint(s) + uint(j)], cover[uint(s) + uint(j)]
            there = (a > ZERO) & (z == z)
            win = there & ((z < z_before[j]) | (a_before[j] == ZERO))
            out_z[uint(t) + uint(j)] = z if win else z_before[j]
            out_a[uint(t) + uint(j)] = a if win else a_before[j]
            mask[uint(t) + uint(j)] = np.uint8(win)
            won += np.int32(win)
        for j in range(n):
            z, a = far[uint(s) + uint(j)], cover[uint(s) + uint(j)]
            some[uint(t) + uint(j)] |= np.uint8((a > ZERO) & ((a < FULL) | (a > ONE)) & (z == z))
    return won
