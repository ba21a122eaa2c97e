"""Ages of samples by tiles, as histograms of codes; contrasts of tiles."""

from __future__ import annotations

import numpy as np

from wall.deepbuffer.kernels import TILE
from wall.jit import inline_kernel, kernel


@inline_kernel
def code_of_age(age):
    """1 to 255 for seconds: 16 steps an octave from 2^-10 s on; see survey.py."""
    if not age > 2.0**-10:
        return 1
    return min(255, 1 + int(np.floor((np.log2(age) + 10.0) * 16.0 + 0.5)))


@kernel
def count_stored(state, screen, count, now, histogram):
    """Count the ages of samples that are in the picture.

    state : (2, capacity) float32, time in seconds and confidence; screen : (3, capacity) float32 x, y, depth
    now : float32 seconds of the same clock
    histogram : (rows, columns, 256) uint32, added to
    """
    for k in range(count):
        if screen[2, k] > 0.0 and state[1, k] > 0.0:
            row, column = int(screen[1, k]) // TILE, int(screen[0, k]) // TILE
            histogram[row, column, code_of_age(now - state[0, k])] += 1


@kernel
def count_newest(records, now, histogram):
    """Count the age of every pixel's newest sample.

    records : (h, w) PIXEL; now : float64 seconds; histogram : (rows, columns, 256) uint32, added to
    """
    for y in range(records.shape[0]):
        for x in range(records.shape[1]):
            time = records[y, x]["time"]
            if time > -np.inf:
                histogram[y // TILE, x // TILE, code_of_age(now - time)] += 1


@kernel
def medians(histogram, median):
    """The code below or at which half of the samples are; 0 where there are none.

    histogram : (rows, columns, 256) uint32; median : (rows, columns) uint8, written
    """
    for row in range(histogram.shape[0]):
        for column in range(histogram.shape[1]):
            total = np.int64(0)
            for code in range(256):
                total += histogram[row, column, code]
            median[row, column] = 0
            below = np.int64(0)
            for code in range(256):
                below += histogram[row, column, code]
                if total > 0 and 2 * below >= total:
                    median[row, column] = code
                    break


@kernel
def contrasts(radiance, variance):
    """The variance of display values (mean of the channels' square roots) within each tile.

    radiance : (h, w, 3) float32 linear RGB; variance : (rows, columns) float64, written
    """
    height, width = radiance.shape[0], radiance.shape[1]
    for row in range(variance.shape[0]):
        for column in range(variance.shape[1]):
            top, left = row * TILE, column * TILE
            bottom, right = min(top + TILE, height), min(left + TILE, width)
            total, squares = 0.0, 0.0
            for i in range(top, bottom):
                for j in range(left, right):
                    value = 0.0
                    for c in range(3):
                        value += np.sqrt(max(radiance[i, j, c], np.float32(0.0))) / 3.0
                    total += value
                    squares += value * value
            mean = total / ((bottom - top) * (right - left))
            variance[row, column] = max(squares / ((bottom - top) * (right - left)) - mean * mean, 0.0)
