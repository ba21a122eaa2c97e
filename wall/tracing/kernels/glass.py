"""Glass: a rough or smooth interface between two media, which reflects and refracts; each path takes one of both ways.
What lies behind an interface may absorb.

B. Walter et al., "Microfacet Models for Refraction through Rough Surfaces", EGSR 2007; facets are sampled as for metal.
Radiance scales with the square of the refractive index, so what enters a denser medium is weighed by 1 / eta^2.
"""

from __future__ import annotations

import math

import numpy as np

from wall.core.jit import inline_kernel
from wall.tracing.kernels import rows
from wall.tracing.kernels.cuts import way_left
from wall.tracing.kernels.ggx import FLATTEST_ROUGHNESS, sample_facet, slope_loss
from wall.tracing.kernels.surface import material_of, seen_from_inside
from wall.tracing.kernels.values import ONE, ZERO

HALF, TWO = np.float32(0.5), np.float32(2.0)


@inline_kernel
def fresnel(cosine, eta):
    """Reflectance of unpolarised light and the cosine on the other side, 0 at total reflection.

    cosine : > 0, to the normal, on the side where it comes from; eta : index of the other side over that of this one
    """
    square = ONE - (ONE - cosine * cosine) / (eta * eta)
    if square <= ZERO:
        return ONE, ZERO
    other = math.sqrt(square)
    across, along = (cosine - eta * other) / (cosine + eta * other), (eta * cosine - other) / (eta * cosine + other)
    return HALF * (across * across + along * along), other


@inline_kernel
def sample(albedo, eta, roughness, out, choice, u, v):
    """A direction (z < 0: through the surface) and its weight, RGB.

    albedo : RGB tuple, what is left of light on either way; eta : index behind the surface over that before it
    out : unit vector back along the ray, in the frame of the shading normal, z > 0; choice, u, v : in [0, 1)
    """
    rough = roughness >= FLATTEST_ROUGHNESS
    alpha = roughness * roughness
    hx, hy, hz = ZERO, ZERO, ONE
    if rough:
        hx, hy, hz = sample_facet(out[0], out[1], out[2], alpha, u, v)
    facing = out[0] * hx + out[1] * hy + out[2] * hz
    reflected, other = fresnel(facing, eta)
    if choice < reflected:
        turn, scale, weight = TWO * facing, -ONE, ONE
    else:
        turn, scale, weight = facing / eta - other, -ONE / eta, ONE / (eta * eta)
    to = (turn * hx + scale * out[0], turn * hy + scale * out[1], turn * hz + scale * out[2])
    if (to[2] > ZERO) != (choice < reflected):
        return to, (ZERO, ZERO, ZERO)
    if rough:  # shadowing towards the light, given that of the eye's side
        seen = slope_loss(out[2], alpha)
        weight *= (ONE + seen) / (ONE + seen + slope_loss(abs(to[2]), alpha))
    return to, (weight * albedo[0], weight * albedo[1], weight * albedo[2])


@inline_kernel
def absorb(used, placements, table, work):
    """Takes from each lane's path what glass absorbed on the way to where the ray hits it from inside (Beer-Lambert).

    Directions are unit vectors.
    used : Materials.absorbs, None does nothing; placements : see Meshes; table : (k,) MATERIAL
    """
    if used is not None:
        p = work.packet
        for lane in range(16):
            if p[rows.HIT + lane] == ZERO:
                continue
            taken, way = material_of(table, lane, work)["absorption"], way_left(work.cuts, lane, p)
            if max(taken[0], taken[1], taken[2]) > ZERO and seen_from_inside(placements, lane, work):
                p[rows.THROUGHPUT_R + lane] *= math.exp(-taken[0] * way)
                p[rows.THROUGHPUT_G + lane] *= math.exp(-taken[1] * way)
                p[rows.THROUGHPUT_B + lane] *= math.exp(-taken[2] * way)
