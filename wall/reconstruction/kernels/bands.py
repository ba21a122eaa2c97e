"""List stored samples by bands of an image's rows, which threads own."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from wall.core.jit import kernel
from wall.deepbuffer.kernels.columns import DEPTH, Y

uint32 = np.uint32  # as indices: no test whether they count from the end
INFINITE = np.float32(np.inf)
ZERO, ONE = np.float32(0.0), np.float32(1.0)
LISTED = 64  # samples at a time


class Band(NamedTuple):
    """Rows of an image, and the samples that show in them and in the row on either side."""

    top: int
    bottom: int  # the row below the last
    indices: Any  # (listed,) uint32 or more, into the store, in its order
    listed: int  # of them


@kernel
def list_bands(store, first, last, edges, indices, listed):
    """List the samples first to last - 1 of the image by bands of rows, in the order of the store.

    A sample stands in the list of its band, and beside an edge in that of the next band too.

    Parameters
    ----------
    store : SampleStore; first, last : int
    edges : (bands + 1,) int64, first row of each band, and the row below the last
    indices : (bands, capacity) uint32, written from column `first` on
    listed : (bands,) int64, written: samples of each list
    """
    screen, bands = store.screen_position, len(listed)
    listed[:] = 0
    for start in range(first, last, LISTED):
        length = min(LISTED, last - start)
        y, depth = screen[Y, start : start + length], screen[DEPTH, start : start + length]
        some, low, high = uint32(0), INFINITE, -ONE
        for k in range(length):
            inside = depth[k] > ZERO
            some += uint32(1) if inside else uint32(0)
            low = min(low, y[k] if inside else INFINITE)
            high = max(high, y[k] if inside else -ONE)
        if some == 0:
            continue
        band = 0
        while low >= np.float32(edges[band + 1]):
            band += 1
        above = band == 0 or low >= np.float32(edges[band] + 1)
        below = band == bands - 1 or high < np.float32(edges[band + 1] - 1)
        if some == length and above and below:  # nearly always: samples are sorted
            out = indices[band, first + listed[band] :]
            for k in range(length):
                out[k] = uint32(start + k)
            listed[band] += length
            continue
        for k in range(length):
            if depth[k] > ZERO:
                row = np.int64(y[k])
                for n in range(max(band - 1, 0), bands):
                    if row >= edges[n] - 1 and row <= edges[n + 1]:
                        indices[n, first + listed[n]] = uint32(start + k)
                        listed[n] += 1


@kernel
def join_lists(indices, firsts, listed):
    """Bring the lists of one band close together. Returns how many samples they have.

    indices : (capacity,) uint32, lists from each of `firsts` on, updated; firsts, listed : (ranges,) int64
    """
    end = 0
    for n in range(len(firsts)):
        first = firsts[n]
        for k in range(listed[n]):
            indices[end + k] = indices[first + k]
        end += listed[n]
    return end
