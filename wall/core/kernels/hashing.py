"""Hashes that random numbers are made of."""

from __future__ import annotations

import numpy as np

from wall.core.jit import lane_kernel


@lane_kernel
def hash_uint32(a, b):
    """A well-mixed 32-bit hash of two 32-bit numbers (xxHash32's constants and avalanche; Y. Collet)."""
    h = np.uint32(np.uint32(a) * np.uint32(2654435761) + np.uint32(374761393))
    h = np.uint32(h ^ np.uint32(b))
    h = np.uint32(h * np.uint32(2246822519))
    h = np.uint32(h ^ (h >> np.uint32(15)))
    h = np.uint32(h * np.uint32(3266489917))
    h = np.uint32(h ^ (h >> np.uint32(13)))
    h = np.uint32(h * np.uint32(668265263))
    return np.uint32(h ^ (h >> np.uint32(16)))
