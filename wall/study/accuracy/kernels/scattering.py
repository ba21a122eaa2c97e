"""Calls what scatters light with random arguments, ends of ranges among them, and counts answers that cannot be.

Paths hide some of these: what weighs no number counts as black there.
"""

from __future__ import annotations

import math

import numpy as np

from wall.core.jit import inline_kernel, kernel
from wall.core.kernels.hashing import hash_uint32
from wall.tracing.kernels import glass, opaque, thin_glass
from wall.tracing.kernels.facet_walk import uniform
from wall.tracing.kernels.ggx import TWO_PI
from wall.tracing.kernels.values import INF, ONE, ZERO

LARGEST = np.float32(1.0 - 2.0**-24)  # random number
FLATTEST = np.float32(1e-3)  # cosine that scatter.py lets through
UNIT_ERROR = np.float32(1e-3)  # of a direction's length; along the surface the eye's is as far off
NUMBERS = 16  # random ones of a call


@kernel
def count_bad(table, interface, first, count):
    """Scatters light `count` times, by the materials in turn, as opaque, as solid and as thin glass.

    table : (k,) MATERIAL; interface : see opaque.interface_albedo; first : int, of the calls
    Returns how often a weight is negative or no number, a density is none, or a direction is not of length 1.
    """
    bad = 0
    for call in range(first, first + count):
        material, seed = table[call % table.shape[0]], hash_uint32(np.uint32(call), np.uint32(call >> 32))
        color, rough, ior = material["base_color"], material["roughness"], material["ior"]
        albedo, out, to = (color[0], color[1], color[2]), direction(seed, 0), direction(seed, 3)
        numbers = number(seed, 6), number(seed, 7), number(seed, 8)
        look = opaque.look_of(material, material["metallic"], rough, albedo, out[2], interface)
        if seed & 3 == 0:
            to = -out[0], -out[1], out[2]  # where highlights are
        r, g, b, density = opaque.evaluate(look, out, to)
        bad += wrong(to, (r, g, b), density)
        way, weight, density = opaque.sample(look, out, numbers[0], numbers[1], numbers[2])
        bad += wrong(way, weight, max(density, ZERO) if density == density else density)
        eta = ior if seed & 4 == 0 else ONE / ior
        way, weight = glass.sample(albedo, eta, rough, out, numbers, hash_uint32(seed, np.uint32(9)))
        bad += wrong(way, weight, ONE)
        way, weight = thin_glass.sample(albedo, ior, rough, interface, out, numbers[0], numbers[1], numbers[2])
        bad += wrong(way, weight, ONE)
    return bad


@inline_kernel
def wrong(way, weight, density):
    """1 where a unit direction, a weight, RGB, or a density cannot be, else 0."""
    r, g, b = weight
    right = min(r, g, b) >= ZERO and r + g + b < INF and ZERO <= density < INF
    square = way[0] * way[0] + way[1] * way[1] + way[2] * way[2]
    return 0 if right and abs(square - ONE) < UNIT_ERROR else 1


@inline_kernel
def number(seed, k):
    """The k-th random number of a seed, in [0, 1), as often as one in eight at an end."""
    ends = hash_uint32(seed, np.uint32(k + NUMBERS)) & np.uint32(15)
    return ZERO if ends == 0 else LARGEST if ends == 1 else uniform(seed, k)


@inline_kernel
def direction(seed, k):
    """A unit direction with z of FLATTEST or more, of three random numbers from the k-th on: one in four is flat."""
    high, flat = number(seed, k), uniform(seed, k + 2) < np.float32(0.25)
    z = max(high * np.float32(0.01) if flat else high, FLATTEST)
    size, turn = math.sqrt(ONE - z * z), number(seed, k + 1) * TWO_PI
    return size * math.cos(turn), size * math.sin(turn), z
