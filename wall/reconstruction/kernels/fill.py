"""Fill holes (push-pull): a pyramid of ever coarser weighted sums, and back down where weight is missing."""

from __future__ import annotations

import numpy as np

from wall.core.jit import inline_kernel, kernel
from wall.deepbuffer.kernels.change import TRUSTED

ZERO, ONE = np.float32(0.0), np.float32(1.0)


@kernel
def halve(fine, border, trusted, coarse):
    """Make one level of a pyramid: sums over 2x2, a pixel of weight `trusted` or more counting once.

    fine : (h, w, 4) float32 weighted radiance and weight, with `border` pixels around
    coarse : (ceil(h/2), ceil(w/2), 4) float32, written
    """
    height, width = fine.shape[0] - 2 * border, fine.shape[1] - 2 * border
    coarse[:] = ZERO
    for i in range(height):
        for j in range(width):
            weight = fine[i + border, j + border, 3]
            scale = ONE / max(weight, trusted)
            for c in range(4):
                coarse[i >> 1, j >> 1, c] += scale * fine[i + border, j + border, c]


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
    m, n = i >> 1, j >> 1
    mm = min(max(m - 1 + 2 * (i & 1), 0), filled.shape[0] - 1)
    nn = min(max(n - 1 + 2 * (j & 1), 0), filled.shape[1] - 1)
    a, b, c, d = np.float32(9.0 / 16.0), np.float32(3.0 / 16.0), np.float32(3.0 / 16.0), np.float32(1.0 / 16.0)
    red = a * filled[m, n, 0] + b * filled[m, nn, 0] + c * filled[mm, n, 0] + d * filled[mm, nn, 0]
    green = a * filled[m, n, 1] + b * filled[m, nn, 1] + c * filled[mm, n, 1] + d * filled[mm, nn, 1]
    blue = a * filled[m, n, 2] + b * filled[m, nn, 2] + c * filled[mm, n, 2] + d * filled[mm, nn, 2]
    return red, green, blue


@kernel
def resolve(sums, filled, shown):
    """Resolve splat sums to an image: weighted means, and where the weight is below TRUSTED the filled coarser level.

    sums : (h + 2, w + 2, 4) float32; filled : (ceil(h/2), ceil(w/2), 4) float32; shown : (h, w, 3) float32, written
    """
    height, width = shown.shape[0], shown.shape[1]
    for i in range(height):
        for j in range(width):
            weight = sums[i + 1, j + 1, 3]
            scale = ONE / max(weight, TRUSTED)
            red, green, blue = (
                sums[i + 1, j + 1, 0] * scale,
                sums[i + 1, j + 1, 1] * scale,
                sums[i + 1, j + 1, 2] * scale,
            )
            if weight < TRUSTED:
                r, g, b = between(filled, i, j)
                missing = ONE - weight / TRUSTED
                red += missing * r
                green += missing * g
                blue += missing * b
            shown[i, j, 0], shown[i, j, 1], shown[i, j, 2] = red, green, blue
