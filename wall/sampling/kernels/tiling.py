"""What is measured in each tile for the display: contrast, change, density."""

from __future__ import annotations

import math

import numpy as np

from wall.core.jit import kernel
from wall.deepbuffer.kernels.pixel_buffer import TILE


@kernel
def measure(rects, listed, contrast, residual, density, spatial, temporal, samples):
    """Means over the pixels of each tile.

    Parameters
    ----------
    rects : (tiles, 4) int32, x, y, width, height; listed : (n,) int32, tiles to measure
    contrast : (h, w) float32, squared difference of brightness to the neighbours
    residual : (rows, columns) float32, of 16-pixel squares: change that new samples find
    density : (h, w) float32, samples
    spatial, temporal, samples : (n,) float32, written: root of contrast, residual, density
    """
    for k in range(listed.shape[0]):
        x, y, width, height = rects[listed[k]]
        slope, change, count = 0.0, 0.0, 0.0
        for i in range(y, y + height):
            for j in range(x, x + width):
                slope += math.sqrt(contrast[i, j])
                change += residual[i // TILE, j // TILE]
                count += density[i, j]
        pixels = float(width * height)
        spatial[k] = np.float32(slope / pixels)
        temporal[k] = np.float32(change / pixels)
        samples[k] = np.float32(count / pixels)
