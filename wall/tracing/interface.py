"""What rough interfaces reflect of white light, as a table for kernels."""

from __future__ import annotations

from functools import cache

import numpy as np

from wall.core.data import Float32, Float64

ROUGHNESSES, COSINES = 64, 64  # of the table, each from 0 to 1
POINTS = 1024  # facets of each entry, along the R2 sequence
SMALLEST_COSINE = 1e-3
SMOOTHEST = 0.01  # roughness; smoother ones are as this


@cache
def interface_table() -> Float32:
    """(ROUGHNESSES, COSINES, 2) A and B: a GGX interface reflects A F0 + B F90 (Schlick) of light from everywhere.

    Means over visible facets of the light that is not shadowed on its way in, and of its share in (1 - cosine)^5; a
    1,024th of the light is the error of each. Karis, "Real Shading in Unreal Engine 4", 2013.
    """
    alphas = np.maximum(np.linspace(0.0, 1.0, ROUGHNESSES), SMOOTHEST) ** 2
    rows = [_row(float(alpha)) for alpha in alphas]
    return np.stack(rows).astype(np.float32)


def _row(alpha: float) -> Float64:
    """(COSINES, 2) of one roughness."""
    k = np.arange(POINTS)
    u, v = (0.5 + k * 0.7548776662466927) % 1.0, (0.5 + k * 0.5698402909980532) % 1.0
    cosine = np.maximum(np.linspace(0.0, 1.0, COSINES), SMALLEST_COSINE)[:, None]
    sine = np.sqrt(1.0 - cosine**2)
    size = np.sqrt((alpha * sine) ** 2 + cosine**2)
    sx, sz = alpha * sine / size, cosine / size
    cz = (1.0 - v) * (1.0 + sz) - sz
    ring = np.sqrt(np.maximum(1.0 - cz**2, 0.0))
    hx, hy, hz = alpha * (ring * np.cos(2 * np.pi * u) + sx), alpha * ring * np.sin(2 * np.pi * u), cz + sz
    size = np.sqrt(hx**2 + hy**2 + hz**2)
    facing = (sine * hx + cosine * hz) / size
    out = 2.0 * facing * hz / size - cosine  # cosine of the reflected direction
    lit = out > 0.0
    seen, shadowed = 1.0 + _loss(cosine, alpha), _loss(np.where(lit, out, 1.0), alpha)
    weight = np.where(lit, seen / (seen + shadowed), 0.0)
    grazing = (1.0 - np.clip(facing, 0.0, 1.0)) ** 5
    return np.stack([(weight * (1.0 - grazing)).mean(axis=1), (weight * grazing).mean(axis=1)], axis=-1)


def _loss(cosine: Float64, alpha: float) -> Float64:
    """Smith's Lambda."""
    return 0.5 * (np.sqrt(1.0 + alpha**2 * (1.0 - cosine**2) / cosine**2) - 1.0)
