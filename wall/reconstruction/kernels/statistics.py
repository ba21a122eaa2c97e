"""Ages of samples by tiles, as histograms of codes; contrasts of tiles."""

from __future__ import annotations

import numpy as np

from wall.core.jit import inline_kernel, kernel
from wall.deepbuffer.kernels.columns import DEPTH, X, Y
from wall.deepbuffer.kernels.pixel_buffer import TILE


@inline_kernel
def code_of_age(age):
    """1 to 255 for seconds: 16 steps an octave from 2^-10 s on; see statistics.py."""
    if not age > 2.0**-10:
        return 1
    return min(255, 1 + int(np.floor((np.log2(age) + 10.0) * 16.0 + 0.5)))


@kernel
def count_stored(times, confidence, screen, count, now, histogram):
    """Count the ages of samples that are in the image.

    times, confidence : (capacity,) float32; screen : (3, capacity) float32; see SampleStore
    count : int, samples stored; now : float32 seconds of the same clock
    histogram : (rows, columns, 256) uint32, added to
    """
    for k in range(count):
        if screen[DEPTH, k] > 0.0 and confidence[k] > 0.0:
            row, column = int(screen[Y, k]) // TILE, int(screen[X, k]) // TILE
            histogram[row, column, code_of_age(now - times[k])] += 1


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
def contrasts(radiance, value, contrast):
    """The mean squared difference of display values to the right and lower neighbour, in each tile.

    radiance : (h, w, 3) float32 linear RGB
    value : (h, w) float32, scratch: mean of the channels' square roots; contrast : (rows, columns) float64, written
    """
    height, width = value.shape
    for i in range(height):
        for j in range(width):
            total = np.float32(0.0)
            for c in range(3):
                total += np.sqrt(max(radiance[i, j, c], np.float32(0.0)))
            value[i, j] = total / np.float32(3.0)
    contrast[:] = 0.0
    for i in range(height):
        below = min(i + 1, height - 1)
        for j in range(width):
            across, down = value[i, min(j + 1, width - 1)] - value[i, j], value[below, j] - value[i, j]
            contrast[i // TILE, j // TILE] += (across * across + down * down) / 2.0
    for row in range(contrast.shape[0]):
        for column in range(contrast.shape[1]):
            area = (min((row + 1) * TILE, height) - row * TILE) * (min((column + 1) * TILE, width) - column * TILE)
            contrast[row, column] /= area
