"""Filter a light field over surfaces: an edge-avoiding a-trous filter that closes where light is known well.

After H. Dammertz et al., "Edge-Avoiding A-Trous Wavelet Transform for fast Global Illumination Filtering", 2010, with
luminance held against its own standard error as in C. Schied et al., "Spatiotemporal Variance-Guided Filtering", 2017.
Unlike there, each pixel weighs as many samples as it has, and the error follows from their number.

CHUNK pixels at a time are worked on in one flat scratch array whose rows are a constant apart: so loops are vector
code. Images have a border of BORDER pixels that show no object, and room for whole chunks: nothing tests for edges.
"""

from __future__ import annotations

import numpy as np

from wall.core.jit import inline_kernel, kernel
from wall.deepbuffer.kernels.accumulation import luminance
from wall.reconstruction.kernels.light_field import (
    DEVIATION_SUM,
    FREEDOM,
    L_BLUE,
    L_GREEN,
    L_RED,
    LIGHTS,
    OBJECT,
    VARIANCE,
)

ZERO, ONE, HALF = np.float32(0.0), np.float32(1.0), np.float32(0.5)
# Rows and columns to a level's first tap; the other three are quarter turns on. They are the powers of 2 + i, to which
# 0, 1, -1, i, -i are a complete set of digits: so the taps of all levels reach each of 5^levels pixels just once.
STEPS = ((1, 0), (2, 1), (3, 4), (2, 11))
LEVELS = len(STEPS)
POOLS = 3  # levels over which the variance is pooled
TAP = np.float32(0.8)  # share of a tap, of the pixel itself 1
KNOWN = np.float32(0.25)  # samples from which a pixel's luminance says what its light is
ERRORS = np.float32(2.0)  # standard errors of a difference at which a neighbour's share falls
PLANE = np.float32(50.0)  # squared sine of the angle between the surface and the way to a neighbour, times this
FEW = np.float32(1.0)  # degrees of freedom: with fewer, the variance is drawn towards the squared light
TINY = np.float32(1e-20)
NOWHERE = np.float32(-2.0)  # object of the border
CHUNK = 64  # pixels of a row at once
BORDER = max(max(step) for step in STEPS)  # pixels: the farthest tap
# first of a row's floats in the scratch array: of a pixel, its surface, variance and light, then of a neighbour
OBJ, NX, NY, NZ, PX, PY, PZ, VAR, RED, GREEN, BLUE, NUMBER = range(0, 12 * CHUNK, CHUNK)
OTHER = 12 * CHUNK
SUM_RED, SUM_GREEN, SUM_BLUE, TOTAL, WORTH, ERROR, LUMINANCE, SHARE = range(2 * OTHER, 2 * OTHER + 8 * CHUNK, CHUNK)
ROOM = 2 * OTHER + 8 * CHUNK
SURFACE = 8  # rows of LightField.pixels that are needed: object to variance


def padded(height: int, width: int) -> tuple[int, int]:
    """Rows and columns of images of (height, width) pixels with their borders."""
    return height + 2 * BORDER, -(-width // CHUNK) * CHUNK + 2 * BORDER


@kernel
def pool_variance(field):
    """Write the variance of a sample's luminance for each pixel, from deviations inside pixels of the same object.

    field : LightField, with borders
    """
    a, b = field.spread, field.spread_scratch
    rows = np.empty(6 * CHUNK, np.float32)
    for level in range(POOLS):
        pool_level(field.pixels[OBJECT], a, 1 << level, rows, b)
        a, b = b, a
    light, variance = field.light, field.pixels[VARIANCE]
    for i in range(BORDER, a.shape[1] - BORDER):
        for j in range(BORDER, a.shape[2] - BORDER):
            own = luminance(light[L_RED, i, j], light[L_GREEN, i, j], light[L_BLUE, i, j])
            guess = max(FEW - a[FREEDOM, i, j], ZERO)
            known = a[DEVIATION_SUM, i, j] + guess * own * own
            variance[i, j] = known / max(a[FREEDOM, i, j] + guess, TINY)


@kernel
def pool_level(objects, spread, step, rows, out):
    """Sums over 3x3 taps of the same object, `step` pixels apart. rows : scratch"""
    own, other, deviations, freedom = 0, CHUNK, 2 * CHUNK, 3 * CHUNK
    theirs, their_freedom = 4 * CHUNK, 5 * CHUNK
    for i in range(BORDER, objects.shape[0] - BORDER):
        for first in range(BORDER, objects.shape[1] - BORDER, CHUNK):
            copy(objects, i, first, rows, own)
            for k in range(2 * CHUNK):
                rows[deviations + k] = ZERO
            for di in range(-step, step + 1, step):
                for dj in range(-step, step + 1, step):
                    y, x, tap = i + di, first + dj, tap_share(di, dj)
                    copy(objects, y, x, rows, other)
                    copy(spread[DEVIATION_SUM], y, x, rows, theirs)
                    copy(spread[FREEDOM], y, x, rows, their_freedom)
                    for k in range(CHUNK):
                        share = tap if rows[own + k] == rows[other + k] else ZERO
                        rows[deviations + k] += share * rows[theirs + k]
                        rows[freedom + k] += share * rows[their_freedom + k]
            give(rows, deviations, out[DEVIATION_SUM], i, first)
            give(rows, freedom, out[FREEDOM], i, first)


@inline_kernel
def tap_share(di, dj):
    """The share of a tap: 1 in the middle, 1/2 beside, 1/4 at a corner."""
    return (ONE if di == 0 else HALF) * (ONE if dj == 0 else HALF)


@inline_kernel
def copy(image, y, x, rows, to):
    """Copy CHUNK pixels of row y from x on to rows[to:]."""
    for k in range(CHUNK):
        rows[to + k] = image[y, x + k]


@inline_kernel
def give(rows, start, image, y, x):
    """Copy CHUNK floats from rows[start:] to the pixels of row y from x on."""
    for k in range(CHUNK):
        image[y, x + k] = rows[start + k]


@kernel
def filter_light(field):
    """Filter `light` to `filtered`. field : LightField, with borders"""
    rows = np.empty(ROOM, np.float32)
    source, target, other = field.light, field.scratch, field.filtered  # an even number of levels ends in `filtered`
    for level in range(LEVELS):
        filter_level(field.pixels, source, STEPS[level], rows, target)
        source, target, other = target, other, target


@kernel
def filter_level(pixels, light, step, rows, out):
    """One level: a pixel and four taps around it. rows : scratch"""
    down, right = step
    for i in range(BORDER, light.shape[1] - BORDER):
        for first in range(BORDER, light.shape[2] - BORDER, CHUNK):
            load(pixels, light, i, first, rows, OBJ)
            begin(rows)
            for _ in range(4):
                load(pixels, light, i + down, first + right, rows, OTHER)
                add_neighbours(rows)
                down, right = -right, down
            finish(rows)
            for c in range(LIGHTS):
                give(rows, RED + c * CHUNK, out[c], i, first)


@kernel
def load(pixels, light, y, x, rows, to):
    """Copy all that is known of CHUNK pixels of row y from x on to rows[to:]."""
    for row in range(SURFACE):
        copy(pixels[row], y, x, rows, to + row * CHUNK)
    for c in range(LIGHTS):
        copy(light[c], y, x, rows, to + (SURFACE + c) * CHUNK)


@inline_kernel
def begin(rows):
    """A pixel begins with its own light."""
    for k in range(CHUNK):
        n = rows[NUMBER + k]
        rows[SUM_RED + k], rows[SUM_GREEN + k], rows[SUM_BLUE + k] = (
            n * rows[RED + k],
            n * rows[GREEN + k],
            n * rows[BLUE + k],
        )
        rows[TOTAL + k], rows[WORTH + k] = n, n
        rows[ERROR + k] = rows[VAR + k] / max(n, TINY)
        rows[LUMINANCE + k] = luminance(rows[RED + k], rows[GREEN + k], rows[BLUE + k])


@kernel
def add_neighbours(rows):
    """Add a neighbour's light to each pixel, as far as it lies on the same surface, in the same light."""
    for k in range(CHUNK):
        turn = rows[NX + k] * rows[OTHER + NX + k] + rows[NY + k] * rows[OTHER + NY + k]
        turn = max(turn + rows[NZ + k] * rows[OTHER + NZ + k], ZERO)
        turn *= turn
        turn *= turn
        turn *= turn
        turn *= turn
        same = (rows[OBJ + k] == rows[OTHER + OBJ + k]) & (rows[OBJ + k] > ZERO)
        rows[SHARE + k] = TAP * turn * turn if same else ZERO
    for k in range(CHUNK):
        dx, dy = rows[OTHER + PX + k] - rows[PX + k], rows[OTHER + PY + k] - rows[PY + k]
        dz = rows[OTHER + PZ + k] - rows[PZ + k]
        off = rows[NX + k] * dx + rows[NY + k] * dy + rows[NZ + k] * dz
        square = dx * dx + dy * dy + dz * dz + TINY
        rows[SHARE + k] *= square / (square + PLANE * off * off)
    for k in range(CHUNK):
        n, m = rows[NUMBER + k], rows[OTHER + NUMBER + k]
        r, g, b = rows[OTHER + RED + k], rows[OTHER + GREEN + k], rows[OTHER + BLUE + k]
        difference = rows[LUMINANCE + k] - luminance(r, g, b)
        square = m * difference * difference
        beyond = square / (ERRORS * ERRORS * (m * rows[ERROR + k] + rows[OTHER + VAR + k]) + TINY)
        stop = ONE / (ONE + beyond * (ONE + HALF * beyond))
        share = rows[SHARE + k] * (stop if n >= KNOWN else ONE)
        weight = share * m
        rows[SUM_RED + k] += weight * r
        rows[SUM_GREEN + k] += weight * g
        rows[SUM_BLUE + k] += weight * b
        rows[TOTAL + k] += weight
        rows[WORTH + k] += share * weight


@inline_kernel
def finish(rows):
    """Write the means, and of how many samples each is."""
    for k in range(CHUNK):
        total = rows[TOTAL + k]
        scale = ONE / max(total, TINY)
        rows[RED + k] = rows[SUM_RED + k] * scale
        rows[GREEN + k] = rows[SUM_GREEN + k] * scale
        rows[BLUE + k] = rows[SUM_BLUE + k] * scale
        rows[NUMBER + k] = total * total / max(rows[WORTH + k], TINY)
