"""Fill holes (push-pull): a pyramid of ever coarser weighted sums, and back down where weight is missing."""

from __future__ import annotations

import numpy as np

from wall.core.jit import inline_kernel, kernel
from wall.deepbuffer.kernels.change import TRUSTED

uint32 = np.uint32  # as indices: no test whether they count from the end
ZERO, ONE = np.float32(0.0), np.float32(1.0)


@kernel
def resolve(sums, shown, coarse, holes):
    """Resolve splat sums to an image: weighted means, less where the weight is below TRUSTED: see fill_holes.

    sums : (h + 2, w + 2, 4) float32 weighted radiance and weight, one pixel of border around
    shown : (h, w, 3) float32, written
    coarse : (ceil(h/2), ceil(w/2), 4) float32, written: sums over 2x2, a pixel of weight TRUSTED or more counting once
    holes : (h * w,) uint32, written: pixels with less, row by row

    Returns
    -------
    count : int, of holes
    """
    height, width = shown.shape[0], shown.shape[1]
    out = shown.reshape(-1)
    coarse[:] = ZERO
    count = uint32(0)
    for i in range(height):
        row, below = sums[i + 1], coarse[i >> 1]
        for j in range(width):
            weight = row[j + 1, 3]
            scale = ONE / max(weight, TRUSTED)
            red, green, blue = row[j + 1, 0] * scale, row[j + 1, 1] * scale, row[j + 1, 2] * scale
            below[j >> 1, 0] += red
            below[j >> 1, 1] += green
            below[j >> 1, 2] += blue
            below[j >> 1, 3] += weight * scale
            at = uint32(i * width + j)
            k = at * uint32(3)
            out[k], out[k + uint32(1)], out[k + uint32(2)] = red, green, blue
            holes[count] = at
            count += uint32(1) if weight < TRUSTED else uint32(0)
    return np.int64(count)


@kernel
def fill_holes(sums, filled, holes, count, shown):
    """Add what is missing in holes from the coarser level: the less weight, the more.

    sums : (h + 2, w + 2, 4) float32; filled : (ceil(h/2), ceil(w/2), 4) float32, see expand
    holes, count : see resolve; shown : (h, w, 3) float32, updated
    """
    width = uint32(shown.shape[1])
    for n in range(count):
        i, j = holes[n] // width, holes[n] % width
        red, green, blue = between(filled, i, j)
        missing = ONE - sums[i + uint32(1), j + uint32(1), 3] / TRUSTED
        shown[i, j, 0] += missing * red
        shown[i, j, 1] += missing * green
        shown[i, j, 2] += missing * blue


@kernel
def halve(fine, coarse):
    """Make one level of a pyramid: sums over 2x2, a pixel of weight 1 or more counting once.

    fine : (h, w, 4) float32 weighted radiance and weight; coarse : (ceil(h/2), ceil(w/2), 4) float32, written
    """
    coarse[:] = ZERO
    for i in range(fine.shape[0]):
        for j in range(fine.shape[1]):
            scale = ONE / max(fine[i, j, 3], ONE)
            for c in range(4):
                coarse[i >> 1, j >> 1, c] += scale * fine[i, j, c]


@kernel
def expand(coarse, filled):
    """Divide by weight, and where that is below 1 mix in the coarser level (bilinear).

    coarse : (h, w, 4) float32 sums of halve(); on return, rows 0..2 hold radiance.
    filled : (h', w', 4) float32, the coarser level after its own expand(), | None at the top
    """
    for i in range(coarse.shape[0]):
        for j in range(coarse.shape[1]):
            weight = coarse[i, j, 3]
            scale = ONE / max(weight, ONE)
            red, green, blue = coarse[i, j, 0] * scale, coarse[i, j, 1] * scale, coarse[i, j, 2] * scale
            if weight < ONE:
                if filled is not None:
                    r, g, b = between(filled, i, j)
                    red += (ONE - weight) * r
                    green += (ONE - weight) * g
                    blue += (ONE - weight) * b
                elif weight > ZERO:
                    red, green, blue = red / weight, green / weight, blue / weight
            coarse[i, j, 0], coarse[i, j, 1], coarse[i, j, 2] = red, green, blue


@inline_kernel
def between(filled, i, j):
    """Interpolate the coarser level at the centre of pixel (i, j): bilinear, weights 9 3 3 1 of 16."""
    i, j = np.int64(i), np.int64(j)
    m, n = i >> 1, j >> 1
    mm = min(max(m - 1 + 2 * (i & 1), 0), filled.shape[0] - 1)
    nn = min(max(n - 1 + 2 * (j & 1), 0), filled.shape[1] - 1)
    a, b, c, d = np.float32(9.0 / 16.0), np.float32(3.0 / 16.0), np.float32(3.0 / 16.0), np.float32(1.0 / 16.0)
    red = a * filled[m, n, 0] + b * filled[m, nn, 0] + c * filled[mm, n, 0] + d * filled[mm, nn, 0]
    green = a * filled[m, n, 1] + b * filled[m, nn, 1] + c * filled[mm, n, 1] + d * filled[mm, nn, 1]
    blue = a * filled[m, n, 2] + b * filled[m, nn, 2] + c * filled[mm, n, 2] + d * filled[mm, nn, 2]
    return red, green, blue
