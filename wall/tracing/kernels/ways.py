"""The ways from what paths hit to lights that no ray finds by itself: points, spots, directions and suns.

Each takes a row of Lights and a lane, and gives the way (dx, dy, dz), one over its length, the factor of the light's
irradiance or intensity, and where along the way its shadow ray ends.
"""

from __future__ import annotations

import math

import numpy as np

from wall.core.jit import lane_kernel
from wall.tracing.kernels import rows
from wall.tracing.kernels.ggx import frame_of, on_circle
from wall.tracing.kernels.lights import DIRECTIONAL, POINT, end_before, spot_share
from wall.tracing.kernels.rows import xyz
from wall.tracing.kernels.values import INF, ONE

TWO = np.float32(2.0)
SUN = 3  # a kind of lights, beside lights.DIRECTIONAL, POINT and SPOT


@lane_kernel
def way_to(kind, light, lane, work):
    """To a light of a kind that is known when this is compiled."""
    if kind == DIRECTIONAL:
        return way_to_directional(light)
    if kind == SUN:
        return way_to_sun(light, lane, work)
    if kind == POINT:
        return way_to_point(light, lane, work)
    return way_to_spot(light, lane, work)


@lane_kernel
def way_to_directional(light):
    """To a light infinitely far away."""
    return light[0], light[1], light[2], ONE, ONE, INF


@lane_kernel
def way_to_sun(light, lane, work):
    """To a point of a distant disc, chosen evenly by solid angle with the random numbers LIGHT_U and LIGHT_V.

    A disc of radius a and radiance L gives a surface that faces it L pi sin^2 a, and each way stands for all of its
    2 pi (1 - cos a): by that irradiance the factor is 2 / (1 + cos a).
    """
    p, cap = work.packet, light[6]
    low, (across, along) = p[rows.LIGHT_U + lane] * cap, on_circle(p[rows.LIGHT_V + lane])
    sine = math.sqrt(low * (TWO - low))
    s, t = frame_of(light[0], light[1], light[2])
    a, b, c = sine * across, sine * along, ONE - low
    x, y, z = a * s[0] + b * t[0], a * s[1] + b * t[1], a * s[2] + b * t[2]
    return x + c * light[0], y + c * light[1], z + c * light[2], ONE, TWO / (TWO - cap), INF


@lane_kernel
def way_to_point(light, lane, work):
    """To a point light; its shadow ray ends an offset before it."""
    p = work.packet
    px, py, pz = xyz(p, rows.POSITION_X, lane)
    dx, dy, dz = light[0] - px, light[1] - py, light[2] - pz
    scale = ONE / math.sqrt(dx * dx + dy * dy + dz * dz)
    reach = abs(light[0]) + abs(light[1]) + abs(light[2])
    return dx, dy, dz, scale, scale * scale, end_before(p, reach, scale, lane)


@lane_kernel
def way_to_spot(light, lane, work):
    """To a spot light, as to a point light; its factor is 0 outside its cone."""
    dx, dy, dz, scale, share, far = way_to_point(light, lane, work)
    return dx, dy, dz, scale, share * spot_share(light, dx * scale, dy * scale, dz * scale), far
