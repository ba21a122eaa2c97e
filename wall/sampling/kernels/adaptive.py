"""Adaptive sampling: pixel scores, a systematic draw over them, updates as samples come in."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from wall.core.jit import inline_kernel, kernel
from wall.core.kernels.hashing import hash_uint32
from wall.deepbuffer.kernels.columns import BLUE, COUNT, GREEN, LUMINANCE_DEVIATIONS, LUMINANCE_MEAN, RED
from wall.deepbuffer.kernels.pixel_buffer import TILE
from wall.sampling.kernels.permutation import INSIDE, R2_X, R2_Y

PACKET = 16  # rays
BLOCK = 4  # pixels, edge of the blocks that a tile is walked in
ZERO, ONE = np.float32(0.0), np.float32(1.0)
HOLE_DENSITY = np.float32(0.1)  # samples, weighted: a pixel with less is a hole
HOLE = np.float32(0.005)  # squared display units: least squared error expected of a hole
REJECTED = np.float32(0.02)  # squared display units: the same of a pixel whose whole history a sample contradicts
BELIEVED = np.float32(4.0)  # samples of a pixel at rest before its variance is believed
MOST = np.float32(16384.0)  # samples of a pixel at rest; a small bright lamp in its corner would take for ever
FOUR = np.float32(4.0)
DARKEST = np.float32(1.5e-3)  # light: below it display values grow no steeper, by 12.92 as those of sRGB
SURELY = np.float32(16.0)  # square of the standard errors that a mean is beyond the display's range by
X, Y, WIDTH, HEIGHT = 0, 1, 2, 3  # columns of a rectangle


class Tiles(NamedTuple):
    """A division of (h, w) pixels: every pixel lies in exactly one of the tiles in `order`."""

    rects: np.ndarray  # (capacity, 4) int32: X, Y, WIDTH, HEIGHT, pixels of the region
    sums: np.ndarray  # (capacity,) float64: sum of the scores of a tile's pixels
    tile_of: np.ndarray  # (h, w) int32: tile of each pixel
    order: np.ndarray  # (n,) int32: the tiles there are, neighbours in a row


class Scores(NamedTuple):
    """What is known of each pixel: (h, w) float32 images."""

    contrast: np.ndarray  # mean squared difference of brightness to the neighbours
    density: np.ndarray  # samples
    score: np.ndarray  # expected reduction of the squared error by one more sample


class Pixels(NamedTuple):
    """Where positions of a region are placed."""

    visits: np.ndarray  # (h, w) uint16: next index of each pixel in its R2 sequence
    seed: int
    x0: int  # panel pixel of visits[0, 0]
    y0: int


class Marks(NamedTuple):
    """The marks of a systematic draw inside one tile."""

    number: int
    first: float  # where the first lies, as a share of the tile's sum
    step: float  # from one to the next, likewise


@kernel
def score_moving(resolved, sample_density, accumulation, accumulating, floor, gain, scores, tiles):
    """Score pixels while something moves: contrast / (n (n + 1)), and holes above all.

    Parameters
    ----------
    resolved : (h, w, 3) float32, linear RGB
    sample_density : (h, w) float32, any strides; effective samples of each pixel
    accumulation : (h, w, 8) float32, see deepbuffer.kernels.accumulation
    accumulating : (rows,) bool, of every 16 rows: whether any of their pixels accumulates
    floor : float32, added to every score, so that no pixel starves; gain : see score_still
    scores : Scores, written; tiles : Tiles, sums are written
    """
    height, width = scores.score.shape
    brightness = np.empty((3, width + 2), np.float32)
    for k in (2, 0):  # of the rows above and at row 0, which count as alike
        measure_brightness(resolved[0], gain, brightness[k])
    for i in range(height):
        measure_brightness(resolved[min(i + 1, height - 1)], gain, brightness[(i + 1) % 3])
        up, own, down = brightness[(i + 2) % 3], brightness[i % 3], brightness[(i + 1) % 3]
        contrast, density, score = scores.contrast[i], scores.density[i], scores.score[i]
        measure_contrast(up, own, down, contrast)
        splats, counts = sample_density[i], accumulation[i, :, COUNT]
        for j in range(width):
            density[j] = splats[j]
        if accumulating[i // TILE]:
            for j in range(width):
                density[j] = max(density[j], counts[j])
        for j in range(width):
            score[j] = moving_gain(contrast[j], density[j]) + floor
    sum_tiles(scores.score, tiles)


@inline_kernel
def measure_brightness(row, gain, brightness):
    """Square root of the mean channel, about its display value, of a row of an image; its ends are repeated once.

    row : (w, 3) float32, linear RGB; gain : see score_still; brightness : (w + 2,) float32, written
    """
    third = gain * np.float32(1.0 / 3.0)
    inner = brightness[1:-1]
    for j in range(inner.shape[0]):
        inner[j] = (row[j, 0] + row[j, 1] + row[j, 2]) * third
    for j in range(inner.shape[0]):
        inner[j] = math.sqrt(min(max(inner[j], ZERO), ONE))
    brightness[0], brightness[-1] = brightness[1], brightness[-2]


@inline_kernel
def measure_contrast(up, own, down, contrast):
    """Mean squared difference to the eight neighbours. up, own, down : (w + 2,); contrast : (w,), written; float32"""
    eighth = np.float32(0.125)
    for j in range(contrast.shape[0]):
        value = own[j + 1]
        contrast[j] = (
            (up[j] - value) ** 2
            + (up[j + 1] - value) ** 2
            + (up[j + 2] - value) ** 2
            + (own[j] - value) ** 2
            + (own[j + 2] - value) ** 2
            + (down[j] - value) ** 2
            + (down[j + 1] - value) ** 2
            + (down[j + 2] - value) ** 2
        ) * eighth


@inline_kernel
def measure_contrast_of_four(up, own, down, contrast):
    """Mean squared difference to the four nearest neighbours; parameters: see measure_contrast."""
    for j in range(contrast.shape[0]):
        value = own[j + 1]
        contrast[j] = (
            (up[j + 1] - value) ** 2 + (own[j] - value) ** 2 + (own[j + 2] - value) ** 2 + (down[j + 1] - value) ** 2
        ) * np.float32(0.25)


@kernel
def sum_tiles(score, tiles):
    """Write the tiles' sums of scores (h, w): columns in float32, and those in float64."""
    rects = tiles.rects
    columns = np.empty(score.shape[1], np.float32)
    for tile in tiles.order:
        first, top, width, height = rects[tile, X], rects[tile, Y], rects[tile, WIDTH], rects[tile, HEIGHT]
        sums = columns[:width]
        sums[:] = ZERO
        for i in range(top, top + height):
            line = score[i, first : first + width]
            for j in range(sums.shape[0]):
                sums[j] += line[j]
        total = 0.0
        for j in range(sums.shape[0]):
            total += sums[j]
        tiles.sums[tile] = total


@inline_kernel
def moving_gain(contrast, n):
    """Expected error reduction of one more sample where n samples of a moving image are known."""
    return HOLE + contrast if n < HOLE_DENSITY else contrast / (n * (n + ONE))


@kernel
def score_still(resolved, accumulation, floor, enough, gain, scores, tiles):
    """Score pixels while nothing moves: by their own variance; 0 where the standard error is below `enough`.

    Parameters
    ----------
    resolved : (h, w, 3) float32, linear RGB
    accumulation : (h, w, 8) float32, see deepbuffer.kernels.accumulation
    floor : float32, see score_moving; enough : float32, standard error in brightness that needs no more samples
    gain : float32, what light is multiplied by before it is shown
    scores, tiles : see score_moving
    """
    height, width = scores.score.shape
    brightness = np.empty((3, width + 2), np.float32)
    for k in (2, 0):  # of the rows above and at row 0, which count as alike
        measure_brightness(resolved[0], gain, brightness[k])
    for i in range(height):
        measure_brightness(resolved[min(i + 1, height - 1)], gain, brightness[(i + 1) % 3])
        up, own, down = brightness[(i + 2) % 3], brightness[i % 3], brightness[(i + 1) % 3]
        contrast, density, score = scores.contrast[i], scores.density[i], scores.score[i]
        measure_contrast_of_four(up, own, down, contrast)
        pixels = accumulation[i]
        for j in range(width):
            density[j] = pixels[j, COUNT]
            score[j] = still_gain(pixels[j], contrast[j], density[j], floor, enough, gain)
    sum_tiles(scores.score, tiles)


@inline_kernel
def still_gain(pixel, contrast, n, floor, enough, gain):
    """Expected error reduction of one more sample: variance of n samples and one pseudo-sample of the contrast.

    What counts is the error of the value shown, the square root of the mean light up to 1. So the variance is that of
    light, by the curve's slope at the mean; and nothing is gained where all channels are surely above 1. Samples
    themselves are not cut off: their mean would be too dark.

    pixel : (8,) float32, its accumulation; gain : see score_still
    """
    deviations = gain * gain * pixel[LUMINANCE_DEVIATIONS]
    slope = ONE / (FOUR * min(max(gain * pixel[LUMINANCE_MEAN], DARKEST), ONE))  # squared
    count = max(n, ONE)
    variance = min((slope * deviations + contrast) / count, count)  # no error is larger than the display's range
    beyond = max(gain * min(pixel[RED], pixel[GREEN], pixel[BLUE]) - ONE, ZERO)
    clipped = beyond * beyond * n * n > SURELY * (deviations + FOUR * contrast)
    known = (n >= MOST) | ((n >= BELIEVED) & (clipped | (variance < enough * enough * n)))
    return ZERO if known else variance / ((n + np.float32(0.5)) * (n + ONE)) + floor


@kernel
def draw(score, tiles, pixels, sequence, xy):
    """Place rays by one systematic draw over the scores of all pixels, along a curve through the tiles.

    Marks at equal distances over the sum of all scores: every tile, block and pixel gets its share of the rays rounded
    down or up, so that few rays are spread as evenly as many. Neighbours on the curve share packets.

    Parameters
    ----------
    score : (h, w) float32
    tiles : Tiles; sums are corrected where they have drifted
    pixels : Pixels, visits are counted up
    sequence : int, random numbers are a hash of (pixels.seed, sequence)
    xy : (n, 2) float32, written: panel pixels

    Returns
    -------
    filled : int, positions written; all, but for those of tiles that proved empty
    """
    order, sums = tiles.order, tiles.sums
    total = 0.0
    for tile in order:
        total += sums[tile]
    if not total > 0.0:
        return 0
    step = total / xy.shape[0]
    at = hash_uint32(hash_uint32(np.uint32(pixels.seed), np.uint32(sequence)), np.uint32(0)) * 2.0**-32 * step
    scratch = np.empty(blocks_along(score.shape[1]) * (blocks_along(score.shape[0]) + BLOCK), np.float32)
    seen, left, filled = 0.0, xy.shape[0], np.int64(0)  # a literal 0 would compile what it is handed to once more
    for tile in order:
        first = at - seen
        seen += sums[tile]
        count = 0
        while at < seen and count < left:
            count += 1
            at += step
        if count > 0:
            left -= count
            marks = Marks(count, first / sums[tile], step / sums[tile])
            filled = draw_inside(score, tiles, tile, marks, pixels, scratch, xy, filled)
    return filled


@inline_kernel
def blocks_along(edge):
    """Blocks that an edge of so many pixels touches."""
    return (edge + BLOCK - 1) // BLOCK


@inline_kernel
def draw_inside(score, tiles, tile, marks, pixels, scratch, xy, filled):
    """Write the positions of a tile's marks; returns the new `filled`.

    The curve takes blocks of 4 x 4 pixels in a serpentine order, and the pixels of each in Morton order. So where all
    pixels score alike, 16 marks on 256 pixels are a grid of every fourth one.

    marks : Marks; scratch : float32, see sum_blocks; other parameters : see draw
    """
    rects = tiles.rects
    first, top, width, height = rects[tile, X], rects[tile, Y], rects[tile, WIDTH], rects[tile, HEIGHT]
    across, down = blocks_along(width), blocks_along(height)
    total, block_sums = sum_blocks(score, first, top, width, height, scratch)
    tiles.sums[tile] = total
    if not total > 0.0:
        return filled
    step, at = marks.step * total, marks.first * total
    seen, end = 0.0, filled + marks.number
    i, j = top, first  # the last pixel with a score
    for row in range(down):
        for k in range(across):
            column = across - 1 - k if row & 1 else k
            before, seen = seen, seen + block_sums[row * across + column]
            if not at < seen:
                continue
            for m in range(BLOCK * BLOCK):
                y, x = top + BLOCK * row + (m >> 1 & 1 | m >> 2 & 2), first + BLOCK * column + (m & 1 | m >> 1 & 2)
                if y >= top + height or x >= first + width or not score[y, x] > ZERO:
                    continue
                i, j = y, x
                before += score[i, j]
                while at < before and filled < end:
                    write_position(i, j, pixels, xy, filled)
                    filled += 1
                    at += step
    while filled < end:  # rounding left some over
        write_position(i, j, pixels, xy, filled)
        filled += 1
    return filled


@inline_kernel
def sum_blocks(score, first, top, width, height, scratch):
    """Sums of the 4 x 4 blocks of a rectangle of scores (h, w), those at its right and bottom edges cut off.

    scratch : float32, 4 to a block of a row and one to each block; column sums and block sums are written
    Returns the sum of all, and the blocks' sums, row after row, which lie in scratch.
    """
    across = blocks_along(width)
    columns, block_sums = scratch[: BLOCK * across], scratch[BLOCK * across :]
    total = 0.0
    for row in range(blocks_along(height)):
        for j in range(columns.shape[0]):
            columns[j] = ZERO
        for i in range(top + BLOCK * row, min(top + BLOCK * row + BLOCK, top + height)):
            line = score[i, first : first + width]
            for j in range(line.shape[0]):
                columns[j] += line[j]
        for b in range(across):
            j = BLOCK * b
            block_sum = (columns[j] + columns[j + 1]) + (columns[j + 2] + columns[j + 3])
            block_sums[row * across + b] = block_sum
            total += block_sum
    return total, block_sums


@inline_kernel
def write_position(i, j, pixels, xy, k):
    """Write the next position of pixel (i, j) to xy[k]: its R2 sequence, which a hash of the pixel shifts."""
    key = hash_uint32(hash_uint32(np.uint32(pixels.seed), np.uint32(i)), np.uint32(j))
    n = pixels.visits[i, j]
    pixels.visits[i, j] = n + np.uint16(1)
    u = key * 2.0**-32 + n * R2_X
    v = hash_uint32(key, np.uint32(1)) * 2.0**-32 + n * R2_Y
    xy[k, 0] = pixels.x0 + j + (u - math.floor(u)) * INSIDE
    xy[k, 1] = pixels.y0 + i + (v - math.floor(v)) * INSIDE


@kernel
def learn(samples, x0, y0, accumulation, nothing_moves, floor, enough, gain, scores, tiles):
    """Update the scores of pixels that received samples, and raise them around samples that contradict the image.

    Parameters
    ----------
    samples : (n,) SAMPLE; x0, y0 : int, panel pixel of score[0, 0]
    nothing_moves : bool, scores are those of score_still, else of score_moving
    accumulation, floor, enough, gain : see score_still
    scores : Scores, density and score are updated; tiles : Tiles, sums are updated
    """
    contrast, density, score, sums = scores.contrast, scores.density, scores.score, tiles.sums
    height, width = score.shape
    for k in range(samples.shape[0]):
        i, j = int(samples[k]["xy"][1]) - y0, int(samples[k]["xy"][0]) - x0
        if not (0 <= i < height and 0 <= j < width):
            continue
        density[i, j] += ONE
        if nothing_moves:
            new = still_gain(accumulation[i, j], contrast[i, j], density[i, j], floor, enough, gain)
        else:
            new = moving_gain(contrast[i, j], density[i, j]) + floor
        sums[tiles.tile_of[i, j]] += new - score[i, j]
        score[i, j] = new
        change = samples[k]["change"]
        if change > ZERO:
            raise_around(score, tiles, i, j, REJECTED * change)


@inline_kernel
def raise_around(score, tiles, i, j, amount):
    """Raise the scores of 3 x 3 pixels around (i, j) to at least `amount`, less with distance."""
    for di in range(max(i - 1, 0), min(i + 2, score.shape[0])):
        for dj in range(max(j - 1, 0), min(j + 2, score.shape[1])):
            square = (di - i) * (di - i) + (dj - j) * (dj - j)
            raise_score(score, tiles, di, dj, amount / (ONE + np.float32(0.5) * np.float32(square)))


@inline_kernel
def raise_score(score, tiles, i, j, least):
    """Raise the score of one pixel to at least `least`."""
    if least > score[i, j]:
        tiles.sums[tiles.tile_of[i, j]] += least - score[i, j]
        score[i, j] = least


@kernel
def mark_lost(samples, x0, y0, score, tiles):
    """Score the pixels of lost samples as holes.

    samples : (n,) SAMPLE; x0, y0 : int, panel pixel of score[0, 0]
    score : (h, w) float32, updated; tiles : Tiles, sums are updated
    """
    for k in range(samples.shape[0]):
        i, j = int(samples[k]["xy"][1]) - y0, int(samples[k]["xy"][0]) - x0
        if 0 <= i < score.shape[0] and 0 <= j < score.shape[1]:
            raise_score(score, tiles, i, j, HOLE)
