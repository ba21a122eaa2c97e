"""Unpacks the scanlines of a Radiance picture (RGBE, run-length encoded or flat)."""

from __future__ import annotations

import numpy as np

from wall.core.jit import inline_kernel, kernel

NARROWEST, WIDEST = 8, 32767  # pixels of a scanline that may be run-length encoded channel by channel
REPEATED = 128  # a byte above it: repeat the next byte by what it is above
OLD_SHIFT_LIMIT = 24  # bits of an old-style run's length


@kernel
def unpack_scanlines(data, start, rgbe):
    """Unpacks every scanline; returns the number that were whole.

    data : (n,) uint8, the file; start : int, of its first scanline; rgbe : (h, w, 4) uint8, written
    """
    at = start
    for row in range(rgbe.shape[0]):
        line, width = rgbe[row], rgbe.shape[1]
        packed = NARROWEST <= width <= WIDEST and at + 4 <= len(data)
        packed = packed and data[at] == 2 and data[at + 1] == 2
        if packed and (np.int64(data[at + 2]) << 8) + np.int64(data[at + 3]) == width:
            at = unpack_channels(data, at + 4, line)
        else:
            at = unpack_pixels(data, at, line)
        if at < 0:
            return row
    return rgbe.shape[0]


@inline_kernel
def unpack_channels(data, at, line):
    """Unpacks four channels, one after another, to `line` (w, 4); returns where the next scanline starts, else -1."""
    for channel in range(4):
        x = 0
        while x < line.shape[0]:
            if at + 1 >= len(data):
                return -1
            count = np.int64(data[at])
            same = count > REPEATED
            count = count - REPEATED if same else count
            if count == 0 or x + count > line.shape[0] or (not same and at + count >= len(data)):
                return -1
            for k in range(count):
                line[x + k, channel] = data[at + 1] if same else data[at + 1 + k]
            x += count
            at += 2 if same else 1 + count
    return at


@inline_kernel
def unpack_pixels(data, at, line):
    """Unpacks pixel after pixel, old-style runs (1, 1, 1, length) included; returns as unpack_channels does."""
    x, shift = 0, 0
    while x < line.shape[0]:
        if at + 4 > len(data):
            return -1
        if data[at] == 1 and data[at + 1] == 1 and data[at + 2] == 1:
            if x == 0 or shift > OLD_SHIFT_LIMIT:
                return -1
            count = np.int64(data[at + 3]) << shift
            shift += 8
            if x + count > line.shape[0]:
                return -1
            for k in range(count):
                for channel in range(4):
                    line[x + k, channel] = line[x - 1, channel]
            x += count
        else:
            for channel in range(4):
                line[x, channel] = data[at + channel]
            x += 1
            shift = 0
        at += 4
    return at
