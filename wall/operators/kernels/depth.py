"""Composite images by depth where surfaces cover pixels in part: the nearest first, until a pixel is full."""

from __future__ import annotations

from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from wall.core.data import Float32
from wall.core.jit import inline_kernel, kernel
from wall.operators.kernels.pixels import CHUNK, copy_colours, mix_colours, uint

INFINITE = np.float32(np.inf)
ZERO, ONE = np.float32(0.0), np.float32(1.0)
FULL = np.float32(0.999)  # coverage above which nothing behind is looked for: a quarter of a display step at most


# Plain tuples, see pixels.Keyed; x and y: the corner that is worked on.
Surface: TypeAlias = tuple[Any, Float32, int, int]  # colour (h, w, 3) uint32, bits of float32; depth (h, w); x, y
Target: TypeAlias = tuple[Any, int, int]  # colour, likewise; x, y
Marks = NDArray[np.uint8]
# Of the pixels of a band, (h, w) each: depth and alpha of what is there; 1 where an alpha is neither 0 nor full;
# 1 where the last image won; x, y
Band: TypeAlias = tuple[Float32, Float32, Marks, Marks, int, int]


@kernel
def fill_by_depth(colour, depth, alpha, ids, out_colour, out_depth, out_alpha, out_ids):
    """Fill each pixel from its nearest surface on, as far as each covers it, until it is full.

    Coverages are taken as disjoint: surfaces that meet in a pixel fill it together, and nothing shows through between
    them (Porter and Duff 1984 call the case where one begins where the other ends; OpenGL SRC_ALPHA_SATURATE).

    Parameters
    ----------
    colour : (n, p, 3) float32, linear, times alpha; depth, alpha : (n, p) float32; ids : (n, p) uint32
    out_colour : (p, 3) float32; out_depth, out_alpha : (p,) float32; out_ids : (p,) uint32; written; depth and object
        are those of the nearest surface that covers anything
    """
    for k in range(depth.shape[1]):
        red = green = blue = covered = ZERO
        near, object_id = INFINITE, np.uint32(0)
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
                near, object_id = best, ids[found, k]
            a = alpha[found, k]
            share = min(a, ONE - covered) / a
            red += share * colour[found, k, 0]
            green += share * colour[found, k, 1]
            blue += share * colour[found, k, 2]
            covered += share * a
            last, first = best, found + 1
        out_colour[k, 0], out_colour[k, 1], out_colour[k, 2] = red, green, blue
        out_depth[k], out_alpha[k], out_ids[k] = near, covered, object_id


@kernel
def replace_farther(source, source_alpha, out, band, width, height):
    """Let an image's pixels replace farther ones, as if each covered its pixel or not; mark those that do so in part.

    Parameters
    ----------
    source : Surface; of equal depths what is there already stays, and NaN never wins
    source_alpha : (h, w) float32, 0..1; None: opaque
    out : Target; colours are updated
    band : Band; updated
    width, height : int, of the part
    """
    colour, depth, sx, sy = source
    out_colour, x, y = out
    near, alpha, _, taken, tx, ty = band
    z_before, a_before = np.empty(CHUNK, np.float32), np.empty(CHUNK, np.float32)
    colours = np.empty((CHUNK, 3), colour.dtype)
    for row in range(height):
        for first in range(0, width, CHUNK):
            n = min(CHUNK, width - first)
            s, o = (sy + row) * depth.shape[1] + sx + first, (y + row) * out_colour.shape[1] + x + first
            t = (ty + row) * near.shape[1] + tx + first
            for j in range(n):
                z_before[j], a_before[j] = near[ty + row, tx + first + j], alpha[ty + row, tx + first + j]
            won = nearer(depth, source_alpha, s, z_before, a_before, band, t, n)
            if won == n:
                copy_colours(colour, s, out_colour, o, n)
            elif won > 0:
                copy_colours(out_colour, o, colours, 0, n)
                mix_colours((colours, 0), (colour, s), (taken, t), out_colour, o, n)


@inline_kernel
def nearer(depth, alpha, s, z_before, a_before, band, t, n):
    """Compare n pixels in a row with what was there before; returns how many the source wins."""
    far, out_z, out_a = depth.reshape(-1), band[0].reshape(-1), band[1].reshape(-1)
    some, mask, won = band[2].reshape(-1), band[3].reshape(-1), np.int32(0)
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
