"""Adaptive frameless rendering of 2005, the reconstruction: every sample scattered by its tile's space-time filter."""

# mypy: allow-untyped-defs, allow-untyped-calls, allow-untyped-decorators, allow-incomplete-defs, allow-any-generics
from __future__ import annotations

import math

import numpy as np

from wall.core.jit import kernel
from wall.deepbuffer.kernels.reproject import pixel_of
from wall.study.quality.kernels.afr import AGEING, SLOPE_T, SLOPE_X, SLOPE_Y, SLOPES

ZERO, ONE, HALF = np.float32(0.0), np.float32(1.0), np.float32(0.5)
HIDDEN = np.float32(1.05)  # ratio to the nearest depth of its pixel from which a sample is hidden
RECENT_S = 1.0  # samples up to this age make a tile's rate
FLAT_SPACE, FLAT_TIME = (
    1e-3,
    1e-2,
)  # least gradients by pixel and by second: a still, plain tile has some extent all the same
LEAST_PIXELS, MOST_PIXELS = 1.0, 12.0  # three sigmas of a filter in space
LEAST_S, MOST_S = 1.0 / 60.0, 2.0  # in time
ENOUGH = np.float32(1e-3)  # weight a pixel needs to stand by itself


@kernel
def look(place, state, count, table, now, cell_of, tile_of, screen, nearest, recent):
    """Where every sample is seen, which is nearest, and how many recent ones each tile has.

    place : (capacity, 4) float32; state : (capacity, 7) float64; `count` are kept; tile_of : (n,) int32 tile by finest
    node; screen : (capacity, 3) float32 x, y, depth (-1 = not seen); nearest : (h, w) float32; recent : (n,) float64
    samples of the last RECENT_S by tile; the last three written. Returns the mean age by the sampler's weights, s.
    """
    height, width = nearest.shape
    nearest[:] = np.inf
    recent[:] = 0.0
    ages, weights = 0.0, 1e-9
    for k in range(count):
        x, y, z = pixel_of(place[k, 0], place[k, 1], place[k, 2], int(place[k, 3]), table)
        screen[k, 2] = -ONE
        if not (z > ZERO and x >= ZERO and y >= ZERO and x < np.float32(width) and y < np.float32(height)):
            continue
        i, j = int(y), int(x)
        screen[k, 0], screen[k, 1], screen[k, 2] = x, y, z
        nearest[i, j] = min(nearest[i, j], z)
        age = now - state[k, 0]
        if age <= RECENT_S:
            recent[tile_of[cell_of[i, j]]] += 1.0
        weight = math.exp(-AGEING * age)
        ages += weight * age
        weights += weight
    return ages / weights


@kernel
def tiles_of_cells(rect, child, parent, spot, tile_of):
    """Each finest node's tile: itself or what is above it in the cut. tile_of : (n,) int32, written."""
    for node in range(rect.shape[0]):
        if child[node, 0] >= 0:
            continue
        tile = node
        while spot[tile] < 0:
            tile = parent[tile]
        tile_of[node] = tile


@kernel
def extents(cut, count, rect, parent, sums, fading, recent, scale, extent):
    """A filter for each tile: e_x d_x = e_y d_y = e_t d_t and e_x e_y e_t = V, V = 1 / (recent samples a pixel).

    sums, fading : see kernels_afr.importance; gradients of tiles without any are those of the smallest node above that
    has one. recent : (n,) float64; scale : float, samples that a filter's volume should hold; extent : (n, 3) float32
    pixels, pixels, seconds; written for nodes of the cut
    """
    for k in range(count):
        node = cut[k]
        source = node
        while sums[source, SLOPES] * fading < 1.0 and parent[source] >= 0:
            source = parent[source]
        crosses = max(sums[source, SLOPES], 1e-12)
        dx = max(sums[source, SLOPE_X] / crosses, FLAT_SPACE)
        dy = max(sums[source, SLOPE_Y] / crosses, FLAT_SPACE)
        dt = max(sums[source, SLOPE_T] / crosses, FLAT_TIME)
        area = float((rect[node, 2] - rect[node, 0]) * (rect[node, 3] - rect[node, 1]))
        volume = scale * area * RECENT_S / max(recent[node], 0.5)
        ex = min(max((volume * dy * dt / (dx * dx)) ** (1 / 3), LEAST_PIXELS), MOST_PIXELS)
        ey = min(max((volume * dx * dt / (dy * dy)) ** (1 / 3), LEAST_PIXELS), MOST_PIXELS)
        extent[node, 0], extent[node, 1] = ex, ey
        extent[node, 2] = min(max(volume / (ex * ey), LEAST_S), MOST_S)  # what is left of V for time


@kernel
def scatter(screen, colour, state, count, now, nearest, cell_of, tile_of, extent, gathered):
    """Add every visible sample to the pixels in reach: Gaussian of e / 3 in space, exponential in age / e_t.

    gathered : (h, w, 4) float32 weighted colour and weight, written
    """
    height, width = nearest.shape
    gathered[:] = ZERO
    for k in range(count):
        x, y, z = screen[k, 0], screen[k, 1], screen[k, 2]
        if z < ZERO or z > nearest[int(y), int(x)] * HIDDEN:
            continue
        node = tile_of[cell_of[int(y), int(x)]]
        ex, ey, et = extent[node, 0], extent[node, 1], extent[node, 2]
        old = np.float32(now - state[k, 0]) / et
        if old > np.float32(7.0):  # below a thousandth
            continue
        weight = math.exp(-old) / (ex * ey * et)
        for i in range(max(int(y - ey), 0), min(int(y + ey) + 1, height)):
            v = (np.float32(i) + HALF - y) / ey
            for j in range(max(int(x - ex), 0), min(int(x + ex) + 1, width)):
                u = (np.float32(j) + HALF - x) / ex
                square = u * u + v * v
                if square < ONE:
                    part = weight * math.exp(np.float32(-4.5) * square)
                    gathered[i, j, 0] += part * colour[k, 0]
                    gathered[i, j, 1] += part * colour[k, 1]
                    gathered[i, j, 2] += part * colour[k, 2]
                    gathered[i, j, 3] += part


@kernel
def normalise(gathered):
    """Weighted sums to means, in place; weight becomes 1, or less where there is too little to stand by itself."""
    for i in range(gathered.shape[0]):
        for j in range(gathered.shape[1]):
            scale = ONE / max(gathered[i, j, 3], np.float32(1e-20))
            for c in range(3):
                gathered[i, j, c] *= scale
            gathered[i, j, 3] = min(gathered[i, j, 3] / ENOUGH, ONE)
