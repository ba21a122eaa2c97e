"""Random permutations, positions in pixels, running statistics of the samplers."""

from __future__ import annotations

import math

import numpy as np

from wall.core.colour import LUMINANCE
from wall.core.jit import kernel
from wall.core.kernels.hashing import hash_uint32

R2_X, R2_Y = 0.7548776662466927, 0.5698402909980532  # steps of the R2 sequence (Roberts 2018)
INSIDE = 1.0 - 2.0**-10  # of a pixel: positions never reach its far edge, however float32 rounds them
RED, GREEN, BLUE = (np.float32(share) for share in LUMINANCE)


@kernel
def shuffle(order, seed, sweep):
    """Permute `order` (n,) int32 in place: Fisher-Yates, numbers hashed from (seed, sweep, step)."""
    key = hash_uint32(np.uint32(seed), np.uint32(sweep))
    for i in range(order.shape[0] - 1, 0, -1):
        j = np.int64((np.uint64(hash_uint32(key, np.uint32(i))) * np.uint64(i + 1)) >> np.uint64(32))
        order[i], order[j] = order[j], order[i]


@kernel
def next_pixels(order, start, epochs, epoch, numbers):
    """Take the next pixels of a permutation that have no sample of this epoch yet.

    Parameters
    ----------
    order : (n,) int32, permutation of pixel numbers
    start : int, where in the permutation to go on
    epochs : (n,) uint32, newest epoch sampled by pixel, updated
    epoch : uint32, the current one
    numbers : (m,) int32, filled with pixel numbers

    Returns
    -------
    taken, end : int, positions filled; where the walk stopped (n: the sweep is over)
    """
    taken = 0
    k = start
    while k < order.shape[0] and taken < numbers.shape[0]:
        pixel = order[k]
        k += 1
        if epochs[pixel] == epoch:
            continue
        epochs[pixel] = epoch
        numbers[taken] = pixel
        taken += 1
    return taken, k


@kernel
def jittered_pairs(pixels, first, last, parity, xy, filled):
    """Write two of each pixel's four sample positions: one diagonal of the quarter points on even visits, or the other.

    pixels : (n, 2) int32, of them those from `first` to `last`; parity : int, of the visit
    xy : (m, 2) float32, written from `filled` on. Returns the new `filled`.
    """
    for k in range(first, last):
        x, y = np.float32(pixels[k, 0]), np.float32(pixels[k, 1])
        left, right = (0.25, 0.75) if parity == 0 else (0.75, 0.25)
        xy[filled, 0] = x + left
        xy[filled, 1] = y + 0.25
        xy[filled + 1, 0] = x + right
        xy[filled + 1, 1] = y + 0.75
        filled += 2
    return filled


@kernel
def running_statistics(samples, slots, x0, y0, count, mean, m2, window):
    """Update each pixel's running mean and squared deviation of its samples' luminance (Welford's update).

    Past `window` samples the weight of a new one stays 1 / window: an exponentially fading memory, with variance
    m2 / count; before that it is the exact mean and variance of all samples.

    Parameters
    ----------
    samples : (n,) SAMPLE; slots : (h, w) int32, pixel to its place in the arrays, -1: of another thread
    x0, y0 : panel pixel of slots[0, 0]; count, mean, m2 : (p,) float32, updated; window : float

    Returns
    -------
    foreign : int, samples of other threads' pixels
    """
    foreign = 0
    for k in range(samples.shape[0]):
        x = math.floor(samples[k]["xy"][0]) - x0
        y = math.floor(samples[k]["xy"][1]) - y0
        if x < 0 or y < 0 or y >= slots.shape[0] or x >= slots.shape[1] or slots[y, x] < 0:
            foreign += 1
            continue
        p = slots[y, x]
        rgb = samples[k]["radiance"]
        value = RED * rgb[0] + GREEN * rgb[1] + BLUE * rgb[2]
        if count[p] < window:
            count[p] += np.float32(1.0)
            delta = value - mean[p]
            mean[p] += delta / count[p]
            m2[p] += delta * (value - mean[p])
        else:
            delta = value - mean[p]
            mean[p] += delta / count[p]
            m2[p] += delta * (value - mean[p]) - m2[p] / count[p]
    return foreign


@kernel
def clear_epochs(xy, slots, x0, y0, epochs, epoch):
    """Mark the pixels of lost positions as never sampled. Returns how many had a sample of `epoch`.

    xy : (n, 2) float32, panel pixels; slots : (h, w) int32, pixel to its place in `epochs`, -1: of another thread
    x0, y0 : panel pixel of slots[0, 0]; epochs : (n,) uint32, updated; epoch : uint32
    """
    cleared = 0
    for k in range(xy.shape[0]):
        x, y = math.floor(xy[k, 0]) - x0, math.floor(xy[k, 1]) - y0
        if 0 <= x < slots.shape[1] and 0 <= y < slots.shape[0] and slots[y, x] >= 0:
            cleared += epochs[slots[y, x]] == epoch
            epochs[slots[y, x]] = 0
    return cleared


@kernel
def progressive_positions(pixels, seed, k, xy):
    """Write the positions of sample k: the R2 sequence, shifted in each pixel by hashes of (seed, x, y, dimension).

    pixels : (n, 2) int32; xy : (n, 2) float32, written. A position stays inside its pixel: shifts are below 1 - 2^-10.
    """
    for i in range(pixels.shape[0]):
        x, y = pixels[i, 0], pixels[i, 1]
        key = hash_uint32(hash_uint32(np.uint32(seed), np.uint32(x)), np.uint32(y))
        u = hash_uint32(key, np.uint32(0)) * 2.0**-32 + (k + 1) * R2_X
        v = hash_uint32(key, np.uint32(1)) * 2.0**-32 + (k + 1) * R2_Y
        xy[i, 0] = x + (u - np.floor(u)) * INSIDE
        xy[i, 1] = y + (v - np.floor(v)) * INSIDE


@kernel
def accumulate(samples, x0, y0, sums, counts):
    """Add samples to their pixels. sums : (h, w, 3) float64; counts : (h, w) int64; [0, 0] is pixel (x0, y0)."""
    for k in range(samples.shape[0]):
        x, y = int(samples[k]["xy"][0]) - x0, int(samples[k]["xy"][1]) - y0
        for c in range(3):
            sums[y, x, c] += samples[k]["radiance"][c]
        counts[y, x] += 1
