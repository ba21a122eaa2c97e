"""Fill holes (push-pull): a pyramid of ever coarser weighted sums, and back down where weight is missing."""

from __future__ import annotations

import numpy as np

from wall.core.jit import inline_kernel, kernel
from wall.deepbuffer.kernels.change import TRUSTED

ZERO, ONE, QUARTER, THREE_QUARTERS = np.float32(0.0), np.float32(1.0), np.float32(0.25), np.float32(0.75)
SMALLEST = np.finfo(np.float32).tiny  # a weight whose inverse is finite


@kernel
def halve_splats(sums, coarse):
    """Make the first level of a pyramid: sums over 2x2, a pixel of weight TRUSTED or more counting once.

    sums : (h + 2, w + 2, 4) float32 weighted radiance and weight, one pixel of border around
    coarse : (ceil(h/2), ceil(w/2), 4) float32, written
    """
    height, width = sums.shape[0] - 2, sums.shape[1] - 2
    coarse[:] = ZERO
    for i in range(height):
        row, out = sums[i + 1].reshape(-1)[4 : 4 * (width + 1)], coarse[i >> 1].reshape(-1)
        for k in range(width >> 1):
            u, v = ONE / max(row[8 * k + 3], TRUSTED), ONE / max(row[8 * k + 7], TRUSTED)
            out[4 * k] += u * row[8 * k] + v * row[8 * k + 4]
            out[4 * k + 1] += u * row[8 * k + 1] + v * row[8 * k + 5]
            out[4 * k + 2] += u * row[8 * k + 2] + v * row[8 * k + 6]
            out[4 * k + 3] += u * row[8 * k + 3] + v * row[8 * k + 7]
        if width & 1:
            u = ONE / max(row[4 * width - 1], TRUSTED)
            for c in range(4):
                coarse[i >> 1, width >> 1, c] += u * row[4 * (width - 1) + c]


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
    height, width = coarse.shape[0], coarse.shape[1]
    between, finer = np.empty((3, (width + 1) // 2 + 2), np.float32), np.zeros((3, width + 1), np.float32)
    least = ONE if filled is not None else SMALLEST  # the top has nothing to mix in
    for i in range(height):
        if filled is not None:
            interpolate(filled, i, between, finer)
        for j in range(width):
            weight = coarse[i, j, 3]
            scale, missing = ONE / max(weight, least), max(ONE - weight, ZERO)
            for c in range(3):
                coarse[i, j, c] = scale * coarse[i, j, c] + missing * finer[c, j]


@kernel
def resolve(sums, filled, shown):
    """Resolve splat sums to an image: weighted means; the further the weight is below TRUSTED, the coarser level.

    sums : (h + 2, w + 2, 4) float32, see halve_splats; filled : (ceil(h/2), ceil(w/2), 4) float32, see expand
    shown : (h, w, 3) float32, written
    """
    width = shown.shape[1]
    coarse, fine = np.empty((3, filled.shape[1] + 2), np.float32), np.empty((3, width + 1), np.float32)
    scale, missing = np.empty(width, np.float32), np.empty(width, np.float32)
    for i in range(shown.shape[0]):
        interpolate(filled, i, coarse, fine)
        row, out = sums[i + 1].reshape(-1)[4 : 4 * (width + 1)], shown[i].reshape(-1)
        for j in range(width):
            scale[j] = ONE / max(row[4 * j + 3], TRUSTED)
            missing[j] = max(ONE - row[4 * j + 3] / TRUSTED, ZERO)
        red, green, blue = fine[0], fine[1], fine[2]
        for j in range(width):
            out[3 * j] = scale[j] * row[4 * j] + missing[j] * red[j]
            out[3 * j + 1] = scale[j] * row[4 * j + 1] + missing[j] * green[j]
            out[3 * j + 2] = scale[j] * row[4 * j + 2] + missing[j] * blue[j]


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
