"""The accumulation of a pixel: running means of the samples that it received while nothing in it moved.

An accumulation image is (h, w, 8) float32, see columns.py. A pixel is half a cache line, since samples arrive in any
order.
"""

from __future__ import annotations

import numpy as np

from wall.core.colour import LUMINANCE
from wall.core.jit import inline_kernel, kernel
from wall.core.kernels.albedo import light_of
from wall.deepbuffer.kernels.columns import (
    AMOUNT,
    BLUE,
    COUNT,
    DEPTH,
    DEVIATIONS,
    GREEN,
    IRRADIANCE_DEVIATIONS,
    IRRADIANCE_MEAN,
    LUMINANCE_DEVIATIONS,
    LUMINANCE_MEAN,
    NEAREST_OBJECT,
    RED,
    X,
    Y,
)  # fmt: skip
from wall.deepbuffer.kernels.pixel_buffer import TILE

uint32 = np.uint32  # as indices: no test whether they count from the end
ZERO, ONE = np.float32(0.0), np.float32(1.0)
MEAN_ALONE = np.float32(4.0)  # samples of a pixel whose mean is shown alone; with fewer it is mixed with the splats
BRIGHTEST = np.float32(1e12)  # luminance, in moments: squares and their sums stay finite
SHARES = tuple(np.float32(share) for share in LUMINANCE)


@inline_kernel
def accumulate(history, i, j, sample):
    """Add a sample to pixel (i, j): Welford's means and squared deviations, which do not drift as sums do."""
    pixel = history.accumulation[i, j]
    history.accumulating[i // TILE, j // TILE] = True
    if pixel[COUNT] == ZERO:
        note_begun(history, i, j)
    pixel[COUNT] += ONE
    share = ONE / pixel[COUNT]
    red, green, blue = sample["radiance"][0], sample["radiance"][1], sample["radiance"][2]
    pixel[RED] += share * (red - pixel[RED])
    pixel[GREEN] += share * (green - pixel[GREEN])
    pixel[BLUE] += share * (blue - pixel[BLUE])
    light = min(max(luminance(red, green, blue), ZERO), BRIGHTEST)
    delta = light - pixel[LUMINANCE_MEAN]
    pixel[LUMINANCE_MEAN] += delta / pixel[COUNT]
    pixel[LUMINANCE_DEVIATIONS] += delta * (light - pixel[LUMINANCE_MEAN])
    delta = sample["sqrt_irradiance"] - pixel[IRRADIANCE_MEAN]
    pixel[IRRADIANCE_MEAN] += delta / pixel[COUNT]
    pixel[IRRADIANCE_DEVIATIONS] += delta * (sample["sqrt_irradiance"] - pixel[IRRADIANCE_MEAN])
    if history.light.shape[0] > 0:
        accumulate_light(history.light[i, j], pixel[COUNT], sample)


@inline_kernel
def accumulate_light(mean, count, sample):
    """Add a sample, the `count`-th, to a pixel's mean light and the squared deviations of its luminance."""
    if count == ONE:
        mean[:] = ZERO
    share, (red, green, blue) = ONE / count, light_of(sample)
    before = luminance(mean[RED], mean[GREEN], mean[BLUE])
    mean[RED] += share * (red - mean[RED])
    mean[GREEN] += share * (green - mean[GREEN])
    mean[BLUE] += share * (blue - mean[BLUE])
    own = luminance(red, green, blue)
    mean[DEVIATIONS] += (own - before) * (own - luminance(mean[RED], mean[GREEN], mean[BLUE]))


@inline_kernel
def luminance(red, green, blue):
    """Luminance of linear RGB."""
    return SHARES[0] * red + SHARES[1] * green + SHARES[2] * blue


@kernel
def clear_accumulation(history):
    """Clear what pixels accumulated: of each that began to, or where these are many, of all in their tiles.

    history : PixelHistory; `accumulation`, `accumulating` and `begun` updated
    """
    accumulation, accumulating, begun = history.accumulation, history.accumulating, history.begun
    listed = begun[0] < begun.shape[0]
    if listed:
        flat = accumulation.reshape(-1, accumulation.shape[2])
        for k in range(begun[0]):
            flat[begun[k + 1]] = ZERO
    for row in range(accumulating.shape[0]):
        for column in range(accumulating.shape[1]):
            if accumulating[row, column] and not listed:
                left = column * TILE
                accumulation[row * TILE : (row + 1) * TILE, left : left + TILE] = ZERO
            accumulating[row, column] = False
    begun[0] = 0


@inline_kernel
def note_begun(history, i, j):
    """Pixel (i, j) begins to accumulate."""
    begun = history.begun
    if begun[0] < begun.shape[0]:
        begun[0] += uint32(1)
        if begun[0] < begun.shape[0]:
            begun[begun[0]] = uint32(i * history.accumulation.shape[1] + j)


@kernel
def mark_changed(store, count, changed, tiles, accumulation):
    """Set the tiles in which a sample of a changed object lies, and clear what its pixel accumulated.

    store : SampleStore, as its screen positions are; count : int, samples stored
    changed : (n + 1,) uint8, objects that move, or stand in another light
    tiles : (rows, columns) bool
    accumulation : (h, w, 8) float32, or empty: then only tiles are set
    """
    screen, objects, clears = store.screen_position, store.object_id, accumulation.shape[0] > 0
    for k in range(count):
        if changed[objects[k]] != 0 and screen[DEPTH, k] > ZERO:
            i, j = uint32(screen[Y, k]), uint32(screen[X, k])
            tiles[i // uint32(TILE), j // uint32(TILE)] = True
            if clears:
                accumulation[i, j, :] = ZERO


@kernel
def reject_accumulation(history, changed, tiles):
    """Clear the accumulation of pixels that show a changed object, shorten it where samples contradicted it.

    history : PixelHistory; what belongs to `accumulation` updated, `contradicted` and `rejection` amounts cleared
    changed : (n + 1,) uint8, objects that moved or stand in another light
    tiles : (rows, columns) bool, where that may be; all contradicted tiles are among them
    """
    height, width = history.accumulation.shape[0], history.accumulation.shape[1]
    for row in range(tiles.shape[0]):
        for column in range(tiles.shape[1]):
            if not tiles[row, column]:
                continue
            top, left = row * TILE, column * TILE
            bottom, right = min(top + TILE, height), min(left + TILE, width)
            if history.accumulating[row, column]:
                kept = False
                for i in range(top, bottom):
                    for j in range(left, right):
                        kept |= reject_pixel(history, changed, i, j)
                history.accumulating[row, column] = kept
            if history.contradicted[row, column]:
                history.rejection[top:bottom, left:right, AMOUNT] = ZERO
                history.contradicted[row, column] = False


@inline_kernel
def reject_pixel(history, changed, i, j):
    """reject_accumulation for a pixel that may have one; returns whether it still has."""
    pixel = history.accumulation[i, j]
    if pixel[COUNT] == ZERO:
        return False
    object_id, amount = int(history.nearest[i, j, NEAREST_OBJECT]), history.rejection[i, j, AMOUNT]
    if object_id < 0 or changed[object_id] != 0:
        pixel[:] = ZERO
    elif amount > ZERO:
        shorten(pixel, (ONE - amount) ** 3)  # one contradiction must outweigh many samples that agreed
    return pixel[COUNT] > ZERO


@kernel
def limit_counts(accumulation, most):
    """Let every pixel's accumulation weigh as `most` samples (float32) at most."""
    for i in range(accumulation.shape[0]):
        for j in range(accumulation.shape[1]):
            if accumulation[i, j, COUNT] > most:
                shorten(accumulation[i, j], most / accumulation[i, j, COUNT])


@inline_kernel
def shorten(pixel, share):
    """Let a pixel's accumulation weigh as a share of its samples; mean and variance stay."""
    pixel[COUNT] *= share
    pixel[LUMINANCE_DEVIATIONS] *= share
    pixel[IRRADIANCE_DEVIATIONS] *= share
