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

    history : PixelHistory; `accumulation` updated, `rejection` amounts cleared
    changed : (n + 1,) uint8, objects that moved or stand in another light
    """
    nearest, accumulation, rejection = history.nearest, history.accumulation, history.rejection
    for i in range(nearest.shape[0]):
        for j in range(nearest.shape[1]):
            amount = rejection[i, j, AMOUNT]
            if accumulation[i, j, COUNT] > ZERO:
                object_id = int(nearest[i, j, NEAREST_OBJECT])
                if object_id < 0 or changed[object_id] != 0:
                    accumulation[i, j, :] = ZERO
                elif amount > ZERO:
                    keep = (ONE - amount) ** 3  # one contradiction must outweigh many samples that agreed
                    accumulation[i, j, COUNT] *= keep
                    accumulation[i, j, BRIGHTNESS_DEVIATIONS] *= keep
                    accumulation[i, j, IRRADIANCE_DEVIATIONS] *= keep
            rejection[i, j, AMOUNT] = ZERO
