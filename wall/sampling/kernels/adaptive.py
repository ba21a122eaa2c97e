"""Adaptive sampling: pixel scores, a systematic draw over them, updates as samples come in."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from wall.core.jit import inline_kernel, kernel
from wall.core.kernels.hashing import hash_uint32
from wall.core.kernels.tone_mapping import NONE, shown_grey, slope_of_display
from wall.deepbuffer.kernels.accumulation import bounded_luminance
from wall.deepbuffer.kernels.columns import BLUE, COUNT, GREEN, LUMINANCE_DEVIATIONS, RED
from wall.deepbuffer.kernels.pixel_buffer import TILE
from wall.sampling.kernels.permutation import INSIDE, R2_X, R2_Y

PACKET = 16  # rays
BLOCK = 4  # pixels, edge of the blocks that tiles consist of, and are walked in
uint32, uint64 = np.uint32, np.uint64  # as indices: no test whether they count from the end
ZERO, ONE = np.float32(0.0), np.float32(1.0)
HOLE_DENSITY = np.float32(0.1)  # samples, weighted: a pixel with less is a hole
HOLE = np.float32(0.005)  # squared display units: least squared error expected of a hole
REJECTED = np.float32(0.02)  # squared display units: the same of a pixel whose whole history a sample contradicts
BELIEVED = np.float32(6.0)  # samples of a pixel at rest before its variance is believed: four may all be alike
MOST = np.float32(16384.0)  # samples of a pixel at rest; a small bright lamp in its corner would take for ever
FOUR = np.float32(4.0)
DARKEST = np.float32(1.5e-3)  # light: below it display values grow no steeper, by 12.92 as those of sRGB
SURELY = np.float32(16.0)  # square of the standard errors that a mean is beyond the display's range by
X, Y, WIDTH, HEIGHT = 0, 1, 2, 3  # columns of a rectangle


class Tiles(NamedTuple):
    """A division of (h, w) pixels: every pixel lies in exactly one of the tiles in `order`.

    Tiles begin at multiples of BLOCK, and end there or at the border of the image.
    """

    rects: np.ndarray  # (capacity, 4) int32: X, Y, WIDTH, HEIGHT, pixels of the region
    sums: np.ndarray  # (capacity,) float64: sum of the scores of a tile's pixels, as of the last draw
    tile_of: np.ndarray  # (h, w) int32: tile of each pixel
    order: np.ndarray  # (n,) int32: the tiles there are, neighbours in a row


class Scores(NamedTuple):
    """What is known of each pixel: (h, w) float32 images."""

    contrast: np.ndarray  # mean squared difference of brightness to the neighbours
    density: np.ndarray  # samples
    score: np.ndarray  # expected reduction of the squared error by one more sample


class ShownAs(NamedTuple):
    """How light is shown: times `gain`, then mapped by a curve of core.kernels.tone_mapping."""

    gain: np.float32
    mapping: int
    white: np.float32  # exposed light that is shown as white, and all above


class Pixels(NamedTuple):
    """Where positions of a region are placed."""

    visits: np.ndarray  # (h, w) uint16: next index of each pixel in its R2 sequence
    seed: int
    x0: int  # panel pixel of visits[0, 0]
    y0: int


class Marks(NamedTuple):
    """The marks of a systematic draw inside one tile."""

    first: float  # where the first lies in the sum of the tile's scores
    step: float  # from one to the next


@kernel
def score_moving(resolved, sample_density, accumulation, accumulating, floor, tone, scores):
    """Score pixels while something moves: contrast / (n (n + 1)), and holes above all.

    Parameters
    ----------
    resolved : (h, w, 3) float32, linear RGB
    sample_density : (h, w) float32, any strides; effective samples of each pixel
    accumulation : (h, w, 8) float32, see deepbuffer.kernels.accumulation
    accumulating : (rows,) bool, of every 16 rows: whether any of their pixels accumulates
    floor : float32, added to every score, so that no pixel starves; tone : see score_still
    scores : Scores, written
    """
    height, width = scores.score.shape
    brightness = np.empty((3, width + 2), np.float32)
    for k in (2, 0):  # of the rows above and at row 0, which count as alike
        measure_brightness(resolved[0], tone, brightness[k])
    for i in range(height):
        measure_brightness(resolved[min(i + 1, height - 1)], tone, brightness[(i + 1) % 3])
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


@inline_kernel
def measure_brightness(row, tone, brightness):
    """Square root of the mean channel, about its display value, of a row of an image; its ends are repeated once.

    row : (w, 3) float32, linear RGB; tone : see score_still; brightness : (w + 2,) float32, written
    """
    third = tone.gain * np.float32(1.0 / 3.0)
    inner = brightness[1:-1]
    for j in range(inner.shape[0]):
        inner[j] = (row[j, 0] + row[j, 1] + row[j, 2]) * third
    if tone.mapping != NONE:
        for j in range(inner.shape[0]):
            inner[j] = shown_grey(max(inner[j], ZERO), tone.mapping)
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


@inline_kernel
def moving_gain(contrast, n):
    """Expected error reduction of one more sample where n samples of a moving image are known."""
    return HOLE + contrast if n < HOLE_DENSITY else contrast / (n * (n + ONE))


@kernel
def score_still(resolved, accumulation, floor, enough, tone, scores):
    """Score pixels while nothing moves: by their own variance; 0 where the standard error is below `enough`.

    Parameters
    ----------
    resolved : (h, w, 3) float32, linear RGB
    accumulation : (h, w, 8) float32, see deepbuffer.kernels.accumulation
    floor : float32, see score_moving; enough : float32, standard error in brightness that needs no more samples
    tone : ShownAs
    scores : Scores, written
    """
    height, width = scores.score.shape
    brightness = np.empty((3, width + 2), np.float32)
    for k in (2, 0):  # of the rows above and at row 0, which count as alike
        measure_brightness(resolved[0], tone, brightness[k])
    for i in range(height):
        measure_brightness(resolved[min(i + 1, height - 1)], tone, brightness[(i + 1) % 3])
        up, own, down = brightness[(i + 2) % 3], brightness[i % 3], brightness[(i + 1) % 3]
        contrast, density, score = scores.contrast[i], scores.density[i], scores.score[i]
        measure_contrast_of_four(up, own, down, contrast)
        pixels = accumulation[i]
        for j in range(width):
            density[j] = pixels[j, COUNT]
            score[j] = still_gain(pixels[j], contrast[j], density[j], floor, enough, tone)


@inline_kernel
def still_gain(pixel, contrast, n, floor, enough, tone):
    """Expected error reduction of one more sample: variance of n samples and one pseudo-sample of the contrast.

    What counts is the error of the value shown, the square root of the mean light up to 1, or of what tone mapping
    makes of it. So the variance is that of light, by the curve's slope at the mean; and nothing is gained where all
    channels are surely shown as white. Samples themselves are not cut off: their mean would be too dark.

    pixel : (8,) float32, its accumulation; tone : see score_still
    """
    gain = tone.gain
    deviations = gain * gain * pixel[LUMINANCE_DEVIATIONS]
    shown = gain * bounded_luminance(pixel[RED], pixel[GREEN], pixel[BLUE])
    slope = slope_of_display(max(shown, DARKEST), tone.mapping)
    count = max(n, ONE)
    variance = min((slope * deviations + contrast) / count, count)  # no error is larger than the display's range
    beyond = max(gain * min(pixel[RED], pixel[GREEN], pixel[BLUE]) - tone.white, ZERO)
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
    tiles : Tiles; sums are written
    pixels : Pixels, visits are counted up
    sequence : int, random numbers are a hash of (pixels.seed, sequence)
    xy : (n, 2) float32, written: panel pixels

    Returns
    -------
    filled : int, positions written: all, or none where no pixel has a score
    """
    total, block_sums = sum_tiles(score, tiles)
    if not total > 0.0:
        return 0
    step = total / xy.shape[0]
    at = hash_uint32(hash_uint32(np.uint32(pixels.seed), np.uint32(sequence)), np.uint32(0)) * 2.0**-32 * step
    seen, filled = 0.0, 0
    for tile in tiles.order:
        marks, before = Marks(at - seen, step), filled
        seen += tiles.sums[tile]
        while at < seen and filled < xy.shape[0]:
            filled += 1
            at += step
        if filled > before:
            draw_inside(score, tiles.rects[tile], marks, block_sums, xy[before:filled])
    for k in range(filled):
        write_position(pixels, xy[k])
    return filled


@inline_kernel
def blocks_along(edge):
    """Blocks that an edge of so many pixels touches."""
    return (edge + BLOCK - 1) // BLOCK


@kernel
def sum_tiles(score, tiles):
    """Sum the scores (h, w) of each tile, whose sums are written.

    Returns
    -------
    total : float64, sum of all
    block_sums : (blocks_along(h), blocks_along(w)) float32, those of blocks of 4 x 4 pixels
    """
    block_sums = np.empty((blocks_along(score.shape[0]), blocks_along(score.shape[1])), np.float32)
    columns = np.zeros(BLOCK * block_sums.shape[1], np.float32)
    for row in range(block_sums.shape[0]):
        sum_blocks(score[BLOCK * row : min(BLOCK * row + BLOCK, score.shape[0])], columns, block_sums[row])
    total = 0.0
    for tile in tiles.order:
        first, top, across, down = blocks_in(tiles.rects[tile])
        tile_sum = 0.0
        for row in range(top, top + down):
            for column in range(first, first + across):
                tile_sum += block_sums[row, column]
        tiles.sums[tile] = tile_sum
        total += tile_sum
    return total, block_sums


@inline_kernel
def blocks_in(rect):
    """The blocks of a tile: column and row of the first, how many across and down. rect : (4,) int32, see Tiles"""
    first, top = int(rect[X]) // BLOCK, int(rect[Y]) // BLOCK
    return first, top, blocks_along(int(rect[WIDTH])), blocks_along(int(rect[HEIGHT]))


@inline_kernel
def sum_blocks(score, columns, sums):
    """Write the sums of a row of blocks, along the whole image: vector code, and what memory is fast at.

    score : (up to 4, w) float32; columns : (4 n,) float32, scratch, 0 from w on; sums : (n,) float32
    """
    columns[: score.shape[1]] = ZERO
    for i in range(score.shape[0]):
        line = score[i]
        for j in range(line.shape[0]):
            columns[j] += line[j]
    for k in range(sums.shape[0]):
        j = uint64(BLOCK) * uint64(k)
        sums[k] = (columns[j] + columns[j + uint64(1)]) + (columns[j + uint64(2)] + columns[j + uint64(3)])


@inline_kernel
def draw_inside(score, rect, marks, block_sums, xy):
    """Write the pixels of a tile's marks.

    The curve takes blocks of 4 x 4 pixels in a serpentine order, and the pixels of each in Morton order. So where all
    pixels score alike, 16 marks on 256 pixels are a grid of every fourth one.

    score : (h, w) float32; rect : (4,) int32, see Tiles; marks : Marks; block_sums : see sum_tiles
    xy : (n, 2) float32, written for all of its marks: column and row
    """
    first, top, across, down = blocks_in(rect)
    at, seen, filled = marks.first, 0.0, 0
    i, j = uint32(rect[Y]), uint32(rect[X])  # the last pixel with a score
    for row in range(top, top + down):
        for k in range(across):
            column = first + across - 1 - k if (row - top) & 1 else first + k
            before, seen = seen, seen + block_sums[uint32(row), uint32(column)]
            if not at < seen:
                continue
            for m in range(BLOCK * BLOCK):
                y, x = uint32(BLOCK * row + (m >> 1 & 1 | m >> 2 & 2)), uint32(BLOCK * column + (m & 1 | m >> 1 & 2))
                if y >= score.shape[0] or x >= score.shape[1] or not score[y, x] > ZERO:
                    continue
                i, j = y, x
                before += score[i, j]
                while at < before and filled < xy.shape[0]:
                    xy[filled, 0], xy[filled, 1] = j, i
                    filled += 1
                    at += marks.step
                if not at < seen:
                    break
    for k in range(filled, xy.shape[0]):  # rounding left some over
        xy[k, 0], xy[k, 1] = j, i


@inline_kernel
def write_position(pixels, position):
    """Replace a pixel by the next position in it: its R2 sequence, which a hash of the pixel shifts.

    position : (2,) float32: column and row of the pixel; panel pixels are written
    """
    j, i = uint32(position[0]), uint32(position[1])
    key = hash_uint32(hash_uint32(uint32(pixels.seed), i), j)
    n = pixels.visits[i, j]
    pixels.visits[i, j] = n + np.uint16(1)
    u = key * 2.0**-32 + n * R2_X
    v = hash_uint32(key, np.uint32(1)) * 2.0**-32 + n * R2_Y
    position[0] = pixels.x0 + j + (u - math.floor(u)) * INSIDE
    position[1] = pixels.y0 + i + (v - math.floor(v)) * INSIDE


@kernel
def learn(samples, x0, y0, accumulation, nothing_moves, floor, enough, tone, scores):
    """Update the scores of pixels that received samples, and raise them around samples that contradict the image.

    Parameters
    ----------
    samples : (n,) SAMPLE; x0, y0 : int, panel pixel of score[0, 0]
    nothing_moves : bool, scores are those of score_still, else of score_moving
    accumulation, floor, enough, tone : see score_still
    scores : Scores, density and score are updated
    """
    contrast, density, score = scores.contrast, scores.density, scores.score
    height, width = score.shape
    for k in range(samples.shape[0]):
        i, j = int(samples[k]["xy"][1]) - y0, int(samples[k]["xy"][0]) - x0
        if not (0 <= i < height and 0 <= j < width):
            continue
        density[i, j] += ONE
        if nothing_moves:
            new = still_gain(accumulation[i, j], contrast[i, j], density[i, j], floor, enough, tone)
        else:
            new = moving_gain(contrast[i, j], density[i, j]) + floor
        score[i, j] = new
        change = samples[k]["change"]
        if change > ZERO:
            raise_around(score, i, j, REJECTED * change)


@inline_kernel
def raise_around(score, i, j, amount):
    """Raise the scores of 3 x 3 pixels around (i, j) to at least `amount`, less with distance."""
    for di in range(max(i - 1, 0), min(i + 2, score.shape[0])):
        for dj in range(max(j - 1, 0), min(j + 2, score.shape[1])):
            square = (di - i) * (di - i) + (dj - j) * (dj - j)
            score[di, dj] = max(score[di, dj], amount / (ONE + np.float32(0.5) * np.float32(square)))


@kernel
def mark_lost(samples, x0, y0, score):
    """Score the pixels of lost samples as holes.

    samples : (n,) SAMPLE; x0, y0 : int, panel pixel of score[0, 0]
    score : (h, w) float32, updated
    """
    for k in range(samples.shape[0]):
        i, j = int(samples[k]["xy"][1]) - y0, int(samples[k]["xy"][0]) - x0
        if 0 <= i < score.shape[0] and 0 <= j < score.shape[1]:
            score[i, j] = max(score[i, j], HOLE)
