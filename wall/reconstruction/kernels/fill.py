"""Fill holes (push-pull): a pyramid of ever coarser weighted sums, and back down where weight is missing."""

from __future__ import annotations

import numpy as np

from wall.core.jit import inline_kernel, kernel
from wall.deepbuffer.kernels.change import TRUSTED

uint8, uint32 = np.uint8, np.uint32
ZERO, ONE, QUARTER, THREE_QUARTERS = np.float32(0.0), np.float32(1.0), np.float32(0.25), np.float32(0.75)
SMALLEST = np.finfo(np.float32).tiny  # a weight whose inverse is finite
RUN = 16  # pixels that are looked at together for holes


@kernel
def resolve_splats(sums, coarse, shown, holes, top, bottom):
    """Resolve splat sums to weighted means, list the holes, and make the first level of a pyramid to fill them from.

    A level holds sums over 2x2, a pixel of weight TRUSTED or more counting once.

    sums : (h + 2, w + 2, 4) float32 weighted radiance and weight, one pixel of border around
    coarse : (ceil(h/2), ceil(w/2), 4) float32, written
    shown : (h, w, 3) float32, written; with weights below TRUSTED a part is missing
    holes : (h w,) uint32, written from `top` w on: y w + x of the pixels of such weights
    top, bottom : int, rows of pixels that are resolved; even, but for the last

    Returns
    -------
    count : int, holes
    """
    width = shown.shape[1]
    scale, lacks = np.empty(width + 1, np.float32), np.zeros(width + RUN, np.uint8)
    first = uint32(top * width)
    count = first
    for i in range(top, bottom):
        row, half, out = sums[i + 1].reshape(-1)[4 : 4 * (width + 1)], coarse[i >> 1].reshape(-1), shown[i].reshape(-1)
        if i & 1 == 0:
            half[:] = ZERO
        for j in range(width):
            scale[j] = ONE / max(row[4 * j + 3], TRUSTED)
        for k in range(width >> 1):
            u, v = scale[2 * k], scale[2 * k + 1]
            half[4 * k] += u * row[8 * k] + v * row[8 * k + 4]
            half[4 * k + 1] += u * row[8 * k + 1] + v * row[8 * k + 5]
            half[4 * k + 2] += u * row[8 * k + 2] + v * row[8 * k + 6]
            half[4 * k + 3] += u * row[8 * k + 3] + v * row[8 * k + 7]
        if width & 1:
            for c in range(4):
                coarse[i >> 1, width >> 1, c] += scale[width - 1] * row[4 * (width - 1) + c]
        for j in range(width):
            out[3 * j] = scale[j] * row[4 * j]
            out[3 * j + 1] = scale[j] * row[4 * j + 1]
            out[3 * j + 2] = scale[j] * row[4 * j + 2]
        for j in range(width):
            lacks[j] = uint8(1) if row[4 * j + 3] < TRUSTED else uint8(0)
        count = list_holes(lacks, i * width, width, holes, count)
    return count - first


@inline_kernel
def list_holes(lacks, first, width, holes, count):
    """Add the pixels of a row that lack weight to the list; returns their new number."""
    for start in range(0, width, RUN):
        some = uint8(0)
        for j in range(RUN):
            some |= lacks[start + j]
        if some != 0:
            for j in range(start, min(start + RUN, width)):
                holes[count] = uint32(first + j)
                count += uint32(lacks[j])
    return count


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
def expand(coarse, filled, top, bottom):
    """Divide by weight, and where that is below 1 mix in the coarser level (bilinear).

    coarse : (h, w, 4) float32 sums of halve(); on return, rows 0..2 hold radiance.
    filled : (h', w', 4) float32, the coarser level after its own expand(), | None at the top
    top, bottom : int, rows that are expanded
    """
    width = coarse.shape[1]
    between, finer = np.empty((3, (width + 1) // 2 + 2), np.float32), np.zeros((3, width + 1), np.float32)
    least = ONE if filled is not None else SMALLEST  # the top has nothing to mix in
    for i in range(top, bottom):
        if filled is not None:
            interpolate(filled, i, between, finer)
        for j in range(width):
            weight = coarse[i, j, 3]
            scale, missing = ONE / max(weight, least), max(ONE - weight, ZERO)
            for c in range(3):
                coarse[i, j, c] = scale * coarse[i, j, c] + missing * finer[c, j]


@kernel
def fill_holes(sums, filled, holes, count, shown):
    """Mix in the coarser level where weight is missing: the more, the further it is below TRUSTED.

    sums : (h + 2, w + 2, 4) float32, see resolve_splats; filled : (ceil(h/2), ceil(w/2), 4) float32, see expand
    holes : (h w,) uint32, pixels in order; count : int, of them; shown : (h, w, 3) float32, updated in the holes
    """
    width, bottom, right = uint32(shown.shape[1]), uint32(filled.shape[0] - 1), uint32(filled.shape[1] - 1)
    splats, light, out = sums.reshape(-1), filled.reshape(-1), shown.reshape(-1)
    row, first = uint32(0), uint32(0)  # of the hole, and its first pixel
    for n in range(count):
        while holes[n] >= first + width:
            row, first = row + uint32(1), first + width
        column = holes[n] - first
        y, x = row >> uint32(1), column >> uint32(1)
        other = min(y + uint32(1), bottom) if row & uint32(1) else max(y, uint32(1)) - uint32(1)
        side = min(x + uint32(1), right) if column & uint32(1) else max(x, uint32(1)) - uint32(1)
        near, far = uint32(4) * y * (right + uint32(1)), uint32(4) * other * (right + uint32(1))
        x, side = uint32(4) * x, uint32(4) * side
        k, own = uint32(3) * holes[n], uint32(4) * ((row + uint32(1)) * (width + uint32(2)) + column + uint32(1))
        weight = splats[own + uint32(3)]
        scale, missing = ONE / max(weight, TRUSTED), ONE - weight * (ONE / TRUSTED)
        for c in range(3):
            a, b = light[near + x + uint32(c)], light[far + x + uint32(c)]
            d, e = light[near + side + uint32(c)], light[far + side + uint32(c)]
            here, beside = THREE_QUARTERS * a + QUARTER * b, THREE_QUARTERS * d + QUARTER * e
            fine = THREE_QUARTERS * here + QUARTER * beside
            out[k + uint32(c)] = scale * splats[own + uint32(c)] + missing * fine


@inline_kernel
def interpolate(filled, i, coarse, fine):
    """Interpolate row i of the next finer level: bilinear, weights 9 3 3 1 of 16, in loops of vector code.

    coarse : (3, w' + 2) float32, scratch: a row between two of the coarser level's, its ends repeated
    fine : (3, 2 w' or 1 more) float32, written
    """
    m, width = i >> 1, filled.shape[1]
    near = filled[m].reshape(-1)
    far = filled[min(max(m - 1 + 2 * (i & 1), 0), filled.shape[0] - 1)].reshape(-1)
    for c in range(3):
        row, out = coarse[c], fine[c]
        inner, left, right = row[1 : width + 1], row[:width], row[2:]
        for k in range(width):
            inner[k] = THREE_QUARTERS * near[4 * k + c] + QUARTER * far[4 * k + c]
        row[0], row[width + 1] = row[1], row[width]
        for k in range(width):
            out[2 * k] = THREE_QUARTERS * inner[k] + QUARTER * left[k]
            out[2 * k + 1] = THREE_QUARTERS * inner[k] + QUARTER * right[k]
