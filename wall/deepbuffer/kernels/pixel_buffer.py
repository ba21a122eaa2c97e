"""Fold samples into per-pixel records."""

from __future__ import annotations

import numpy as np

from wall.core.jit import inline_kernel, kernel

TILE = 16  # pixels; what is redone when one of its pixels changed
WHOLE = np.uint8(16)  # in `seen`: one sample stands for the whole pixel


# what is kept of a pixel: one cache line, so that a sample that lands anywhere costs one miss and not eight
PIXEL = np.dtype(
    {
        "names": ["shown", "history", "mean", "depth", "object_id", "time", "key", "count", "seen"],
        "formats": ["3f4", "3f4", "3f4", "f4", "u4", "f8", "u8", "u1", "u1"],
        "offsets": [0, 12, 24, 36, 40, 48, 56, 44, 45],
        "itemsize": 64,
    }
)


@kernel
def insert(samples, base_time, key, blend, records, dirty, complete_at):
    """Fold a batch into the newest-sample records of a panel.

    A sample of an older event than its pixel shows is late and left out. Of one event:

    - complete_at = 1: the newest sample replaces; an older one is late.
    - complete_at = 4: samples are averaged in whatever order they come, one for each quarter of the pixel; a second one
      of a quarter is a repeat, late. The image before fades as (1 - blend)^k with the k-th sample and is gone with
      the fourth, so that an image at rest is the plain mean of four. Where there was none, the first sample stands in.

    Parameters
    ----------
    samples : (n,) SAMPLE, inside the panel
    base_time : float64, seconds
    key : uint64, camera and scene event of the batch, and whether it was traced under that event itself
    blend : float32 in (0, 1]
    records : (h, w) PIXEL, updated in place: shown, history, mean (linear RGB); depth and object of the newest sample;
        its time, seconds, -inf = never; key; count of samples in mean; seen, bits of the quarters they lie in, or WHOLE
    dirty : (ceil(h / 16), ceil(w / 16)) bool, set for tiles that changed
    complete_at : 1 or 4, samples of one event that make a pixel complete

    Returns
    -------
    late, outside : int
    """
    late = outside = 0
    for k in range(samples.shape[0]):
        column, row = samples[k]["xy"][0], samples[k]["xy"][1]
        if not (0 <= column < records.shape[1] and 0 <= row < records.shape[0]):  # int(-0.5) would be inside, NaN too
            outside += 1
            continue
        x, y = int(column), int(row)
        pixel = records[y, x]
        time = base_time + float(samples[k]["time"])
        same = key == pixel["key"] and (pixel["seen"] == WHOLE) == (complete_at == 1) and pixel["count"] > 0
        part, stale = WHOLE, same and time < pixel["time"]
        if complete_at > 1:
            part = np.uint8(1 << (int(2 * column) % 2 + 2 * (int(2 * row) % 2)))
            stale = same and (pixel["seen"] & part) != 0
        if key < pixel["key"] or stale:
            late += 1
            continue
        newest = not same or time >= pixel["time"]
        radiance = samples[k]["radiance"]
        if complete_at == 1:
            for c in range(3):
                pixel["shown"][c] = radiance[c]
            pixel["count"], pixel["seen"] = 1, WHOLE
        else:
            fold(pixel, radiance, part, same, blend, complete_at)
        pixel["key"] = key
        if newest:
            pixel["time"] = time
            pixel["depth"] = samples[k]["depth"]
            pixel["object_id"] = samples[k]["object_id"]
        dirty[y // TILE, x // TILE] = True
    return late, outside


@inline_kernel
def fold(pixel, radiance, part, same, blend, complete_at):
    """Average a sample into its pixel and let the image before it fade."""
    if not same:
        never = pixel["time"] == -np.inf
        pixel["count"] = pixel["seen"] = 0
        for c in range(3):
            pixel["history"][c] = radiance[c] if never else pixel["shown"][c]
            pixel["mean"][c] = 0.0
    pixel["seen"] |= part
    pixel["count"] += 1
    n = np.float32(pixel["count"])
    old = np.float32((1.0 - blend) ** n) if pixel["count"] < complete_at else np.float32(0.0)
    for c in range(3):
        mean = pixel["mean"][c] + (radiance[c] - pixel["mean"][c]) / n
        pixel["mean"][c] = mean
        pixel["shown"][c] = mean + old * (pixel["history"][c] - mean)


@kernel
def oldest(records):
    """The time of the oldest sample shown, and how many pixels never had one. records : (h, w) PIXEL."""
    least, never = np.inf, 0
    for y in range(records.shape[0]):
        for x in range(records.shape[1]):
            time = records[y, x]["time"]
            if time == -np.inf:
                never += 1
            elif time < least:
                least = time
    return least, never
