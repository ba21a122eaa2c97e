"""Statistics of an image's samples, tile by tile: age, density, expected error reduction. Made only when asked for.

Codes are bytes: 0 is none; code c is least * 2^((c - 1) / steps). Rounded to the nearest, so a value is off by at most
a factor of 2^(1 / (2 steps)); beyond the ends, the end is given.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wall.core.data import Float32, Float64
from wall.deepbuffer.kernels.pixel_buffer import TILE
from wall.reconstruction.choice import AnyReconstruction
from wall.reconstruction.kernels import statistics as kernels

Codes = NDArray[np.uint8]


class Scale(NamedTuple):
    """Steps an octave, and log2 of the value of code 1."""

    steps: int
    least: int


AGE = Scale(16, -10)  # seconds: 1 ms to 59 s; kernels.code_of_age
DENSITY = Scale(16, -8)  # samples a pixel: 1/256 to 230
ERROR_REDUCTION = Scale(8, -28)  # squared display units: 4e-9 to 13


def codes_of(values: Float64 | Float32, scale: Scale) -> Codes:
    """uint8 codes of values from 0 on; what is 0 or not a number is 0, what is above 0 at least 1."""
    with np.errstate(divide="ignore", invalid="ignore"):
        codes = np.floor((np.log2(np.float64(values)) - scale.least) * scale.steps + 1.5)
    return np.where(values > 0.0, np.clip(codes, 1.0, 255.0), 0.0).astype(np.uint8)


def values_of(codes: Codes, scale: Scale) -> Float64:
    """The inverse of codes_of()."""
    values: Float64 = np.where(codes == 0, 0.0, 2.0 ** ((codes.astype(np.float64) - 1.0) / scale.steps + scale.least))
    return values


def statistics_of_store(image: AnyReconstruction, now: float) -> tuple[Codes, Float64]:
    """Median age of the samples kept, (rows, columns) codes, and samples a pixel, (rows, columns).

    `now`: seconds of the samples' clock. A pixel at rest counts the samples whose mean it shows, if those are more than
    are stored of it. Raises GpuError if the image's GPU is lost.
    """
    stored, accumulated = image.stored(), image.accumulated_counts()
    height, width = accumulated.shape
    histogram = _histogram(height, width)
    since = np.float32(now - stored.epoch)
    kernels.count_stored(stored.times, stored.confidence, stored.screen_position, stored.in_use, since, histogram)
    return _medians(histogram), np.maximum(histogram.sum(2), tile_sums(accumulated)) / tile_areas(height, width)


def statistics_of_pixels(records: NDArray[np.void], now: float) -> tuple[Codes, Float64]:
    """The same of a pixel buffer's (h, w) PIXEL records: each pixel's newest sample, and how many it is the mean of."""
    height, width = records.shape
    histogram = _histogram(height, width)
    kernels.count_newest(records, now, histogram)
    return _medians(histogram), tile_sums(records["count"]) / tile_areas(height, width)


def grid_error_reduction(radiance: Float32, density: Float64) -> tuple[NDArray[np.uint16], Float64]:
    """Tiles of a fixed grid, (n, 4) x, y, width, height, and the error reduction expected of one more
    sample in each, (n,).

    radiance : (h, w, 3) linear RGB; density : (rows, columns) samples a pixel
    The squared error that a sample is expected to remove is c / (n (n + 1)), c the mean squared difference between
    neighbouring pixels of the tile (mean of the channels' square roots), n the samples a pixel.
    """
    height, width = radiance.shape[:2]
    contrast = np.empty(density.shape, np.float64)
    kernels.contrasts(radiance, np.empty((height, width), np.float32), contrast)
    y, x = np.meshgrid(np.arange(0, height, TILE), np.arange(0, width, TILE), indexing="ij")
    rects = np.stack([x, y, np.minimum(TILE, width - x), np.minimum(TILE, height - y)], axis=2)
    return rects.reshape(-1, 4).astype(np.uint16), expected_error_reduction(contrast, density).ravel()


def expected_error_reduction(contrast: Float64 | Float32, density: Float64 | Float32) -> Float64:
    """The squared error that one more sample removes, of arrays of one shape.

    contrast : squared display units; density : samples a pixel
    """
    n = np.maximum(density, 1.0 / TILE**2)
    error_reduction: Float64 = contrast / (n * (n + 1.0))
    return error_reduction


def tile_sums(values: NDArray[np.generic]) -> Float64:
    """(rows, columns) sums of (h, w) values over tiles of 16 pixels."""
    height, width = values.shape
    rows = np.add.reduceat(values, np.arange(0, height, TILE), axis=0, dtype=np.float64)
    sums: Float64 = np.add.reduceat(rows, np.arange(0, width, TILE), axis=1)
    return sums


def tile_areas(height: int, width: int) -> Float64:
    """(rows, columns) pixels of each tile; those at the right and lower edge may be cut."""
    down = np.minimum(TILE, height - np.arange(0, height, TILE))
    across = np.minimum(TILE, width - np.arange(0, width, TILE))
    return np.outer(down, across).astype(np.float64)


def _histogram(height: int, width: int) -> NDArray[np.uint32]:
    return np.zeros((math.ceil(height / TILE), math.ceil(width / TILE), 256), np.uint32)


def _medians(histogram: NDArray[np.uint32]) -> Codes:
    median = np.zeros(histogram.shape[:2], np.uint8)
    kernels.medians(histogram, median)
    return median
