"""Display values from radiance."""

from __future__ import annotations

import math

import numpy as np

from wall.core.jit import inline_kernel, kernel

uint32 = np.uint32
ZERO, ONE, HALF = np.float32(0.0), np.float32(1.0), np.float32(0.5)


@kernel
def display_tiles(radiance, dirty, tile, curve, rgb):
    """Encode the changed tiles of an image for display: clip to 0..1, sRGB curve, 8 bits; NaN shows as 0.

    Parameters
    ----------
    radiance : (h, 3 w) float32, linear RGB
    dirty : (rows, columns) bool, tiles to redo; tile : int, their edge in pixels
    curve : (4097,) uint8, sRGB code of (k / 4096)^2: looking up by square root keeps dark steps fine
    rgb : (h, 3 w) uint8, updated in place

    Returns
    -------
    redone : int, pixels written
    """
    redone = 0
    places = np.empty(3 * tile, np.int32)
    for row in range(dirty.shape[0]):
        for column in range(dirty.shape[1]):
            if not dirty[row, column]:
                continue
            left, right = 3 * column * tile, min(3 * (column + 1) * tile, radiance.shape[1])
            for y in range(row * tile, min((row + 1) * tile, radiance.shape[0])):
                look_up(radiance[y, left:right], curve, places, rgb[y, left:right])
                redone += (right - left) // 3
    return redone


@inline_kernel
def look_up(values, curve, places, codes):
    """Write the 8-bit codes of a row: see operators.kernels.pixels.display_code. The first loop is vector code."""
    steps = np.float32(curve.shape[0] - 1)
    for k in range(values.shape[0]):
        value = min(values[k], ONE) if values[k] > ZERO else ZERO
        places[k] = np.int32(math.sqrt(value) * steps + HALF)
    for k in range(values.shape[0]):
        codes[k] = curve[uint32(places[k])]
