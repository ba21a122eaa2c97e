"""Thin glass: a sheet whose two surfaces are one place to everything else; light goes straight on, or is mirrored.

What one surface reflects goes to and fro between both: 2 R / (1 + R) comes back in all, the rest is tinted and goes on.
Rough sheets blur light about the straight way by the lobe of rough reflection, seen through the sheet
(KHR_materials_transmission). Light that microfacets lose between each other is given back as for metal (opaque.py).
"""

from __future__ import annotations

import numpy as np

from wall.core.jit import inline_kernel
from wall.tracing.kernels.facet_walk import fresnel
from wall.tracing.kernels.ggx import FLATTEST_ROUGHNESS, sample_facet, slope_loss
from wall.tracing.kernels.opaque import interface_albedo
from wall.tracing.kernels.values import ONE, ZERO

TWO = np.float32(2.0)


@inline_kernel
def sample(albedo, ior, roughness, table, out, choice, u, v):
    """A direction (z < 0: through the sheet) and its weight, RGB.

    albedo : RGB tuple, what is left of light that passes; table : see opaque.interface_albedo
    out : unit vector back along the ray, in the frame of the shading normal, z > 0; choice, u, v : in [0, 1)
    """
    hx, hy, hz = ZERO, ZERO, ONE
    rough = roughness >= FLATTEST_ROUGHNESS
    if rough:
        hx, hy, hz = sample_facet(out[0], out[1], out[2], roughness * roughness, u, v)
    facing = out[0] * hx + out[1] * hy + out[2] * hz
    x, y, z = TWO * facing * hx - out[0], TWO * facing * hy - out[1], TWO * facing * hz - out[2]
    weight = ONE
    if rough:
        if z <= ZERO:
            return (x, y, z), (ZERO, ZERO, ZERO)
        seen, (first, rest) = slope_loss(out[2], roughness * roughness), interface_albedo(table, out[2], roughness)
        weight = (ONE + seen) / ((ONE + seen + slope_loss(z, roughness * roughness)) * (first + rest))
    once, _ = fresnel(facing, ior)
    if choice < TWO * once / (ONE + once):
        return (x, y, z), (weight, weight, weight)
    return (x, y, -z), (weight * albedo[0], weight * albedo[1], weight * albedo[2])
