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
MEAN_ALONE = np.float32(4.0)  # samples of a pixel whose mean is shown alone; with fewer it is mixed with the splats
LUMINANCE = np.float32(0.2126), np.float32(0.7152), np.float32(0.0722)  # Rec. 709


@inline_kernel
def accumulate(history, i, j, sample):
    """Add a sample to pixel (i, j): Welford's means and squared deviations, which do not drift as sums do."""
    pixel = history.accumulation[i, j]
    if pixel[COUNT] == ZERO:
        history.accumulated[history.listed[0]] = i * history.accumulation.shape[1] + j
        history.listed[0] += 1
        history.accumulating[i // TILE, j // TILE] = True
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

    history : PixelHistory; what belongs to `accumulation` updated, `contradicted` and `rejection` amounts cleared
    changed : (n + 1,) uint8, objects that moved or stand in another light
    """
    pixels, width = history.accumulated, history.accumulation.shape[1]
    history.accumulating[:] = False
    kept = 0
    for n in range(history.listed[0]):
        i, j = pixels[n] // width, pixels[n] % width
        if reject_pixel(history, changed, i, j):
            history.accumulating[i // TILE, j // TILE] = True
            pixels[kept] = pixels[n]
            kept += 1
    history.listed[0] = kept
    for row in range(history.contradicted.shape[0]):
        for column in range(history.contradicted.shape[1]):
            if history.contradicted[row, column]:
                top, left = row * TILE, column * TILE
                history.rejection[top : top + TILE, left : left + TILE, AMOUNT] = ZERO
                history.contradicted[row, column] = False


@inline_kernel
def reject_pixel(history, changed, i, j):
    """reject_accumulation for a pixel that may have one; returns whether it still has."""
    pixel, amount = history.accumulation[i, j], history.rejection[i, j, AMOUNT]
    object_id = int(history.nearest[i, j, NEAREST_OBJECT])
    if object_id < 0 or changed[object_id] != 0:
        pixel[:] = ZERO
    elif amount > ZERO:
        shorten(pixel, (ONE - amount) ** 3)  # one contradiction must outweigh many samples that agreed
    return pixel[COUNT] > ZERO


@kernel
def clear_changed(history, changed):
    """Clear the accumulation of pixels whose nearest sample is a changed object's: it may leave them.

    history : PixelHistory, `nearest` still that of the image before; `accumulation` updated; reject_accumulation is to
        follow before anything is accumulated
    changed : (n + 1,) uint8, see reject_accumulation
    """
    pixels, width = history.accumulated, history.accumulation.shape[1]
    for n in range(history.listed[0]):
        i, j = pixels[n] // width, pixels[n] % width
        object_id = int(history.nearest[i, j, NEAREST_OBJECT])
        if object_id >= 0 and changed[object_id] != 0:
            history.accumulation[i, j, :] = ZERO


@kernel
def limit_counts(history, most):
    """Let every pixel's accumulation weigh as `most` samples (float32) at most. history : PixelHistory"""
    pixels, width = history.accumulated, history.accumulation.shape[1]
    for n in range(history.listed[0]):
        pixel = history.accumulation[pixels[n] // width, pixels[n] % width]
        if pixel[COUNT] > most:
            shorten(pixel, most / pixel[COUNT])


@inline_kernel
def shorten(pixel, share):
    """Let a pixel's accumulation weigh as a share of its samples; mean and variance stay."""
    pixel[COUNT] *= share
    pixel[BRIGHTNESS_DEVIATIONS] *= share
    pixel[IRRADIANCE_DEVIATIONS] *= share
