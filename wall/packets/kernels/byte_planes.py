"""Numbers of four bytes byte by byte: all first bytes, all second ones, ...; so that equal ones stand together."""

from __future__ import annotations

import numpy as np

from wall.core.jit import kernel


@kernel
def apart(numbers, planes):
    """Split numbers (n,) uint32 into planes (4, n) uint8, written: their bytes, lowest first. Returns the or of all."""
    union = np.uint32(0)
    for k in range(numbers.shape[0]):
        union |= numbers[k]
    for b in range(4):
        shift = np.uint32(8 * b)
        for k in range(numbers.shape[0]):
            planes[b, k] = np.uint8(numbers[k] >> shift)
    return union


@kernel
def together(planes, numbers):
    """The inverse of apart(). planes : (4, n) uint8; numbers : (n,) uint32, written."""
    for k in range(numbers.shape[0]):
        low = np.uint32(planes[0, k]) | np.uint32(planes[1, k]) << np.uint32(8)
        high = np.uint32(planes[2, k]) << np.uint32(16) | np.uint32(planes[3, k]) << np.uint32(24)
        numbers[k] = low | high
