"""The accumulation of a pixel: running means of the samples that it received while nothing in it moved.

An accumulation image is (h, w, 8) float32, see columns.py. A pixel is half a cache line, since samples arrive in any
order.
"""

from __future__ import annotations

import numpy as np

from wall.core.jit import inline_kernel, kernel
from wall.deepbuffer.kernels.columns import (
    AMOUNT,
    BLUE,
    BRIGHTNESS_DEVIATIONS,
    BRIGHTNESS_MEAN,
    COUNT,
    GREEN,
    IRRADIANCE_DEVIATIONS,
    IRRADIANCE_MEAN,
    NEAREST_OBJECT,
    RED,
)  # fmt: skip
from wall.deepbuffer.kernels.pixel_buffer import TILE

ZERO, ONE = np.float32(0.0), np.float32(1.0)
LUMINANCE = np.float32(0.2126), np.float32(0.7152), np.float32(0.0722)  # Rec. 709


@inline_kernel
def accumulate(accumulation, i, j, sample):
    """Add a sample to pixel (i, j): Welford's means and squared deviations, which do not drift as sums do."""
    pixel = accumulation[i, j]
    pixel[COUNT] += ONE
    share = ONE / pixel[COUNT]
    red, green, blue = sample["radiance"][0], sample["radiance"][1], sample["radiance"][2]
    pixel[RED] += share * (red - pixel[RED])
    pixel[GREEN] += share * (green - pixel[GREEN])
    pixel[BLUE] += share * (blue - pixel[BLUE])
    brightness = np.sqrt(max(LUMINANCE[0] * red + LUMINANCE[1] * green + LUMINANCE[2] * blue, ZERO))
    delta = brightness - pixel[BRIGHTNESS_MEAN]
    pixel[BRIGHTNESS_MEAN] += delta / pixel[COUNT]
    pixel[BRIGHTNESS_DEVIATIONS] += delta * (brightness - pixel[BRIGHTNESS_MEAN])
    delta = sample["sqrt_irradiance"] - pixel[IRRADIANCE_MEAN]
    pixel[IRRADIANCE_MEAN] += delta / pixel[COUNT]
    pixel[IRRADIANCE_DEVIATIONS] += delta * (sample["sqrt_irradiance"] - pixel[IRRADIANCE_MEAN])


@kernel
def reject_accumulation(history, changed):
    """Clear the accumulation of pixels that show a changed object, shorten it where samples contradicted it.

    history : PixelHistory; `accumulation` and `accumulating` updated, `contradicted` and `rejection` amounts cleared
    changed : (n + 1,) uint8, objects that moved or stand in another light
    """
    tiles, rejection = history.accumulating, history.rejection
    height, width = rejection.shape[0], rejection.shape[1]
    for row in range(tiles.shape[0]):
        for column in range(tiles.shape[1]):
            top, left = row * TILE, column * TILE
            bottom, right = min(top + TILE, height), min(left + TILE, width)
            if tiles[row, column]:
                accumulates = False
                for i in range(top, bottom):
                    for j in range(left, right):
                        if history.accumulation[i, j, COUNT] > ZERO:
                            accumulates |= reject_pixel(history, changed, i, j)
                tiles[row, column] = accumulates
            if history.contradicted[row, column]:
                for i in range(top, bottom):
                    for j in range(left, right):
                        rejection[i, j, AMOUNT] = ZERO
                history.contradicted[row, column] = False


@inline_kernel
def reject_pixel(history, changed, i, j):
    """reject_accumulation for a pixel that has one; returns whether it still has."""
    pixel, amount = history.accumulation[i, j], history.rejection[i, j, AMOUNT]
    object_id = int(history.nearest[i, j, NEAREST_OBJECT])
    if object_id < 0 or changed[object_id] != 0:
        pixel[:] = ZERO
        return False
    if amount > ZERO:
        keep = (ONE - amount) ** 3  # one contradiction must outweigh many samples that agreed
        pixel[COUNT] *= keep
        pixel[BRIGHTNESS_DEVIATIONS] *= keep
        pixel[IRRADIANCE_DEVIATIONS] *= keep
    return True
