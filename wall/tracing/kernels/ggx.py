"""The GGX distribution of microfacets: density, shadowing, and sampling of the visible normals.

B. Walter et al., "Microfacet Models for Refraction through Rough Surfaces", EGSR 2007; E. Heitz, "Understanding the
Masking-Shadowing Function", JCGT 2014; J. Dupuy and A. Benyoub, "Sampling Visible GGX Normals with Spherical Caps",
2023.
Cosines are to the shading normal, directions in its frame are (x, y, z) with z along it.
"""

from __future__ import annotations

import math

import numpy as np

from wall.core.jit import lane_kernel
from wall.tracing.kernels.values import INV_PI, ONE, ZERO

FLATTEST_ROUGHNESS = np.float32(0.02)  # a smoother surface counts as perfectly smooth
TWO_PI = np.float32(2.0 * math.pi)
HALF, QUARTER = np.float32(0.5), np.float32(0.25)
TWO, THREE, FOUR = np.float32(2.0), np.float32(3.0), np.float32(4.0)
SINE_3, SINE_5, SINE_7, SINE_9 = (np.float32(s / math.factorial(k)) for k, s in ((3, -1), (5, 1), (7, -1), (9, 1)))
COSINE_4, COSINE_6, COSINE_8 = (np.float32(s / math.factorial(k)) for k, s in ((4, 1), (6, -1), (8, 1)))


@lane_kernel
def on_circle(turn):
    """Cosine and sine of so many whole turns, 0 to 1, each within 1.5e-7: Taylor's series about the nearest quarter.

    Loops over lanes become vectors with it, which they do not with the functions of math.
    """
    quarter = np.float32(np.int32(FOUR * turn + HALF))
    x = TWO_PI * (turn - QUARTER * quarter)
    square = x * x
    sine = x + x * square * (SINE_3 + square * (SINE_5 + square * (SINE_7 + square * SINE_9)))
    cosine = ONE + square * (-HALF + square * (COSINE_4 + square * (COSINE_6 + square * COSINE_8)))
    odd, second, third = (quarter == ONE) | (quarter == THREE), quarter == TWO, quarter == THREE
    a, b = sine if odd else cosine, cosine if odd else sine
    return -a if (quarter == ONE) | second else a, -b if second | third else b


@lane_kernel
def facet_density(cosine, sine_square, alpha):
    """D of a facet whose normal has this cosine (> 0) and square of the sine; alpha is the roughness squared."""
    x = sine_square / (alpha * alpha) + cosine * cosine
    return INV_PI / (alpha * alpha * x * x)


@lane_kernel
def slope_loss(cosine, alpha):
    """Smith's Lambda of a direction: what its facets hide of each other."""
    square = cosine * cosine
    return HALF * (math.sqrt(ONE + alpha * alpha * max(ONE - square, ZERO) / square) - ONE)


@lane_kernel
def sample_facet(x, y, z, alpha, u, v):
    """Unit normal (x, y, z) of a facet that unit direction (x, y, z) sees, also from below, z < 0; u, v in [0, 1)."""
    sx, sy, sz = alpha * x, alpha * y, z
    size = ONE / math.sqrt(sx * sx + sy * sy + sz * sz)
    sx, sy, sz = sx * size, sy * size, sz * size
    cz = (ONE - v) * (ONE + sz) - sz
    sine = math.sqrt(max(ONE - cz * cz, ZERO))
    across, along = on_circle(u)
    hx, hy, hz = alpha * (sine * across + sx), alpha * (sine * along + sy), cz + sz
    size = ONE / math.sqrt(max(hx * hx + hy * hy + hz * hz, np.float32(1e-30)))
    return hx * size, hy * size, max(hz * size, ZERO)


@lane_kernel
def schlick(cosine):
    """(1 - cosine)^5: how far reflectance has gone from that seen from above to 1."""
    x = max(ONE - cosine, ZERO)
    square = x * x
    return square * square * x


@lane_kernel
def frame_of(x, y, z):
    """Two unit vectors that make a right-handed frame with unit (x, y, z) (Duff et al., JCGT 2017)."""
    sign = ONE if z >= ZERO else -ONE
    a = -ONE / (sign + z)
    b = x * y * a
    return (ONE + sign * x * x * a, sign * b, -sign * x), (b, sign + y * y * a, -y)


@lane_kernel
def in_world(direction, s, t, n):
    """A direction that is given in the frame of s, t and n."""
    a, b, c = direction
    return (
        a * s[0] + b * t[0] + c * n[0],
        a * s[1] + b * t[1] + c * n[1],
        a * s[2] + b * t[2] + c * n[2],
    )


@lane_kernel
def by_cosine(u, v):
    """A direction about (0, 0, 1), with the density of its cosine, of two random numbers (Malley: even on the disc)."""
    size, (x, y) = math.sqrt(u), on_circle(v)
    return size * x, size * y, math.sqrt(ONE - u)
