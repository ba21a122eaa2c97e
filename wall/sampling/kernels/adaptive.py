"""Where rays pay most: pixel scores, a systematic draw over tiles and inside them, scores corrected as samples come."""

from __future__ import annotations

import math

import numpy as np

from wall.core.jit import inline_kernel, kernel
from wall.sampling.kernels.permutation import hash_uint32

PACKET = 16  # rays
ZERO, ONE = np.float32(0.0), np.float32(1.0)
EMPTY = np.float32(0.1)  # weight below which a pixel counts as a hole
HOLE = np.float32(0.005)  # least squared error expected of a hole, display units
DOUBTED = np.float32(0.02)  # the same of a pixel that was contradicted altogether
STEPS_X, STEPS_Y = 0.7548776662466927, 0.5698402909980532  # R2 sequence (Roberts 2018)


@kernel
def brightness(radiance, value):
    """Square root of the mean channel, as near to display values as a pixel score needs. value : (h, w) float32."""
    third = np.float32(1.0 / 3.0)
    for i in range(value.shape[0]):
        for j in range(value.shape[1]):
            mean = (radiance[i, j, 0] + radiance[i, j, 1] + radiance[i, j, 2]) * third
            value[i, j] = math.sqrt(min(max(mean, ZERO), ONE))


@kernel
def score_moving(value, gathered, still, floor, contrast, density, score, tile_of, sums):
    """Expected gain of one more sample in each pixel while something moves: contrast / (n (n + 1)), holes first.

    Parameters
    ----------
    value : (h, w) float32, brightness; gathered : (h + 2, w + 2, 4) float32, weight last
    still : (h, w, 8) float32, see reconstruction.kernels_picture; samples gathered at rest at 3
    floor : float32, what every pixel has at least: nothing starves
    contrast, density, score : (h, w) float32, written
    tile_of : (h, w) int32, tile of each pixel; sums : (tiles,) float64, of score, written
    """
    height, width = value.shape
    sums[:] = 0.0
    eighth = np.float32(0.125)
    for i in range(height):
        up, down = max(i - 1, 0), min(i + 1, height - 1)
        for j in range(width):
            left, right = max(j - 1, 0), min(j + 1, width - 1)
            own = value[i, j]
            total = (
                (value[up, left] - own) ** 2
                + (value[up, j] - own) ** 2
                + (value[up, right] - own) ** 2
                + (value[i, left] - own) ** 2
                + (value[i, right] - own) ** 2
                + (value[down, left] - own) ** 2
                + (value[down, j] - own) ** 2
                + (value[down, right] - own) ** 2
            ) * eighth
            n = max(gathered[i + 1, j + 1, 3], still[i, j, 3])
            contrast[i, j] = total
            density[i, j] = n
            gain = gain_of(total, n) + floor
            score[i, j] = gain
            sums[tile_of[i, j]] += gain


@inline_kernel
def gain_of(contrast, n):
    return HOLE + contrast if n < EMPTY else contrast / (n * (n + ONE))


@kernel
def score_still(value, still, floor, enough, contrast, density, score, tile_of, sums):
    """The same where nothing moves: a pixel's own variance, and nothing where its standard error is below `enough`.

    Parameters
    ----------
    still : (h, w, 8) float32, see reconstruction.kernels_picture; count at 3, mean and squared deviations at 4, 5
    enough : float32, standard error in brightness that needs no more samples
    value, floor, contrast, density, score, tile_of, sums : see score_moving
    """
    height, width = value.shape
    sums[:] = 0.0
    for i in range(height):
        up, down = max(i - 1, 0), min(i + 1, height - 1)
        for j in range(width):
            left, right = max(j - 1, 0), min(j + 1, width - 1)
            own = value[i, j]
            total = (
                (value[up, j] - own) ** 2
                + (value[i, left] - own) ** 2
                + (value[i, right] - own) ** 2
                + (value[down, j] - own) ** 2
            ) * np.float32(0.25)
            n = still[i, j, 3]
            contrast[i, j] = total
            density[i, j] = n
            gain = still_gain(still[i, j, 5], total, n, floor, enough)
            score[i, j] = gain
            sums[tile_of[i, j]] += gain


LEAST = np.float32(4.0)  # samples of a still pixel before its variance is believed


@inline_kernel
def still_gain(deviations, contrast, n, floor, enough):
    """Gain of one more sample: variance from n samples and one pseudo-sample of the local contrast."""
    variance = (deviations + contrast) / max(n, ONE)
    if n >= LEAST and variance < enough * enough * n:
        return ZERO
    return variance / ((n + np.float32(0.5)) * (n + ONE)) + floor


@kernel
def draw(score, rects, order, sums, packets, seed, sequence, visits, x0, y0, xy):
    """Place `packets` packets of 16 rays: tiles by a systematic draw over their sums, pixels by one inside.

    Parameters
    ----------
    score : (h, w) float32
    rects : (tiles, 4) int32, x, y, width, height in pixels of `score`; order : (m,) int32, tiles, neighbours in a row
    sums : (tiles,) float64, of score, corrected where they have drifted
    seed, sequence : random numbers are a hash of them
    visits : (h, w) uint16, R2 index of each pixel, counted up
    x0, y0 : panel pixel of score[0, 0]
    xy : (16 * packets, 2) float32, written: panel pixels

    Returns
    -------
    filled : int, positions written
    """
    total = 0.0
    for tile in order:
        total += sums[tile]
    if not total > 0.0:
        return 0
    key = hash_uint32(np.uint32(seed), np.uint32(sequence))
    step = total / packets
    at = (hash_uint32(key, np.uint32(0)) * 2.0**-32) * step
    seen, filled = 0.0, 0
    for tile in order:
        seen += sums[tile]
        picks = 0
        while at < seen and filled + PACKET * (picks + 1) <= xy.shape[0]:
            picks += 1
            at += step
        if picks > 0:
            u = hash_uint32(key, np.uint32(1 + tile)) * 2.0**-32
            filled = draw_inside(score, rects, sums, tile, PACKET * picks, u, seed, visits, x0, y0, xy, filled)
    return filled


@inline_kernel
def draw_inside(score, rects, sums, tile, count, u, seed, visits, x0, y0, xy, filled):
    """`count` positions in a tile, by its pixels' scores, row by row and back."""
    first, top, width, height = rects[tile, 0], rects[tile, 1], rects[tile, 2], rects[tile, 3]
    last, bottom = first + width, top + height
    total = 0.0
    for i in range(top, bottom):
        for j in range(first, last):
            total += score[i, j]
    sums[tile] = total
    if not total > 0.0:
        return filled
    step = total / count
    at, seen, end = u * step, 0.0, filled + count
    for i in range(top, bottom):
        for q in range(width):
            j = first + q if i % 2 == 0 else last - 1 - q
            seen += score[i, j]
            while at < seen and filled < end:
                place_in_pixel(i, j, seed, visits, x0, y0, xy, filled)
                filled += 1
                at += step
    while filled < end:  # rounding left the last one over
        place_in_pixel(bottom - 1, last - 1, seed, visits, x0, y0, xy, filled)
        filled += 1
    return filled


@inline_kernel
def place_in_pixel(i, j, seed, visits, x0, y0, xy, k):
    """The pixel's next position: the R2 sequence from a start of its own; never on the far edge."""
    key = hash_uint32(hash_uint32(np.uint32(seed), np.uint32(i)), np.uint32(j))
    n = visits[i, j]
    visits[i, j] = n + np.uint16(1)
    u = key * 2.0**-32 + n * STEPS_X
    v = hash_uint32(key, np.uint32(1)) * 2.0**-32 + n * STEPS_Y
    xy[k, 0] = x0 + j + (u - math.floor(u)) * (1.0 - 2.0**-10)
    xy[k, 1] = y0 + i + (v - math.floor(v)) * (1.0 - 2.0**-10)


@kernel
def learn(samples, x0, y0, floor, still, nothing_moves, enough, contrast, density, score, tile_of, sums):
    """Correct scores by samples just traced: one more in their pixel; what was contradicted draws rays at once.

    Parameters
    ----------
    samples : (n,) SAMPLE; x0, y0 : panel pixel of score[0, 0]
    nothing_moves : bool, scores are those of score_still, else of score_moving
    floor, still, enough, contrast : see there; density, score, sums : updated; tile_of : (h, w) int32
    """
    height, width = score.shape
    for k in range(samples.shape[0]):
        i, j = int(samples[k]["xy"][1]) - y0, int(samples[k]["xy"][0]) - x0
        if not (0 <= i < height and 0 <= j < width):
            continue
        density[i, j] += ONE
        if nothing_moves:
            gain = still_gain(still[i, j, 5], contrast[i, j], density[i, j], floor, enough)
        else:
            gain = gain_of(contrast[i, j], density[i, j]) + floor
        sums[tile_of[i, j]] += gain - score[i, j]
        score[i, j] = gain
        change = samples[k]["change"]
        if change > ZERO:
            raise_around(score, tile_of, sums, i, j, DOUBTED * change)


@inline_kernel
def raise_around(score, tile_of, sums, i, j, amount):
    for di in range(max(i - 1, 0), min(i + 2, score.shape[0])):
        for dj in range(max(j - 1, 0), min(j + 2, score.shape[1])):
            square = (di - i) * (di - i) + (dj - j) * (dj - j)
            least = amount / (ONE + np.float32(0.5) * np.float32(square))
            if least > score[di, dj]:
                sums[tile_of[di, dj]] += least - score[di, dj]
                score[di, dj] = least


@kernel
def miss(xy, x0, y0, score, tile_of, sums):
    """Samples at xy (n, 2) float32, panel pixels, were lost: their pixels are worth as much as holes.

    x0, y0 : panel pixel of score[0, 0]; score, tile_of, sums : see score_moving; score and sums updated
    """
    for k in range(xy.shape[0]):
        i, j = int(xy[k, 1]) - y0, int(xy[k, 0]) - x0
        if 0 <= i < score.shape[0] and 0 <= j < score.shape[1] and score[i, j] < HOLE:
            sums[tile_of[i, j]] += HOLE - score[i, j]
            score[i, j] = HOLE
