"""Fold samples into per-pixel records."""

from __future__ import annotations

import numpy as np

from wall.jit import kernel

TILE = 16  # pixels; what is redone when one of its pixels changed
WHOLE = np.uint8(16)  # in `seen`: one sample stands for the whole pixel


@kernel
def insert(
    samples, base_time, key, blend, shown, history, mean, count, seen, depth, objects, times, keys, dirty, complete_at
):
    """Fold a batch into the newest-sample records of a panel.

    A sample of an older event than its pixel shows is late and left out. Of one event:

    - complete_at = 1: the newest sample replaces; an older one is late.
    - complete_at = 4: samples are averaged in whatever order they come, one for each quarter of the pixel; a second one
      of a quarter is a repeat, late. The picture before fades as (1 - blend)^k with the k-th sample and is gone with
      the fourth, so that a still picture is the plain mean of four. Where there was none, the first sample stands in.

    Parameters
    ----------
    samples : (n,) SAMPLE, inside the panel
    base_time : float64, seconds
    key : uint64, camera and scene event of the batch
    blend : float32 in (0, 1]
    shown, history, mean : (h, w, 3) float32, linear RGB, updated in place
    count : (h, w) uint16, samples in `mean`; seen : (h, w) uint8, bits of the quarters they lie in, or WHOLE
    depth : (h, w) float32, objects : (h, w) uint32, of the newest sample
    times : (h, w) float64, seconds, -inf = never; keys : (h, w) uint64
    dirty : (ceil(h / 16), ceil(w / 16)) bool, set for tiles that changed
    complete_at : 1 or 4, samples of one event that make a pixel complete

    Returns
    -------
    late, outside : int
    """
    late = outside = 0
    for k in range(samples.shape[0]):
        column, row = samples[k]["xy"][0], samples[k]["xy"][1]
        if not (0 <= column < shown.shape[1] and 0 <= row < shown.shape[0]):  # int(-0.5) would be inside, NaN too
            outside += 1
            continue
        x, y = int(column), int(row)
        time = base_time + float(samples[k]["time"])
        same = key == keys[y, x] and (seen[y, x] == WHOLE) == (complete_at == 1) and count[y, x] > 0
        part, stale = WHOLE, same and time < times[y, x]
        if complete_at > 1:
            part = np.uint8(1 << (int(2 * column) % 2 + 2 * (int(2 * row) % 2)))
            stale = same and (seen[y, x] & part) != 0
        if key < keys[y, x] or stale:
            late += 1
            continue
        newest = not same or time >= times[y, x]
        if not same:
            never = times[y, x] == -np.inf
            keys[y, x] = key
            count[y, x] = seen[y, x] = 0
            for c in range(3):
                history[y, x, c] = samples[k]["radiance"][c] if never else shown[y, x, c]
        seen[y, x] |= part
        count[y, x] = count[y, x] + 1 if complete_at > 1 else 1
        n = np.float32(count[y, x])
        old = np.float32(0.0)
        if count[y, x] < complete_at:
            old = np.float32((1.0 - blend) ** n)
        for c in range(3):
            value = samples[k]["radiance"][c]
            if n == 1.0:
                mean[y, x, c] = value
            else:
                mean[y, x, c] += (value - mean[y, x, c]) / n
            shown[y, x, c] = mean[y, x, c] + old * (history[y, x, c] - mean[y, x, c])
        if newest:
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
