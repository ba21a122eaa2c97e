"""Note when samples came, by the pixel that they were traced for."""

from __future__ import annotations

import numpy as np

from wall.core.jit import kernel


@kernel
def note_newest(samples, base_time, times):
    """Note each pixel's newest sample. Returns how many samples lie inside.

    samples : (n,) SAMPLE; base_time : float, seconds; times : (h, w) float64 seconds, updated
    """
    height, width = times.shape
    inside = 0
    for k in range(samples.shape[0]):
        x, y = np.floor(samples[k]["xy"][0]), np.floor(samples[k]["xy"][1])
        if x >= 0 and y >= 0 and x < width and y < height:
            inside += 1
            i, j = int(y), int(x)
            times[i, j] = max(times[i, j], base_time + samples[k]["time"])
    return inside
