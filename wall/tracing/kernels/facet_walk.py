"""Light between the microfacets of rough glass: a random walk from facet to facet until it leaves them, on either side.

Each facet reflects or refracts, and nothing is lost between them: all light leaves. What meets one facet alone is the
rough dielectric of Walter et al. (2007), with shadowing by the facets' height. E. Heitz et al., "Multiple-Scattering
Microfacet BSDFs with the Smith Model", SIGGRAPH 2016. Facets lie at random heights; in place of its height light has a
depth, -log of the share of facets that lie lower: free ways between facets are exponential in it, as in a medium.
"""

from __future__ import annotations

import math

import numpy as np

from wall.core.jit import inline_kernel
from wall.core.kernels.hashing import hash_uint32
from wall.tracing.kernels.ggx import sample_facet, slope_loss
from wall.tracing.kernels.random_numbers import UNIT
from wall.tracing.kernels.values import ONE, ZERO

HALF, TWO = np.float32(0.5), np.float32(2.0)
MOST_FACETS = 32  # of a walk: of 10^7 none met more than 18 at indices of 1.5 to 3; near 1 facets hardly turn light
FLATTEST = np.float32(1e-6)  # cosine of a way to the surface: below, its facets hide all but the next one anyway
TINY = np.float32(1e-7)


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
def walk(out, eta, alpha, numbers, seed):
    """The unit direction in which light leaves, z < 0: behind the surface, and how many facets it met.

    out, eta : see glass.sample; alpha : roughness squared
    numbers : of the first facet, in [0, 1): reflect or refract, two for its normal; seed : uint32, for all others
    """
    choice, u, v = numbers
    x, y, z, behind = -out[0], -out[1], -out[2], False  # the way, in the frame of the side it is on: z away from it
    depth = exponential(seed, 0) / (ONE + slope_loss(out[2], alpha))
    for k in range(MOST_FACETS):
        hx, hy, hz = sample_facet(-x, -y, -z, alpha, u, v)
        facing = max(-(x * hx + y * hy + z * hz), TINY)
        reflected, other = fresnel(facing, eta)
        if choice < reflected:
            x, y, z = x + TWO * facing * hx, y + TWO * facing * hy, z + TWO * facing * hz
        else:
            turn = facing / eta - other
            x, y, z = turn * hx + x / eta, turn * hy + y / eta, -(turn * hz + z / eta)
            eta, behind = ONE / eta, not behind
            depth = -math.log(max(ONE - math.exp(-depth), TINY))
        size = ONE / math.sqrt(x * x + y * y + z * z)
        x, y, z = x * size, y * size, z * size
        free, loss = exponential(seed, 4 * k + 1), slope_loss(max(abs(z), FLATTEST), alpha)
        if z <= ZERO:
            depth += free / (ONE + loss)
        elif loss * depth <= free:
            return (x, y, -z if behind else z), k + 1
        else:
            depth = max(depth - free / loss, ZERO)
        choice, u, v = uniform(seed, 4 * k + 2), uniform(seed, 4 * k + 3), uniform(seed, 4 * k + 4)
    return (x, y, -z if behind else z), MOST_FACETS  # it leaves as it goes, so that none is lost


@inline_kernel
def uniform(seed, number):
    """One of a seed's random numbers, in [0, 1)."""
    return np.float32(hash_uint32(seed, np.uint32(number)) >> np.uint32(8)) * UNIT


@inline_kernel
def exponential(seed, number):
    """One of a seed's random numbers, of mean 1 and at most 17."""
    return -math.log(ONE - uniform(seed, number))
