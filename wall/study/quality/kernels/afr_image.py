"""Adaptive frameless rendering of 2005, the reconstruction: every sample scattered by its tile's space-time filter."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from wall.core.jit import kernel
from wall.deepbuffer.kernels.reproject import pixel_of
from wall.study.quality.kernels.afr import AGEING, SLOPE_T, SLOPE_X, SLOPE_Y, SLOPES, STORED, STORED_TIME

ZERO, ONE, HALF = np.float32(0.0), np.float32(1.0), np.float32(0.5)
HIDDEN = np.float32(1.05)  # ratio to the nearest depth of its pixel from which a sample is hidden
RECENT_S = 1.0  # samples up to this age make a tile's rate
FLAT_SPACE, FLAT_TIME = 1e-3, 1e-2  # least gradients by pixel and by second: even a plain tile has some extent
LEAST_PIXELS, MOST_PIXELS = 1.0, 12.0  # three sigmas of a filter in space
LEAST_S, MOST_S = 1.0 / 60.0, 2.0  # in time
ENOUGH = np.float32(1e-3)  # weight a pixel needs to stand by itself


class Image(NamedTuple):
    """What the reconstruction of one refresh writes, of a store of `capacity` samples and a tree of n nodes."""

    tile_of: np.ndarray  # (n,) int32: tile of each finest node
    screen: np.ndarray  # (capacity, 3) float32: x, y, depth; depth -1: not seen
    nearest: np.ndarray  # (h, w) float32: least depth of a pixel's samples
    recent: np.ndarray  # (n,) float64: samples of the last RECENT_S, by tile
    extent: np.ndarray  # (n, 3) float32: filter of each tile, pixels, pixels, seconds
    sums: np.ndarray  # (h, w, 4) float32: weighted colour and weight


@kernel
def project(ring, table, now, cell_of, image):
    """Find where every sample is seen, which is nearest, and how many recent ones each tile has.

    ring : SampleRing; table : (rows, 12) float32 panel_from_object; now : float seconds; cell_of : of the tree
    image : Image, screen, nearest and recent are written. Returns the mean age by the sampler's weights, s.
    """
    position, screen, nearest, recent, tile_of = ring.position, image.screen, image.nearest, image.recent, image.tile_of
    count = ring.cursors[STORED]
    height, width = nearest.shape
    nearest[:] = np.inf
    recent[:] = 0.0
    ages, weights = 0.0, 1e-9
    for k in range(count):
        x, y, z = pixel_of(position[k, 0], position[k, 1], position[k, 2], int(position[k, 3]), table)
        screen[k, 2] = -ONE
        if not (z > ZERO and x >= ZERO and y >= ZERO and x < np.float32(width) and y < np.float32(height)):
            continue
        i, j = int(y), int(x)
        screen[k, 0], screen[k, 1], screen[k, 2] = x, y, z
        nearest[i, j] = min(nearest[i, j], z)
        age = now - ring.state[k, STORED_TIME]
        if age <= RECENT_S:
            recent[tile_of[cell_of[i, j]]] += 1.0
        weight = math.exp(-AGEING * age)
        ages += weight * age
        weights += weight
    return ages / weights


@kernel
def tiles_of_cells(tree, slot, tile_of):
    """Find each finest node's tile. tree : Tree; slot : (n,) int32, of the cut; tile_of : (n,) int32, written"""
    for node in range(tile_of.shape[0]):
        if tree.child[node, 0] >= 0:
            continue
        tile = node
        while slot[tile] < 0:
            tile = tree.parent[tile]
        tile_of[node] = tile


@kernel
def extents(nodes, tree, fading, scale, image):
    """Choose a filter for each tile: e_x d_x = e_y d_y = e_t d_t and e_x e_y e_t = V, V = 1 / (recent samples a pixel).

    nodes : (k,) int32, the cut; tree : Tree; fading : see afr.adjust; gradients of tiles without any are those of the
    smallest node above that has one; scale : float, samples that a filter's volume should hold
    image : Image, recent is read, extent is written for nodes of the cut
    """
    rect, parent, sums, recent, extent = tree.rect, tree.parent, tree.sums, image.recent, image.extent
    for node in nodes:
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
def scatter(ring, now, cell_of, image):
    """Add every visible sample to the pixels in reach: Gaussian of e / 3 in space, exponential in age / e_t.

    ring : SampleRing; now : float seconds; cell_of : of the tree; image : Image, sums are written
    """
    screen, nearest, tile_of, extent, sums = image.screen, image.nearest, image.tile_of, image.extent, image.sums
    height, width = nearest.shape
    colour = ring.radiance
    sums[:] = ZERO
    for k in range(ring.cursors[STORED]):
        x, y, z = screen[k, 0], screen[k, 1], screen[k, 2]
        if z < ZERO or z > nearest[int(y), int(x)] * HIDDEN:
            continue
        node = tile_of[cell_of[int(y), int(x)]]
        ex, ey, et = extent[node, 0], extent[node, 1], extent[node, 2]
        old = np.float32(now - ring.state[k, STORED_TIME]) / et
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
                    sums[i, j, 0] += part * colour[k, 0]
                    sums[i, j, 1] += part * colour[k, 1]
                    sums[i, j, 2] += part * colour[k, 2]
                    sums[i, j, 3] += part


@kernel
def normalise(sums):
    """Turn weighted sums into means, in position; the weight becomes 1, or less where there is too little of it."""
    for i in range(sums.shape[0]):
        for j in range(sums.shape[1]):
            scale = ONE / max(sums[i, j, 3], np.float32(1e-20))
            for c in range(3):
                sums[i, j, c] *= scale
            sums[i, j, 3] = min(sums[i, j, 3] / ENOUGH, ONE)
