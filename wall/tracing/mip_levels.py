"""Mip levels of textures: each texel is the mean of what it covers in the level before."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wall.core.colour import srgb_decoded, srgb_encoded
from wall.core.data import Float64


def mip_levels(texels: NDArray[np.uint8], *, linear: bool = False) -> NDArray[np.uint8]:
    """(p, 3) texels of (h, w, 3) and of its mip levels, each half as wide and high, rounded down, to one texel.

    A level's texel is the mean of what it covers in the level before; of sRGB texels, those not `linear`, in light.
    """
    of_byte = np.arange(256) / 255.0
    levels, values = [texels.reshape(-1, 3)], (of_byte if linear else srgb_decoded(of_byte))[texels]
    while values.shape[:2] != (1, 1):
        values = _halved(_halved(values).swapaxes(0, 1)).swapaxes(0, 1)
        level = values if linear else srgb_encoded(values)
        levels.append(np.round(level * 255.0).astype(np.uint8).reshape(-1, 3))
    return np.concatenate(levels)


def _halved(rows: Float64) -> Float64:
    """Means of rows (n, ...), half as many, rounded down, each of the same share of the n."""
    n, half = len(rows), max(1, len(rows) // 2)
    if n == 2 * half:
        return 0.5 * (rows[::2] + rows[1::2])
    edges = np.arange(half + 1) * (n / half)
    whole = np.minimum(edges.astype(np.int64), n - 1)
    sums = np.concatenate([np.zeros_like(rows[:1]), np.cumsum(rows, axis=0)])
    at_edges = sums[whole] + (edges - whole).reshape(-1, *[1] * (rows.ndim - 1)) * rows[whole]
    return np.diff(at_edges, axis=0) * (half / n)
