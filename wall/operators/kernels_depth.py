"""Several pictures of one view whose pixels are covered in part: nearest first, each fills what is left of a pixel."""

from __future__ import annotations

import numpy as np

from wall.jit import kernel

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
