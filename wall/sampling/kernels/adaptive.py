"""Adaptive sampling: pixel scores, a systematic draw over tiles and inside them, updates as samples come in."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from wall.core.jit import inline_kernel, kernel
from wall.deepbuffer.kernels.columns import BRIGHTNESS_DEVIATIONS, COUNT
from wall.sampling.kernels.permutation import INSIDE, R2_X, R2_Y, hash_uint32

PACKET = 16  # rays
ZERO, ONE = np.float32(0.0), np.float32(1.0)
HOLE_DENSITY = np.float32(0.1)  # samples, weighted: a pixel with less is a hole
HOLE = np.float32(0.005)  # squared display units: least squared error expected of a hole
REJECTED = np.float32(0.02)  # squared display units: the same of a pixel whose whole history a sample contradicts
BELIEVED = np.float32(4.0)  # samples of a pixel at rest before its variance is believed
X, Y, WIDTH, HEIGHT = 0, 1, 2, 3  # columns of a rectangle


class Tiles(NamedTuple):
    """A division of (h, w) pixels: every pixel lies in exactly one of the tiles in `order`."""

    rects: np.ndarray  # (capacity, 4) int32: X, Y, WIDTH, HEIGHT, pixels of the region
    sums: np.ndarray  # (capacity,) float64: sum of the scores of a tile's pixels
    tile_of: np.ndarray  # (h, w) int32: tile of each pixel
    order: np.ndarray  # (n,) int32: the tiles there are, neighbours in a row


class Scores(NamedTuple):
    """What is known of each pixel: (h, w) float32 images."""

    brightness: np.ndarray  # square root of the mean channel: about its display value
    contrast: np.ndarray  # mean squared difference of brightness to the neighbours
    density: np.ndarray  # samples
    score: np.ndarray  # expected reduction of the squared error by one more sample


class Pixels(NamedTuple):
    """Where positions of a region are placed."""

    visits: np.ndarray  # (h, w) uint16: next index of each pixel in its R2 sequence
    seed: int
    x0: int  # panel pixel of visits[0, 0]
    y0: int


@kernel
def measure_brightness(resolved, scores):
    """Write the brightness of an image. resolved : (h, w, 3) float32 linear RGB; scores : Scores"""
    third = np.float32(1.0 / 3.0)
    for i in range(resolved.shape[0]):
        for j in range(resolved.shape[1]):
            mean = (resolved[i, j, 0] + resolved[i, j, 1] + resolved[i, j, 2]) * third
            scores.brightness[i, j] = math.sqrt(min(max(mean, ZERO), ONE))


@kernel
def score_moving(sample_density, accumulation, floor, scores, tiles):
    """Score pixels while something moves: contrast / (n (n + 1)), and holes above all.

    Parameters
    ----------
    sample_density : (h, w) float32, any strides; effective samples of each pixel
    accumulation : (h, w, 8) float32, see deepbuffer.kernels.accumulation
    floor : float32, added to every score, so that no pixel starves
    scores : Scores, brightness is read, the others are written; tiles : Tiles, sums are written
    """
    value, sums = scores.brightness, tiles.sums
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
            n = max(sample_density[i, j], accumulation[i, j, COUNT])
            scores.contrast[i, j] = total
            scores.density[i, j] = n
            gain = moving_gain(total, n) + floor
            scores.score[i, j] = gain
            sums[tiles.tile_of[i, j]] += gain


@inline_kernel
def moving_gain(contrast, n):
    """Expected error reduction of one more sample where n samples of a moving image are known."""
    return HOLE + contrast if n < HOLE_DENSITY else contrast / (n * (n + ONE))


@kernel
def score_still(accumulation, floor, enough, scores, tiles):
    """Score pixels while nothing moves: by their own variance; 0 where the standard error is below `enough`.

    Parameters
    ----------
    accumulation : (h, w, 8) float32, see deepbuffer.kernels.accumulation
    floor : float32, see score_moving; enough : float32, standard error in brightness that needs no more samples
    scores, tiles : see score_moving
    """
    value, sums = scores.brightness, tiles.sums
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
            n = accumulation[i, j, COUNT]
            scores.contrast[i, j] = total
            scores.density[i, j] = n
            gain = still_gain(accumulation[i, j, BRIGHTNESS_DEVIATIONS], total, n, floor, enough)
            scores.score[i, j] = gain
            sums[tiles.tile_of[i, j]] += gain


@inline_kernel
def still_gain(deviations, contrast, n, floor, enough):
    """Expected error reduction of one more sample: variance of n samples and one pseudo-sample of the contrast."""
    variance = (deviations + contrast) / max(n, ONE)
    if n >= BELIEVED and variance < enough * enough * n:
        return ZERO
    return variance / ((n + np.float32(0.5)) * (n + ONE)) + floor


@kernel
def draw(score, tiles, pixels, packets, sequence, xy):
    """Place packets of 16 rays: tiles by a systematic draw over their sums, pixels by one inside each tile.

    Parameters
    ----------
    score : (h, w) float32
    tiles : Tiles; sums are corrected where they have drifted
    pixels : Pixels, visits are counted up
    packets : int, wanted; sequence : int, random numbers are a hash of (pixels.seed, sequence)
    xy : (16 * packets, 2) float32, written: panel pixels

    Returns
    -------
    filled : int, positions written
    """
    order, sums = tiles.order, tiles.sums
    total = 0.0
    for tile in order:
        total += sums[tile]
    if not total > 0.0:
        return 0
    key = hash_uint32(np.uint32(pixels.seed), np.uint32(sequence))
    step = total / packets
    at = (hash_uint32(key, np.uint32(0)) * 2.0**-32) * step
    seen, filled = 0.0, np.int64(0)  # a literal 0 would compile what it is handed to once more
    for tile in order:
        seen += sums[tile]
        picks = 0
        while at < seen and filled + PACKET * (picks + 1) <= xy.shape[0]:
            picks += 1
            at += step
        if picks > 0:
            u = hash_uint32(key, np.uint32(1 + tile)) * 2.0**-32
            filled = draw_inside(score, tiles, tile, PACKET * picks, u, pixels, xy, filled)
    return filled


@inline_kernel
def draw_inside(score, tiles, tile, count, u, pixels, xy, filled):
    """Write `count` positions of a tile, drawn by its pixels' scores in a serpentine order; returns the new `filled`.

    u : float in [0, 1), where the systematic draw begins; other parameters : see draw
    """
    rects = tiles.rects
    first, top, width, height = rects[tile, X], rects[tile, Y], rects[tile, WIDTH], rects[tile, HEIGHT]
    last, bottom = first + width, top + height
    total = 0.0
    for i in range(top, bottom):
        for j in range(first, last):
            total += score[i, j]
    tiles.sums[tile] = total
    if not total > 0.0:
        return filled
    step = total / count
    at, seen, end = u * step, 0.0, filled + count
    for i in range(top, bottom):
        for q in range(width):
            j = first + q if i % 2 == 0 else last - 1 - q
            seen += score[i, j]
            while at < seen and filled < end:
                write_position(i, j, pixels, xy, filled)
                filled += 1
                at += step
    while filled < end:  # rounding left the last one over
        write_position(bottom - 1, last - 1, pixels, xy, filled)
        filled += 1
    return filled


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
def learn(samples, x0, y0, accumulation, nothing_moves, floor, enough, scores, tiles):
    """Update the scores of pixels that received samples, and raise them around samples that contradict the image.

    Parameters
    ----------
    samples : (n,) SAMPLE; x0, y0 : int, panel pixel of score[0, 0]
    nothing_moves : bool, scores are those of score_still, else of score_moving
    accumulation, floor, enough : see score_still
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
            deviations = accumulation[i, j, BRIGHTNESS_DEVIATIONS]
            gain = still_gain(deviations, contrast[i, j], density[i, j], floor, enough)
        else:
            gain = moving_gain(contrast[i, j], density[i, j]) + floor
        sums[tiles.tile_of[i, j]] += gain - score[i, j]
        score[i, j] = gain
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
