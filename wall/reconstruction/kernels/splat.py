"""Splat samples into an image, and mix in what pixels accumulated while nothing in them moved.

Splat sums have a border of one pixel on every side, so that a sample's four neighbours always exist.
"""

from __future__ import annotations

import numpy as np

from wall.core.jit import inline_kernel, kernel
from wall.deepbuffer.kernels.columns import COUNT, IRRADIANCE, SQRT_IRRADIANCE, WEIGHT, X, Y
from wall.deepbuffer.kernels.pixel_buffer import TILE
from wall.reconstruction.kernels.visibility import SHARPNESS

uint32 = np.uint32  # as indices: no test whether they count from the end
ZERO, ONE, HALF = np.float32(0.0), np.float32(1.0), np.float32(0.5)


@kernel
def splat(store, weight, count, bounds, sums, irradiance):
    """Splat samples: each spreads over the four nearest pixel centres by a tent, or a steeper one.

    Between two centres its share goes from one to the other within 1 / sharpness pixels, about the edge between them:
    shares still sum to 1. At sharpness 1 that is a tent, far above it the box of which the ideal image is the mean.

    Parameters
    ----------
    store : SampleStore; weight : (capacity,) float32, see weigh; count : int, samples stored
    bounds : (h, w, 3) float32, see visibility.bound_depths; sharpness is 1 or more
    sums : (h + 2, w + 2, 4) float32, weighted radiance and weight, written
    irradiance : (h, w, 2) float32, weighted square root of irradiance and weight, written: a
        sample counts in its own pixel; or empty
    """
    radiance, screen = store.radiance, store.screen_position
    flat, row = sums.reshape(-1), uint32(4 * sums.shape[1])
    flat[:] = ZERO
    irradiance[:] = ZERO
    keeps_irradiance = irradiance.shape[0] > 0
    for k in range(count):
        w = weight[k]
        if not w > ZERO:
            continue
        x, y = screen[X, k], screen[Y, k]
        i, j = uint32(y), uint32(x)
        sharp = bounds[i, j, SHARPNESS]
        if keeps_irradiance:
            irradiance[i, j, IRRADIANCE] += w * radiance[k, SQRT_IRRADIANCE]
            irradiance[i, j, WEIGHT] += w
        x += HALF  # border included
        y += HALF
        i, j = uint32(y), uint32(x)
        fx = min(max((x - np.float32(j) - HALF) * sharp + HALF, ZERO), ONE)
        fy = min(max((y - np.float32(i) - HALF) * sharp + HALF, ZERO), ONE)
        red, green, blue = radiance[k, 0], radiance[k, 1], radiance[k, 2]
        w11 = fx * fy * w
        w10 = fy * w - w11
        w01 = fx * w - w11
        i = i * row + j * uint32(4)
        add(flat, i, red, green, blue, w - w01 - w10 - w11)
        add(flat, i + uint32(4), red, green, blue, w01)
        add(flat, i + row, red, green, blue, w10)
        add(flat, i + row + uint32(4), red, green, blue, w11)


@inline_kernel
def add(flat, i, red, green, blue, weight):
    """Add four numbers in a row and nothing between: one vector instruction each."""
    flat[i] += weight * red
    flat[i + uint32(1)] += weight * green
    flat[i + uint32(2)] += weight * blue
    flat[i + uint32(3)] += weight


@kernel
def mix_accumulation(resolved, accumulation, dirty, shown):
    """Mix the accumulated mean of n samples into the resolved splats, with a share of 1 - 1 / (1 + n)^2.

    resolved : (h, w, 3) float32; accumulation : (h, w, 8) float32; dirty : (rows, columns) bool, tiles to redo
    shown : (h, w, 3) float32, written
    """
    for row in range(dirty.shape[0]):
        for column in range(dirty.shape[1]):
            if not dirty[row, column]:
                continue
            for i in range(row * TILE, min((row + 1) * TILE, resolved.shape[0])):
                for j in range(column * TILE, min((column + 1) * TILE, resolved.shape[1])):
                    n = accumulation[i, j, COUNT]
                    part = ONE / ((ONE + n) * (ONE + n))
                    own = ONE - part
                    for c in range(3):
                        shown[i, j, c] = part * resolved[i, j, c] + own * accumulation[i, j, c]
