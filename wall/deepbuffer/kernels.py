"""Fold samples into per-pixel records."""

from __future__ import annotations

import numpy as np

from wall.jit import kernel

TILE = 16  # pixels; what is redone when one of its pixels changed


@kernel
def insert(
    samples, base_time, key, blend, shown, history, mean, count, depth, objects, times, keys, dirty, complete_at
):
    """Fold a batch into the newest-sample records of a panel.

    A sample older than what its pixel has is late and left out. Samples of one event are averaged; the picture of
    the events before fades as (1 - blend)^k with the k-th sample of the new event and is gone when the pixel has
    `complete_at` of them, so that a still picture is the plain mean of its samples.

    Parameters
    ----------
    samples : (n,) SAMPLE, inside the panel
    base_time : float64, seconds
    key : uint64, camera and scene event of the batch
    blend : float32 in (0, 1]
    shown, history, mean : (h, w, 3) float32, linear RGB, updated in place
    count : (h, w) uint16, samples in `mean`; depth : (h, w) float32; objects : (h, w) uint32
    times : (h, w) float64, seconds, -inf = never; keys : (h, w) uint64
    dirty : (ceil(h / 16), ceil(w / 16)) bool, set for tiles that changed
    complete_at : int, samples of one event that make a pixel complete

    Returns
    -------
    late, outside : int
    """
    late = outside = 0
    for k in range(samples.shape[0]):
        x, y = int(samples[k]["xy"][0]), int(samples[k]["xy"][1])
        if x < 0 or y < 0 or x >= shown.shape[1] or y >= shown.shape[0]:
            outside += 1
            continue
        time = base_time + float(samples[k]["time"])
        if time < times[y, x] or key < keys[y, x]:
            late += 1
            continue
        if key != keys[y, x]:
            keys[y, x] = key
            count[y, x] = 0
            for c in range(3):
                history[y, x, c] = shown[y, x, c]
        if count[y, x] < 65535:
            count[y, x] += np.uint16(1)
        n = np.float32(count[y, x])
        old = np.float32(0.0)
        if count[y, x] < complete_at and times[y, x] > -np.inf:
            old = np.float32((1.0 - blend) ** n)
        for c in range(3):
            value = samples[k]["radiance"][c]
            if n == 1.0:
                mean[y, x, c] = value
            else:
                mean[y, x, c] += (value - mean[y, x, c]) / n
            shown[y, x, c] = mean[y, x, c] + old * (history[y, x, c] - mean[y, x, c])
        times[y, x] = time
        depth[y, x] = samples[k]["depth"]
        objects[y, x] = samples[k]["object"]
        dirty[y // TILE, x // TILE] = True
    return late, outside


@kernel
def oldest(times):
    """The time of the oldest sample shown, and how many pixels never had one. times : (h, w) float64."""
    least, never = np.inf, 0
    for y in range(times.shape[0]):
        for x in range(times.shape[1]):
            if times[y, x] == -np.inf:
                never += 1
            elif times[y, x] < least:
                least = times[y, x]
    return least, never
