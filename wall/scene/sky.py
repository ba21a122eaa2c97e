"""The sky's irradiance by normal, for the tracer and for relighting."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np

from wall.core.data import Float32
from wall.scene.model import Sky

SKIES = 16  # of which the table is kept: the same object, so that users see that nothing changed
SKY_STEPS = 256  # of the table; kernels see it as a constant


@lru_cache(SKIES)
def sky_irradiance(sky: Sky) -> Float32:
    """Irradiance of the gradient sky over pi, by height c of the normal from -1 to 1; (SKY_STEPS + 1, 3).

    The sky is L(d) = horizon + (zenith - horizon) max(d.y, 0) + (ground - horizon) max(-d.y, 0). With theta the
    normal's angle from up, the integral of max(up.d, 0) max(n.d, 0) over all directions is the arc-cosine kernel
    2/3 (sin theta + (pi - theta) cos theta) (Cho and Saul 2009, order 1, in three dimensions). Linear lookup in
    this table is within 1e-4 of it. Not to be written to.
    """
    height = np.linspace(-1.0, 1.0, SKY_STEPS + 1)
    theta, sine = np.arccos(height), np.sqrt(1.0 - height**2)
    above = 2 / 3 * (sine + (math.pi - theta) * height)[:, None]
    below = 2 / 3 * (sine - theta * height)[:, None]
    zenith, horizon, ground = (np.array(c, np.float64) for c in (sky.zenith, sky.horizon, sky.ground))
    irradiance = math.pi * horizon + above * (zenith - horizon) + below * (ground - horizon)
    return (irradiance / math.pi).astype(np.float32)
