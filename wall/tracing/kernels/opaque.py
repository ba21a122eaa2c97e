"""Opaque surfaces by metalness and roughness (glTF 2.0): diffuse light below a rough interface, or rough metal.

The interface reflects F0 = ((ior - 1) / (ior + 1))^2 times `specular` from above, the base colour where it is metal,
and more at grazing angles (Schlick). Light that microfacets lose between each other is given back in the colour that it
would have (E. Turquin, "Practical multiple scattering compensation for microfacet models", 2019), and diffuse light
gets what the interface leaves, so that a white surface loses nothing. Both need the interface's albedo, a table.
"""

from __future__ import annotations

import math

import numpy as np

from wall.core.jit import lane_kernel
from wall.tracing.kernels.ggx import (
    FLATTEST_ROUGHNESS,
    by_cosine,
    facet_density,
    sample_facet,
    schlick,
    slope_loss,
)
from wall.tracing.kernels.values import INV_PI, ONE, ZERO

TWO, FOUR = np.float32(2.0), np.float32(4.0)
TINY = np.float32(1e-20)
LEAST_CHANCE = np.float32(1.0 / 16.0)  # of the interface: highlights of lights are bright, however little it reflects


@lane_kernel
def interface_albedo(table, cosine, roughness):
    """A, B of A F0 + B F90, what a rough interface reflects in all: bilinear in a table (r, c, 2) over roughness and
    cosine, both 0..1."""
    x, y = min(cosine, ONE) * (table.shape[1] - 1), min(roughness, ONE) * (table.shape[0] - 1)
    i, j = max(min(int(x), table.shape[1] - 2), 0), max(min(int(y), table.shape[0] - 2), 0)
    fx, fy = np.float32(x - i), np.float32(y - j)
    a0 = table[j, i, 0] + fx * (table[j, i + 1, 0] - table[j, i, 0])
    a1 = table[j + 1, i, 0] + fx * (table[j + 1, i + 1, 0] - table[j + 1, i, 0])
    b0 = table[j, i, 1] + fx * (table[j, i + 1, 1] - table[j, i, 1])
    b1 = table[j + 1, i, 1] + fx * (table[j + 1, i + 1, 1] - table[j + 1, i, 1])
    return a0 + fy * (a1 - a0), b0 + fy * (b1 - b0)


@lane_kernel
def look_of(material, metal, rough, albedo, cosine, table):
    """How an opaque surface shares light out, seen at a cosine: (diffuse RGB, F0 RGB, F90, compensation RGB, roughness,
    probability of the interface when sampling).

    metal, rough : metalness and roughness; albedo : base colour, RGB tuple; all with their textures
    table : see interface_albedo; None where no surface has an interface
    """
    r, g, b = albedo
    specular = material["specular"]
    white = ONE, ONE, ONE
    if table is None:
        return albedo, white, ZERO, white, rough, ZERO
    edge = (material["ior"] - ONE) / (material["ior"] + ONE)
    plain = specular * edge * edge
    f90 = specular + metal * (ONE - specular)
    f0 = (plain + metal * (r - plain), plain + metal * (g - plain), plain + metal * (b - plain))
    if f90 <= ZERO:
        return albedo, f0, f90, white, rough, ZERO
    first, rest = interface_albedo(table, cosine, max(rough, FLATTEST_ROUGHNESS))
    lost = ONE / (first + rest) - ONE
    coat = (plain * first + specular * rest) * (ONE + plain * lost)
    left = (ONE - metal) * (ONE - coat)
    diffuse = (left * r, left * g, left * b)
    coat, rest = (ONE - metal) * coat, max(rest, TINY)
    back = (
        (coat + metal * (r * first + rest) * (ONE + r * lost)) / (f0[0] * first + f90 * rest),
        (coat + metal * (g * first + rest) * (ONE + g * lost)) / (f0[1] * first + f90 * rest),
        (coat + metal * (b * first + rest) * (ONE + b * lost)) / (f0[2] * first + f90 * rest),
    )
    shown = (
        (f0[0] * first + f90 * rest) * back[0]
        + (f0[1] * first + f90 * rest) * back[1]
        + (f0[2] * first + f90 * rest) * back[2]
    )
    below = diffuse[0] + diffuse[1] + diffuse[2]
    chance = max(shown / max(shown + below, TINY), LEAST_CHANCE)
    return diffuse, f0, f90, back, rough, chance if below > ZERO else ONE


@lane_kernel
def evaluate(look, out, to):
    """BSDF times the cosine of the incoming direction, RGB, and the density of `sample` for it; not what is mirrored.

    out, to : unit vectors back along the ray and towards the light, in the frame of the shading normal, both with z > 0
    """
    diffuse, f0, f90, back, rough, chance = look
    cosine = to[2] * INV_PI
    density = (ONE - chance) * cosine
    r, g, b = diffuse[0] * cosine, diffuse[1] * cosine, diffuse[2] * cosine
    if chance > ZERO and rough >= FLATTEST_ROUGHNESS:
        alpha = rough * rough
        hx, hy, hz = out[0] + to[0], out[1] + to[1], out[2] + to[2]
        square = ONE / (hx * hx + hy * hy + hz * hz)
        size = math.sqrt(square)
        facets = facet_density(hz * size, (hx * hx + hy * hy) * square, alpha)
        seen, lit = slope_loss(out[2], alpha), slope_loss(to[2], alpha)
        value = facets / ((ONE + seen + lit) * FOUR * out[2])
        grazing = schlick((out[0] * hx + out[1] * hy + out[2] * hz) * size)
        r += value * (f0[0] + (f90 - f0[0]) * grazing) * back[0]
        g += value * (f0[1] + (f90 - f0[1]) * grazing) * back[1]
        b += value * (f0[2] + (f90 - f0[2]) * grazing) * back[2]
        density += chance * facets / ((ONE + seen) * FOUR * out[2])
    return r, g, b, density


@lane_kernel
def sample(look, out, choice, u, v):
    """A direction, the BSDF times its cosine over its density, RGB, and the density; -1 where it is mirrored.

    choice, u, v : random numbers in [0, 1); a direction below the surface has z <= 0, and weighs nothing
    """
    _, f0, f90, _, rough, chance = look
    if choice < chance:
        if rough < FLATTEST_ROUGHNESS:
            grazing, share = schlick(out[2]), ONE / chance
            r, g, b = (
                f0[0] + (f90 - f0[0]) * grazing,
                f0[1] + (f90 - f0[1]) * grazing,
                f0[2] + (f90 - f0[2]) * grazing,
            )
            return (-out[0], -out[1], out[2]), (r * share, g * share, b * share), -ONE
        hx, hy, hz = sample_facet(out[0], out[1], out[2], rough * rough, u, v)
        turn = TWO * (out[0] * hx + out[1] * hy + out[2] * hz)
        to = (turn * hx - out[0], turn * hy - out[1], turn * hz - out[2])
    else:
        to = by_cosine(u, v)
    if to[2] <= ZERO:
        return to, (ZERO, ZERO, ZERO), ZERO
    r, g, b, density = evaluate(look, out, to)
    share = ONE / density if density > ZERO else ZERO
    return to, (r * share, g * share, b * share), density
