"""Change detection: how much new samples contradict the image, and which older samples lose confidence for it."""

from __future__ import annotations

import numpy as np

from wall.core.jit import inline_kernel, kernel
from wall.deepbuffer.kernels.columns import (
    AMOUNT,
    BEFORE,
    COUNT,
    DEPTH,
    IRRADIANCE,
    IRRADIANCE_DEVIATIONS,
    IRRADIANCE_MEAN,
    NEAREST_OBJECT,
    WEIGHT,
    X,
    Y,
)  # fmt: skip
from wall.deepbuffer.kernels.pixel_buffer import TILE

uint32 = np.uint32  # as indices: no check for negative ones that wrap around
ZERO, ONE = np.float32(0.0), np.float32(1.0)
TRUSTED = np.float32(0.25)  # weight from which a pixel's own samples say what it shows
LEAST_CONFIDENCE = np.float32(0.02)  # a sample with less is rejected
SMALL_CHANGE = np.float32(0.018)  # of the square root of irradiance: below it, sampling noise
PER_CHANGE = np.float32(1.0 / 0.06)
SIGMAS = np.float32(2.0)  # standard deviations of what a pixel accumulated that count as noise, or if that is more
NOISE = np.float32(0.8)  # this share of sqrt_irradiance's range over the 3x3 pixels that show the object; or, in pixels
KNOWN = np.float32(3.0)  # that accumulated so many samples, all of the range over 3x3: there the mean is compared with
KNOWN_ALONE = np.float32(6.0)  # the same where no sample is stored: nothing around tells of noise there
ANY_OBJECT = -1
REACH = 2  # pixels: so far around a contradicted one older samples lose confidence
SHARE_AT = 1.0 / (1.0 + 0.5 * np.square(np.mgrid[-REACH : REACH + 1, -REACH : REACH + 1]).sum(0)).astype(np.float32)
CHUNK = 512  # samples at a time
GRADIENT_SHARE = np.float32(1.0 / 16.0)  # of one sample in a tile's moving mean


@inline_kernel
def change_of(light, was, count, i, j, object_id, history):
    """How much a sample contradicts the image, 0..1: what is beyond the noise of sampling.

    light : float32, square root of the sample's irradiance; was : the image's at pixel (i, j), below 0 if not known
    count : float32, samples in the pixel's accumulation; history : PixelHistory; `temporal_gradient` updated
    """
    if was < ZERO:
        return ZERO
    known = count >= KNOWN
    accumulation = history.accumulation
    was = accumulation[i, j, IRRADIANCE_MEAN] if known else was
    difference = abs(light - was)
    if difference > SMALL_CHANGE:
        noise = deviation_of(accumulation[i, j]) * SIGMAS
        if difference - noise > SMALL_CHANGE:
            share, shown = (ONE, ANY_OBJECT) if known else (NOISE, object_id)  # the former: an edge through the pixel?
            noise = max(noise, share * range_of(history.sqrt_irradiance, history.nearest, i, j, shown))
        difference = max(difference - noise, ZERO)
    gradient = history.temporal_gradient
    tile = gradient[i // TILE, j // TILE]
    gradient[i // TILE, j // TILE] = tile + GRADIENT_SHARE * (difference - tile)
    return min(max((difference - SMALL_CHANGE) * PER_CHANGE, ZERO), ONE)


@inline_kernel
def deviation_of(accumulation):
    """The standard deviation of the square root of irradiance that a pixel accumulated, 0 while it has no sample."""
    count = accumulation[COUNT]
    return np.sqrt(accumulation[IRRADIANCE_DEVIATIONS] / count) if count > ZERO else ZERO


@inline_kernel
def range_of(irradiance, nearest, i, j, object_id):
    """The range of the square root of irradiance over the 3x3 pixels around (i, j) that show an object, or any."""
    low, high = np.float32(np.inf), np.float32(-np.inf)
    for di in range(max(i - 1, 0), min(i + 2, nearest.shape[0])):
        for dj in range(max(j - 1, 0), min(j + 2, nearest.shape[1])):
            weight = irradiance[di, dj, WEIGHT]
            own = object_id == ANY_OBJECT or nearest[di, dj, NEAREST_OBJECT] == object_id
            if own and weight > TRUSTED:
                light = irradiance[di, dj, IRRADIANCE] / weight
                low, high = min(low, light), max(high, light)
    return max(high - low, ZERO)


@inline_kernel
def mark_contradicted(history, i, j, change, time, object_id):
    """Mark the pixels within REACH of a contradicted one (i, j) for history rejection, less with distance.

    The greatest share of a pixel stays. change : float32, 0..1; time : float32, the contradicting sample's
    """
    rejection, rejected_object = history.rejection, history.rejected_object
    for di in range(max(i - REACH, 0), min(i + REACH + 1, rejection.shape[0])):
        for dj in range(max(j - REACH, 0), min(j + REACH + 1, rejection.shape[1])):
            amount = change * SHARE_AT[di - i + REACH, dj - j + REACH]
            if amount > rejection[di, dj, AMOUNT]:
                rejection[di, dj, AMOUNT] = amount
                rejection[di, dj, BEFORE] = time
                rejected_object[di, dj] = object_id
                history.contradicted[di // TILE, dj // TILE] = True


@kernel
def reject_contradicted(store, count, history):
    """Take confidence from samples of the image's pixels that were contradicted.

    Parameters
    ----------
    store : SampleStore, screen positions still those of the image that was contradicted; `confidence` updated
    count : int, samples stored; history : PixelHistory, see mark_contradicted
    """
    screen, rejection, rejected_object = store.screen_position, history.rejection, history.rejected_object
    width, nowhere = uint32(rejection.shape[1]), uint32(rejected_object.size)
    marked = np.zeros(rejected_object.size + 1, np.uint8)
    mark_pixels(history, store.light.shape[0] > 0, marked)
    pixels, found = np.empty(CHUNK, np.uint32), np.empty(CHUNK, np.uint32)
    for first in range(0, count, CHUNK):
        last = min(first + CHUNK, count)
        x, y, depth = screen[X, first:last], screen[Y, first:last], screen[DEPTH, first:last]
        for k in range(last - first):  # vector code
            inside = depth[k] > ZERO
            pixels[k] = uint32(y[k] if inside else ZERO) * width + uint32(x[k]) if inside else nowhere
        n = uint32(0)
        for k in range(last - first):  # few are found: no branches
            found[n] = uint32(k)
            n += uint32(marked[pixels[k]])
        for m in range(n):
            k = uint32(first) + found[m]
            i, j = uint32(screen[Y, k]), uint32(screen[X, k])
            amount, confidence, before = rejection[i, j, AMOUNT], store.confidence[k], rejection[i, j, BEFORE]
            if amount > ZERO and rejected_object[i, j] == store.object_id[k] and store.time[k] < before:
                confidence *= ONE - amount
            store.confidence[k] = confidence if confidence >= LEAST_CONFIDENCE else ZERO


@inline_kernel
def mark_pixels(history, whole_tiles, marked):
    """Write 1 for the pixels that were contradicted, or for all of their tiles.

    whole_tiles : bool, since corrections of noisy light may have left samples too little confidence
    marked : (h w + 1,) uint8, zeros; the last one stands for what is outside the image
    """
    rejection, tiles = history.rejection, history.contradicted
    height, width = rejection.shape[0], rejection.shape[1]
    for row in range(tiles.shape[0]):
        for column in range(tiles.shape[1]):
            if tiles[row, column]:
                for i in range(row * TILE, min((row + 1) * TILE, height)):
                    for j in range(column * TILE, min((column + 1) * TILE, width)):
                        marked[i * width + j] = np.uint8(whole_tiles | (rejection[i, j, AMOUNT] > ZERO))
