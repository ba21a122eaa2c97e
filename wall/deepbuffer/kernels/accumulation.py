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
    history.held[i // TILE, j // TILE] |= bit
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
            accumulating[row, column], history.held[row, column] = False, uint32(0)
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

    history : PixelHistory; what belongs to `accumulation` updated, `contradicted` and `rejection` amounts cleared,
        `dirty` set for tiles that held samples of a changed object
    changed : (n + 1,) uint8, objects that moved or stand in another light
    tiles : (rows, columns) bool, where that may be; all contradicted tiles are among them
    near : (rows, columns) bool, tiles in which, or beside which, changed objects may show; looked at as well, as are
        those that hold samples of some
    """
    height, width = history.accumulation.shape[0], history.accumulation.shape[1]
    bits, covered = object_bits(changed), np.empty(TILE + 2 * AROUND, np.uint32)
    left_by = bits if changed.shape[0] <= BITS else uint32(0)  # objects: others share bits with too many
    for row in range(tiles.shape[0]):
        for column in range(tiles.shape[1]):
            here = uint32(0) if history.still[row, column] else bits  # what moved is elsewhere, whatever bits say
            if not (tiles[row, column] or near[row, column] or history.held[row, column] & left_by & here):
                continue
            top, left = row * TILE, column * TILE
            bottom, right = min(top + TILE, height), min(left + TILE, width)
            history.dirty[row, column] |= (history.held[row, column] & left_by & here) != 0
            if history.accumulating[row, column]:
                held, unknown = uint32(0), False
                for i in range(top, bottom):
                    objects, alone = reject_in_row(history, changed, here, i, left, right)
                    held, unknown = held | objects, unknown | alone
                if unknown and here and near[row, column]:
                    held = clear_covered(history, changed, top, left, bottom, right, covered)
                history.accumulating[row, column], history.held[row, column] = held != 0, held
            if history.contradicted[row, column]:
                history.rejection[top:bottom, left:right, AMOUNT] = ZERO
                history.contradicted[row, column] = False


@inline_kernel
def reject_in_row(history, changed, bits, i, left, right):
    """reject_accumulation for some pixels of a row, but for what may cover them. bits : of `changed`.

    Returns
    -------
    remaining : uint32, bits of the objects whose samples they still hold; unknown : bool, some of them store no sample
    """
    remaining, unknown = uint32(0), False
    pixels, objects = history.accumulation[i, left:right], history.nearest[i, left:right, NEAREST_OBJECT]
    amounts, told_apart = history.rejection[i, left:right, AMOUNT], changed.shape[0] <= BITS
    for k in range(pixels.shape[0]):
        if pixels[k, COUNT] == ZERO:
            continue
        object_id, held = int(objects[k]), uint32(pixels[k, OBJECTS])
        stored = object_id >= 0
        if (held & bits and (told_apart or not stored)) or (stored and changed[object_id] != 0):
            pixels[k] = ZERO
            continue
        if amounts[k] > ZERO and (held & object_bit(history.rejected_object[i, left + k])) != 0:
            shorten(pixels[k], (ONE - amounts[k]) ** 3)  # one contradiction must outweigh many samples that agreed
        if pixels[k, COUNT] > ZERO:
            remaining, unknown = remaining | held, unknown | (not stored)
    return remaining, unknown


@inline_kernel
def clear_covered(history, changed, top, left, bottom, right, covered):
    """Clear the accumulation of those pixels of a tile that a changed object may have come to cover.

    covered : (TILE + 2 AROUND,) uint32, written
    Returns the bits of the objects whose samples its pixels still hold.
    """
    nearest, accumulation, remaining = history.nearest, history.accumulation, uint32(0)
    for r in range(covered.shape[0]):  # bit k of a row: whether one shows in it within AROUND columns of left + k
        covered[r] = changed_in_row(nearest, changed, top + r - AROUND, left, right)
    for i in range(top, bottom):
        bits = uint32(0)
        for r in range(2 * AROUND + 1):
            bits |= covered[i - top + r]
        for j in range(left, right):
            if accumulation[i, j, COUNT] == ZERO:
                continue
            if nearest[i, j, NEAREST_OBJECT] < ZERO and (bits >> uint32(j - left)) & uint32(1):
                accumulation[i, j] = ZERO
            remaining |= uint32(accumulation[i, j, OBJECTS])
    return remaining


@inline_kernel
def changed_in_row(nearest, changed, i, left, right):
    """Bit k: whether a changed object shows in row i within AROUND columns of left + k; the row may not exist."""
    bits = uint32(0)
    if 0 <= i < nearest.shape[0]:
        for j in range(max(left - AROUND, 0), min(right + AROUND, nearest.shape[1])):
            object_id = int(nearest[i, j, NEAREST_OBJECT])
            if object_id >= 0 and changed[object_id] != 0:
                bits |= uint32(1) << uint32(j - left + AROUND)
    near = bits
    for k in range(2 * AROUND):
        near |= bits >> uint32(k + 1)
    return near


@kernel
def limit_counts(tiles, accumulation, most):
    """Let what the pixels of some tiles (rows, columns) bool accumulated weigh as `most` samples (float32) at most."""
    for i in range(accumulation.shape[0]):
        for j in range(accumulation.shape[1]):
            if tiles[i // TILE, j // TILE] and accumulation[i, j, COUNT] > most:
                shorten(accumulation[i, j], most / accumulation[i, j, COUNT])


@inline_kernel
def shorten(pixel, share):
    """Let a pixel's accumulation weigh as a share of its samples; mean and variance stay."""
    pixel[COUNT] *= share
    pixel[LUMINANCE_DEVIATIONS] *= share
    pixel[IRRADIANCE_DEVIATIONS] *= share
