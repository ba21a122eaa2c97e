"""Linear radiance to 8-bit sRGB, only where it changed."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wall.colour import srgb_encoded
from wall.data import Float32
from wall.reconstruction import kernels


def srgb_curve() -> NDArray[np.uint8]:
    """(4097,) uint8: the sRGB code (IEC 61966-2-1) of linear light (k / 4096)^2.

    Looking up the nearest k is at most one code from the exact rounding: the curve moves 0.08 codes a step at most.
    """
    linear = (np.arange(kernels.CURVE_STEPS + 1) / kernels.CURVE_STEPS) ** 2
    return np.round(srgb_encoded(linear) * 255).astype(np.uint8)


_CURVE = srgb_curve()


def update_display(radiance: Float32, dirty: NDArray[np.bool_], tile: int, rgb: NDArray[np.uint8]) -> int:
    """Redo the dirty tiles of `rgb` (h, w, 3) uint8 from `radiance` (h, w, 3) float32; returns pixels redone."""
    return int(kernels.display_tiles(radiance, dirty, tile, _CURVE, rgb))
