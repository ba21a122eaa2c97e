"""Adaptive sampling: what another sample is expected to gain in each pixel, updated as samples come in."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from wall.core.jit import inline_kernel, kernel
from wall.core.kernels.tone_mapping import NONE, shown_grey, slope_of_display
from wall.deepbuffer.kernels.accumulation import bounded_luminance
from wall.deepbuffer.kernels.columns import BLUE, COUNT, GREEN, LUMINANCE_DEVIATIONS, RED
from wall.deepbuffer.kernels.pixel_buffer import TILE

ZERO, ONE = np.float32(0.0), np.float32(1.0)
HOLE_DENSITY = np.float32(0.1)  # samples, weighted: a pixel with less is a hole
HOLE = np.float32(0.005)  # squared display units: least squared error expected of a hole
REJECTED = np.float32(0.02)  # squared display units: the same of a pixel whose whole history a sample contradicts
BELIEVED = np.float32(6.0)  # samples of a pixel at rest before its variance is believed: four may all be alike
MOST = np.float32(16384.0)  # samples of a pixel at rest; a small bright lamp in its corner would take for ever
FOUR = np.float32(4.0)
DARKEST = np.float32(1.5e-3)  # light: below it display values grow no steeper, by 12.92 as those of sRGB
SURELY = np.float32(16.0)  # square of the standard errors that a mean is beyond the display's range by


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
    for i in range(height):
        measure_row_below(resolved, i, tone, brightness)
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
def measure_row_below(resolved, i, tone, brightness):
    """Measure the row below row i, for i from 0 on; with row 0 itself, and the one above it, which counts as alike.

    resolved : (h, w, 3) float32, linear RGB; tone : see score_still
    brightness : (3, w + 2) float32, a ring of rows: row k stands at k % 3
    """
    if i == 0:
        for k in (2, 0):
            measure_brightness(resolved[0], tone, brightness[k])
    measure_brightness(resolved[min(i + 1, resolved.shape[0] - 1)], tone, brightness[(i + 1) % 3])


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
    for i in range(height):
        measure_row_below(resolved, i, tone, brightness)
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
