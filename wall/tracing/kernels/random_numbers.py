"""Random numbers of paths: Owen-scrambled Sobol points, by hash of pixel, sample number and dimension.

Each pair of dimensions is the first two of Sobol's sequence, its points shuffled and scrambled by hashes of the pixel
and the pair: any sample can be traced again alone, and the numbers of a pixel's samples are spread evenly.
B. Burley, "Practical Hash-based Owen Scrambling", JCGT 2020.
"""

from __future__ import annotations

import numpy as np

from wall.core.jit import lane_kernel
from wall.core.kernels.hashing import hash_uint32

UNIT = np.float32(2.0**-24)


@lane_kernel
def reverse_bits(x):
    """A uint32 with its bits in reverse order."""
    x = ((x & np.uint32(0x55555555)) << np.uint32(1)) | ((x >> np.uint32(1)) & np.uint32(0x55555555))
    x = ((x & np.uint32(0x33333333)) << np.uint32(2)) | ((x >> np.uint32(2)) & np.uint32(0x33333333))
    x = ((x & np.uint32(0x0F0F0F0F)) << np.uint32(4)) | ((x >> np.uint32(4)) & np.uint32(0x0F0F0F0F))
    x = ((x & np.uint32(0x00FF00FF)) << np.uint32(8)) | ((x >> np.uint32(8)) & np.uint32(0x00FF00FF))
    return np.uint32((x << np.uint32(16)) | (x >> np.uint32(16)))


@lane_kernel
def mix_upwards(x, seed):
    """A hash of a uint32 in which each bit depends on lower ones only: Owen scrambling of reversed bits (Burley)."""
    x = np.uint32(x + seed)
    x = np.uint32(x ^ np.uint32(x * np.uint32(0x6C50B47C)))
    x = np.uint32(x ^ np.uint32(x * np.uint32(0xB82F1E52)))
    x = np.uint32(x ^ np.uint32(x * np.uint32(0xC7AFE638)))
    return np.uint32(x ^ np.uint32(x * np.uint32(0x8D22F6E6)))


@lane_kernel
def pascal(x):
    """The generator matrix of Sobol's second dimension times a uint32: bit k is the parity of bits j whose number holds
    all bits of k (Pascal's triangle modulo 2), by five butterflies."""
    x = x ^ ((x >> np.uint32(1)) & np.uint32(0x55555555))
    x = x ^ ((x >> np.uint32(2)) & np.uint32(0x33333333))
    x = x ^ ((x >> np.uint32(4)) & np.uint32(0x0F0F0F0F))
    x = x ^ ((x >> np.uint32(8)) & np.uint32(0x00FF00FF))
    return np.uint32(x ^ ((x >> np.uint32(16)) & np.uint32(0x0000FFFF)))


@lane_kernel
def random_pair(key, number, pair):
    """Two float32 in [0, 1) of a pixel's sample; pairs of dimensions are independent of each other.

    key : uint32, of the pixel; number : uint32, of the sample; pair : int, a uint32 in loops that are to be vectors
    """
    seed = hash_uint32(key, np.uint32(pair))
    index = reverse_bits(mix_upwards(reverse_bits(np.uint32(number)), seed))
    x = reverse_bits(mix_upwards(index, hash_uint32(seed, np.uint32(1))))
    y = reverse_bits(mix_upwards(pascal(index), hash_uint32(seed, np.uint32(2))))
    return np.float32(x >> np.uint32(8)) * UNIT, np.float32(y >> np.uint32(8)) * UNIT
