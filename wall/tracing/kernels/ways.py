"""The ways from what paths hit to lights that have no area: points, spots and directions.

Each takes a row of Lights and a lane, and gives the way (dx, dy, dz), one over its length, the factor of the light's
irradiance or intensity, and where along the way its shadow ray ends.
"""

from __future__ import annotations

import math

from wall.core.jit import inline_kernel
from wall.tracing.kernels import rows
from wall.tracing.kernels.lights import end_before, spot_share
from wall.tracing.kernels.rows import xyz
from wall.tracing.kernels.values import INF, ONE


@inline_kernel
def way_to_directional(light, lane, work):
    """To a light infinitely far away."""
    return light[0], light[1], light[2], ONE, ONE, INF


@inline_kernel
def way_to_point(light, lane, work):
    """To a point light; its shadow ray ends an offset before it."""
    p = work.packet
    px, py, pz = xyz(p, rows.POSITION_X, lane)
    dx, dy, dz = light[0] - px, light[1] - py, light[2] - pz
    scale = ONE / math.sqrt(dx * dx + dy * dy + dz * dz)
    reach = abs(light[0]) + abs(light[1]) + abs(light[2])
    return dx, dy, dz, scale, scale * scale, end_before(p, reach, scale, lane)


@inline_kernel
def way_to_spot(light, lane, work):
    """To a spot light, as to a point light; its factor is 0 outside its cone."""
    dx, dy, dz, scale, share, far = way_to_point(light, lane, work)
    return dx, dy, dz, scale, share * spot_share(light, dx * scale, dy * scale, dz * scale), far
