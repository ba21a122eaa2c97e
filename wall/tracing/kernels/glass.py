"""Glass: a rough or smooth interface between two media, which reflects and refracts; each path takes one of both ways.
What lies behind an interface may absorb.

Rough glass is a random walk between microfacets, facet_walk.py, which loses no light, and has no density: nothing is
aimed at through it. Its colour counts once, however many facets light meets. Radiance scales with the square of the
refractive index, so what enters a denser medium is weighed by 1 / eta^2.
"""

from __future__ import annotations

import math

from wall.core.jit import inline_kernel
from wall.tracing.kernels import rows
from wall.tracing.kernels.cuts import way_left
from wall.tracing.kernels.facet_walk import fresnel, walk
from wall.tracing.kernels.ggx import FLATTEST_ROUGHNESS
from wall.tracing.kernels.surface import material_of, seen_from_inside
from wall.tracing.kernels.values import ONE, ZERO


@inline_kernel
def sample(albedo, eta, roughness, out, numbers, seed):
    """A direction (z < 0: through the surface) and its weight, RGB.

    albedo : RGB tuple, what is left of light on either way; eta : index behind the surface over that before it
    out : unit vector back along the ray, in the frame of the shading normal, z > 0
    numbers : three in [0, 1): reflect or refract, two of a facet; seed : uint32, for all facets after the first
    """
    if roughness >= FLATTEST_ROUGHNESS:
        to, _ = walk(out, eta, roughness * roughness, numbers, seed)
        weight = ONE if to[2] > ZERO else ONE / (eta * eta)
    else:
        reflected, other = fresnel(out[2], eta)
        if numbers[0] < reflected:
            to, weight = (-out[0], -out[1], out[2]), ONE
        else:
            scale, turn = -ONE / eta, out[2] / eta - other
            to = scale * out[0], scale * out[1], turn + scale * out[2]
            weight = ONE / (eta * eta) if to[2] <= ZERO else ZERO
    return to, (weight * albedo[0], weight * albedo[1], weight * albedo[2])


@inline_kernel
def absorb(used, cuts, placements, table, work):
    """Takes from each lane's path what glass absorbed on the way to where the ray hits it from inside (Beer-Lambert).

    Directions are unit vectors.
    used : Materials.absorbs, None does nothing; cuts : Trees.cuts; placements : see Meshes; table : (k,) MATERIAL
    """
    if used is not None:
        p = work.packet
        for lane in range(16):
            if p[rows.HIT + lane] == ZERO:
                continue
            taken, way = material_of(table, lane, work)["absorption"], way_left(cuts, lane, p)
            if max(taken[0], taken[1], taken[2]) > ZERO and seen_from_inside(placements, lane, work):
                p[rows.THROUGHPUT_R + lane] *= math.exp(-taken[0] * way)
                p[rows.THROUGHPUT_G + lane] *= math.exp(-taken[1] * way)
                p[rows.THROUGHPUT_B + lane] *= math.exp(-taken[2] * way)
