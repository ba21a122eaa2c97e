"""Radiance as a display gets it."""

from __future__ import annotations

import numpy as np

from wall.core.data import Float32


def display(radiance: Float32) -> Float32:
    """sRGB, 0..1; IEC 61966-2-1."""
    clipped = np.clip(radiance, 0.0, 1.0)
    shown: Float32 = np.where(clipped <= 0.0031308, 12.92 * clipped, 1.055 * clipped ** (1 / 2.4) - 0.055)
    return shown
