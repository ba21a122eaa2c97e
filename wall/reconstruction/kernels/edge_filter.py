"""Filter a light field over surfaces: an edge-avoiding a-trous filter that closes where light is known well.

After H. Dammertz et al., "Edge-Avoiding A-Trous Wavelet Transform for fast Global Illumination Filtering", 2010, with
luminance held against its own standard error as in C. Schied et al., "Spatiotemporal Variance-Guided Filtering", 2017.
Unlike there, each pixel weighs as many samples as it has, and the error follows from their number.
"""

from __future__ import annotations

import math

import numpy as np

from wall.core.jit import inline_kernel, kernel
from wall.deepbuffer.kernels.accumulation import luminance
from wall.reconstruction.kernels.light_field import (
    DEVIATION_SUM,
    FREEDOM,
    L_BLUE,
    L_COUNT,
    L_GREEN,
    L_RED,
    NORMAL_X,
    NORMAL_Y,
    NORMAL_Z,
    OBJECT,
    POSITION_X,
    POSITION_Y,
    POSITION_Z,
    VARIANCE,
)

ZERO, ONE, HALF = np.float32(0.0), np.float32(1.0), np.float32(0.5)
LEVELS = 5  # of 3x3 taps, each with twice the distances
POOLS = 3  # levels over which the variance is pooled
KNOWN = np.float32(0.25)  # samples from which a pixel's luminance says what its light is
ERRORS = np.float32(2.0)  # standard errors of a difference at which a neighbour's share has fallen to 1 / e
PLANE = np.float32(50.0)  # squared sine of the angle between the surface and the way to a neighbour, times this
FEW = np.float32(1.0)  # degrees of freedom: with fewer, the variance is drawn towards the squared light
TINY = np.float32(1e-20)


@kernel
def pool_variance(field):
    """Write the variance of a sample's luminance for each pixel, from deviations inside pixels of the same object."""
    a, b, pixels = field.spread, field.spread_scratch, field.pixels
    height, width = a.shape[1], a.shape[2]
    for level in range(POOLS):
        step = 1 << level
        for i in range(height):
            for j in range(width):
                object_id, deviations, freedom = pixels[OBJECT, i, j], ZERO, ZERO
                for di in range(-step, step + 1, step):
                    for dj in range(-step, step + 1, step):
                        y, x = i + di, j + dj
                        if y >= 0 and x >= 0 and y < height and x < width and pixels[OBJECT, y, x] == object_id:
                            share = (ONE if di == 0 else HALF) * (ONE if dj == 0 else HALF)
                            deviations += share * a[DEVIATION_SUM, y, x]
                            freedom += share * a[FREEDOM, y, x]
                b[DEVIATION_SUM, i, j], b[FREEDOM, i, j] = deviations, freedom
        a, b = b, a
    for i in range(height):
        for j in range(width):
            light = field.light
            own = luminance(light[L_RED, i, j], light[L_GREEN, i, j], light[L_BLUE, i, j])
            guess = max(FEW - a[FREEDOM, i, j], ZERO)
            known = a[DEVIATION_SUM, i, j] + guess * own * own
            pixels[VARIANCE, i, j] = known / max(a[FREEDOM, i, j] + guess, TINY)


@kernel
def filter_light(field, levels):
    """Filter `light` to `filtered`; see LightField."""
    source, target = field.light, field.filtered if levels % 2 == 1 else field.scratch
    for level in range(levels):
        filter_level(field.pixels, source, 1 << level, target)
        source, target = target, field.scratch if target is field.filtered else field.filtered


@inline_kernel
def filter_level(pixels, light, step, out):
    """One level: 3x3 taps, `step` pixels apart."""
    height, width = light.shape[1], light.shape[2]
    for i in range(height):
        for j in range(width):
            object_id = pixels[OBJECT, i, j]
            red, green, blue, n = light[L_RED, i, j], light[L_GREEN, i, j], light[L_BLUE, i, j], light[L_COUNT, i, j]
            if not object_id > ZERO:
                out[L_RED, i, j], out[L_GREEN, i, j], out[L_BLUE, i, j], out[L_COUNT, i, j] = red, green, blue, n
                continue
            own, variance = luminance(red, green, blue), pixels[VARIANCE, i, j]
            nx, ny, nz = pixels[NORMAL_X, i, j], pixels[NORMAL_Y, i, j], pixels[NORMAL_Z, i, j]
            px, py, pz = pixels[POSITION_X, i, j], pixels[POSITION_Y, i, j], pixels[POSITION_Z, i, j]
            error = variance / max(n, TINY)
            red, green, blue, total, worth = n * red, n * green, n * blue, n, n
            for di in range(-step, step + 1, step):
                for dj in range(-step, step + 1, step):
                    y, x = i + di, j + dj
                    if (di == 0 and dj == 0) or y < 0 or x < 0 or y >= height or x >= width:
                        continue
                    if pixels[OBJECT, y, x] != object_id:
                        continue
                    share = (ONE if di == 0 else HALF) * (ONE if dj == 0 else HALF)
                    turn = max(nx * pixels[NORMAL_X, y, x] + ny * pixels[NORMAL_Y, y, x] + nz * pixels[NORMAL_Z, y, x], ZERO)
                    turn *= turn
                    turn *= turn
                    turn *= turn
                    turn *= turn
                    share *= turn * turn
                    dx, dy, dz = pixels[POSITION_X, y, x] - px, pixels[POSITION_Y, y, x] - py, pixels[POSITION_Z, y, x] - pz
                    off = nx * dx + ny * dy + nz * dz
                    share *= ONE / (ONE + PLANE * off * off / max(dx * dx + dy * dy + dz * dz, TINY))
                    r, g, b, m = light[L_RED, y, x], light[L_GREEN, y, x], light[L_BLUE, y, x], light[L_COUNT, y, x]
                    if n >= KNOWN and m > ZERO:
                        difference = own - luminance(r, g, b)
                        both = error + pixels[VARIANCE, y, x] / m
                        t = abs(difference) / (ERRORS * math.sqrt(both) + TINY)
                        share *= ONE / (ONE + t * (ONE + t * (HALF + t * np.float32(1.0 / 6.0))))
                    share_m = share * m
                    red += share_m * r
                    green += share_m * g
                    blue += share_m * b
                    total += share_m
                    worth += share * share_m
            scale = ONE / total if total > ZERO else ZERO
            out[L_RED, i, j], out[L_GREEN, i, j], out[L_BLUE, i, j] = red * scale, green * scale, blue * scale
            out[L_COUNT, i, j] = total * total / worth if worth > ZERO else ZERO
