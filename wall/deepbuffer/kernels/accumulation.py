"""The accumulation of a pixel: running means of the samples that it received while nothing in it moved.

An accumulation image is (h, w, 8) float32, see columns.py. A pixel is half a cache line, since samples arrive in any
order. It notes of which objects these samples were, since it may outlive all samples that are stored in the pixel.
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
    NEAREST_OBJECT,
    OBJECTS,
    RED,
    X,
    Y,
)  # fmt: skip
from wall.deepbuffer.kernels.pixel_buffer import TILE

uint32 = np.uint32  # as indices: no test whether they count from the end
ZERO, ONE = np.float32(0.0), np.float32(1.0)
MEAN_ALONE = np.float32(4.0)  # samples of a pixel whose mean is shown alone; with fewer it is mixed with the splats
AROUND = 2  # pixels: so near, an object may cover a pixel in which no sample is stored, and none has told
BITS = 24  # of a float32 that is a whole number: objects are told apart by their numbers modulo that
BRIGHTEST = np.float32(1e12)  # luminance, in moments: squares and their sums stay finite
SHARES = tuple(np.float32(share) for share in LUMINANCE)


@inline_kernel
def accumulate(history, i, j, sample):
    """Add a sample to pixel (i, j): Welford's means and squared deviations, which do not drift as sums do."""
    pixel = history.accumulation[i, j]
    history.accumulating[i // TILE, j // TILE] = True
    bit = object_bit(sample["object_id"])
    if pixel[COUNT] == ZERO:
        note_begun(history, i, j)
        pixel[OBJECTS] = ZERO
    pixel[OBJECTS] = np.float32(uint32(pixel[OBJECTS]) | bit)
    pixel[COUNT] += ONE
    share = ONE / pixel[COUNT]
    red, green, blue = sample["radiance"][0], sample["radiance"][1], sample["radiance"][2]
    light = bounded_luminance(red, green, blue)
    delta = light - bounded_luminance(pixel[RED], pixel[GREEN], pixel[BLUE])
    pixel[RED] += share * (red - pixel[RED])
    pixel[GREEN] += share * (green - pixel[GREEN])
    pixel[BLUE] += share * (blue - pixel[BLUE])
    pixel[LUMINANCE_DEVIATIONS] += delta * (light - bounded_luminance(pixel[RED], pixel[GREEN], pixel[BLUE]))
    delta = sample["sqrt_irradiance"] - pixel[IRRADIANCE_MEAN]
    pixel[IRRADIANCE_MEAN] += delta / pixel[COUNT]
    pixel[IRRADIANCE_DEVIATIONS] += delta * (sample["sqrt_irradiance"] - pixel[IRRADIANCE_MEAN])
    if history.light.shape[0] > 0:
        accumulate_light(history.light[i, j], pixel[COUNT], sample)


@inline_kernel
def object_bit(object_id):
    """The bit of an object in a uint32 that stands for several."""
    return uint32(1) << uint32(object_id % BITS)


@kernel
def object_bits(objects):
    """The bits of those objects (n,) uint8 that are not 0."""
    bits = uint32(0)
    for object_id in range(objects.shape[0]):
        if objects[object_id] != 0:
            bits |= object_bit(object_id)
    return bits


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


@inline_kernel
def bounded_luminance(red, green, blue):
    """Luminance of linear RGB, from 0 to BRIGHTEST."""
    return min(max(luminance(red, green, blue), ZERO), BRIGHTEST)


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
def reject_accumulation(history, changed, tiles, near):
    """Clear the accumulation of pixels that show a changed object, shorten it where samples contradicted it.

    One that holds samples of a changed object is cleared, too, as far as objects are told apart. A pixel in which no
    sample is stored any more keeps it, unless a changed object shows within AROUND pixels.

    history : PixelHistory; what belongs to `accumulation` updated, `contradicted` and `rejection` amounts cleared
    changed : (n + 1,) uint8, objects that moved or stand in another light
    tiles : (rows, columns) bool, where that may be; all contradicted tiles are among them
    near : (rows, columns) bool, tiles in which, or beside which, changed objects may show; looked at as well
    """
    height, width = history.accumulation.shape[0], history.accumulation.shape[1]
    bits = object_bits(changed)
    for row in range(tiles.shape[0]):
        for column in range(tiles.shape[1]):
            if not (tiles[row, column] or near[row, column]):
                continue
            top, left = row * TILE, column * TILE
            bottom, right = min(top + TILE, height), min(left + TILE, width)
            if history.accumulating[row, column]:
                kept = False
                for i in range(top, bottom):
                    for j in range(left, right):
                        kept |= reject_pixel(history, changed, bits, near[row, column], i, j)
                history.accumulating[row, column] = kept
            if history.contradicted[row, column]:
                history.rejection[top:bottom, left:right, AMOUNT] = ZERO
                history.contradicted[row, column] = False


@inline_kernel
def shows_changed(nearest, changed, top, left, bottom, right):
    """Whether a changed object shows in the pixels of a rectangle that lie in the image."""
    for i in range(max(top, 0), min(bottom, nearest.shape[0])):
        for j in range(max(left, 0), min(right, nearest.shape[1])):
            object_id = int(nearest[i, j, NEAREST_OBJECT])
            if object_id >= 0 and changed[object_id] != 0:
                return True
    return False


@inline_kernel
def reject_pixel(history, changed, bits, near, i, j):
    """reject_accumulation for a pixel that may have one; returns whether it still has.

    bits : uint32, of the changed objects; near : bool, one of them may show within AROUND pixels
    """
    pixel = history.accumulation[i, j]
    if pixel[COUNT] == ZERO:
        return False
    object_id, amount = int(history.nearest[i, j, NEAREST_OBJECT]), history.rejection[i, j, AMOUNT]
    gone = (uint32(pixel[OBJECTS]) & bits) != 0 and (object_id < 0 or changed.shape[0] <= BITS)
    if object_id >= 0:
        gone |= changed[object_id] != 0
    elif near and not gone:
        gone = shows_changed(history.nearest, changed, i - AROUND, j - AROUND, i + AROUND + 1, j + AROUND + 1)
    if gone:
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
