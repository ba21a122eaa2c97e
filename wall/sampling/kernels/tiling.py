"""Contrast and sample density of each tile, for overlays."""

from __future__ import annotations

import math

import numpy as np

from wall.core.jit import kernel


@kernel
def measure(rects, listed, contrast, density, slopes, samples):
    """Means over the pixels of each tile.

    Parameters
    ----------
    rects : (tiles, 4) int32, x, y, width, height; listed : (n,) int32, tiles to measure
    contrast : (h, w) float32, squared difference of brightness to the neighbours
    density : (h, w) float32, samples
    slopes, samples : (n,) float32, written: root of contrast, density
    """
    for k in range(listed.shape[0]):
        x, y, width, height = rects[listed[k]]
        slope, count = 0.0, 0.0
        for i in range(y, y + height):
            for j in range(x, x + width):
                slope += math.sqrt(contrast[i, j])
                count += density[i, j]
        pixels = float(width * height)
        slopes[k] = np.float32(slope / pixels)
        samples[k] = np.float32(count / pixels)
