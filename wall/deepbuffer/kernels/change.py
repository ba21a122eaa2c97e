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
ZERO, ONE, HALF = np.float32(0.0), np.float32(1.0), np.float32(0.5)
TRUSTED = np.float32(0.25)  # weight from which a pixel's own samples say what it shows
LEAST_CONFIDENCE = np.float32(0.02)  # a sample with less is rejected
SMALL_CHANGE = np.float32(0.018)  # of the square root of irradiance: below it, sampling noise
PER_CHANGE = np.float32(1.0 / 0.06)
NOISE = np.float32(0.8)  # share of sqrt_irradiance's range over 3x3 pixels that counts as noise
KNOWN = np.float32(3.0)  # accumulated samples from which a pixel's own deviation says what is noise:
SIGMAS = np.float32(2.0)  # so many standard deviations
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
        if known:
            noise = SIGMAS * np.sqrt(accumulation[i, j, IRRADIANCE_DEVIATIONS] / accumulation[i, j, COUNT])
        else:
            noise = NOISE * range_of(history.sqrt_irradiance, history.nearest, i, j, object_id)
        difference = max(difference - noise, ZERO)
    gradient = history.temporal_gradient
    tile = gradient[i // TILE, j // TILE]
    gradient[i // TILE, j // TILE] = tile + GRADIENT_SHARE * (difference - tile)
    return min(max((difference - SMALL_CHANGE) * PER_CHANGE, ZERO), ONE)


@inline_kernel
def range_of(irradiance, nearest, i, j, object_id):
    """The range of the square root of irradiance over the 3x3 pixels around (i, j) that show the same object."""
    low, high = np.float32(np.inf), np.float32(-np.inf)
    for di in range(max(i - 1, 0), min(i + 2, nearest.shape[0])):
        for dj in range(max(j - 1, 0), min(j + 2, nearest.shape[1])):
            weight = irradiance[di, dj, WEIGHT]
            if nearest[di, dj, NEAREST_OBJECT] == object_id and weight > TRUSTED:
                light = irradiance[di, dj, IRRADIANCE] / weight
                low, high = min(low, light), max(high, light)
    return max(high - low, ZERO)


@inline_kernel
def mark_contradicted(history, i, j, change, time, object_id):
    """Mark the 3x3 pixels around a contradicted one (i, j) for history rejection, less with distance.

    The greatest share of a pixel stays. change : float32, 0..1; time : float32, the contradicting sample's
    """
    rejection, rejected_object = history.rejection, history.rejected_object
    for di in range(max(i - 1, 0), min(i + 2, rejection.shape[0])):
        for dj in range(max(j - 1, 0), min(j + 2, rejection.shape[1])):
            square = (di - i) * (di - i) + (dj - j) * (dj - j)
            amount = change / (ONE + HALF * np.float32(square))
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
    tiles = history.contradicted
    for k in range(count):
        if not screen[DEPTH, k] > ZERO:
            continue
        i, j = uint32(screen[Y, k]), uint32(screen[X, k])
        if not tiles[i // uint32(TILE), j // uint32(TILE)]:
            continue
        amount, confidence = rejection[i, j, AMOUNT], store.confidence[k]
        if amount > ZERO and rejected_object[i, j] == store.object_id[k] and store.time[k] < rejection[i, j, BEFORE]:
            confidence *= ONE - amount
        store.confidence[k] = confidence if confidence >= LEAST_CONFIDENCE else ZERO
