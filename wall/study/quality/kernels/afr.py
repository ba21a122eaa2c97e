"""Adaptive frameless rendering of 2005, the sampler: statistics in a K-D tree, a cut through it, crosshairs.

Dayal, Woolley, Watson and Luebke, "Adaptive frameless rendering" (EGSR 2005). Every node of the tree keeps sums over
the samples that lie in it, each weighing exp(3.47 (time - epoch)): the common factor exp(-3.47 (now - epoch)) that
turns this into the paper's exp(-3.47 age) need not be kept up to date, as means and variances do not see it.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from wall.core.jit import inline_kernel, kernel
from wall.core.kernels.hashing import hash_uint32
from wall.deepbuffer.kernels.reproject import pixel_of, position_of

ZERO, ONE = np.float32(0.0), np.float32(1.0)
AGEING = 3.47  # 1 / s
REPROJECTED = 4  # old samples for every new one
CROSS = 5  # rays of a crosshair: centre, left, right, up, down; the sixth is the temporal one
LEAST_WAIT_S = 1e-3  # between a centre and the ray that goes there again, for a finite slope
UNSEEN = 0.02  # variance assumed of a tile without samples, shared among those it has
WEIGHT, VALUE, SQUARE, SLOPES, SLOPE_X, SLOPE_Y, SLOPE_T = range(7)  # columns of sums: SLOPES is the slopes' weight
SUMS = 7
STORED_TIME, STORED_WEIGHT, STORED_VALUE, STORED_SLOPES = 0, 1, 2, 3  # columns of state: slopes by x, y, s, and weight
OVERWRITE, REPROJECT, STORED = 0, 1, 2  # entries of cursors: next to overwrite, next to reproject, samples kept


class Tree(NamedTuple):
    """The K-D tree of the panel: n nodes, the root first."""

    rect: np.ndarray  # (n, 4) int32: left, top, right, bottom
    child: np.ndarray  # (n, 2) int32, -1: none
    parent: np.ndarray  # (n,) int32, -1: none
    cell_of: np.ndarray  # (h, w) int32: finest node of each pixel
    sums: np.ndarray  # (n, SUMS) float64, of the samples in each node


class Cut(NamedTuple):
    """The nodes of the tree that are tiles."""

    nodes: np.ndarray  # (n,) int32, as many of them as the cut has
    slot: np.ndarray  # (n,) int32: where each node stands in `nodes`, -1: not in the cut


class SampleRing(NamedTuple):
    """Samples as points, the oldest overwritten first."""

    position: np.ndarray  # (capacity, 4) float32: point, and its row of the tables
    radiance: np.ndarray  # (capacity, 3) float32 linear RGB
    state: np.ndarray  # (capacity, 7) float64: columns STORED_...
    cell: np.ndarray  # (capacity,) int32: finest node that counts the sample, -1: none
    cursors: np.ndarray  # (3,) int64: OVERWRITE, REPROJECT, STORED


class Crosshairs(NamedTuple):
    """Rays that were chosen together: five or six of each of k crosshairs."""

    tile: np.ndarray  # (k,) int32: node
    begin: np.ndarray  # (k + 1,) int32: first ray of each
    then: np.ndarray  # (k, 2) float32: Centres.value of the tile before


class Centres(NamedTuple):
    """The last crosshair's centre in each of n nodes."""

    position: np.ndarray  # (n, 4) float32: point, and its row of the tables, -1: none
    value: np.ndarray  # (n, 2) float32: value and time


@kernel
def build_tree(smallest, tree):
    """Halve the longer side until no side is above `smallest` pixels.

    tree : Tree, written; n = 2 width height is enough. Returns how many nodes there are.
    """
    rect, child, parent, cell_of = tree.rect, tree.child, tree.parent, tree.cell_of
    height, width = cell_of.shape
    rect[0, 0], rect[0, 1], rect[0, 2], rect[0, 3] = 0, 0, width, height
    parent[0] = -1
    count, k = 1, 0
    while k < count:
        left, top, right, bottom = rect[k, 0], rect[k, 1], rect[k, 2], rect[k, 3]
        child[k, 0] = child[k, 1] = -1
        if max(right - left, bottom - top) <= smallest:
            cell_of[top:bottom, left:right] = k
        else:
            for side in range(2):
                rect[count, :] = rect[k, :]
                parent[count] = k
                child[k, side] = count
                if right - left >= bottom - top:
                    rect[count, 2 - 2 * side] = (left + right) // 2
                else:
                    rect[count, 3 - 2 * side] = (top + bottom) // 2
                count += 1
        k += 1
    return count


@inline_kernel
def add_along(node, tree, weight, value, slope):
    """Add a sample (or take it away: a negative weight) to a finest node and all above it."""
    while node >= 0:
        row = tree.sums[node]
        row[WEIGHT] += weight
        row[VALUE] += weight * value
        row[SQUARE] += weight * value * value
        row[SLOPES] += weight * slope[3]
        row[SLOPE_X] += weight * slope[0]
        row[SLOPE_Y] += weight * slope[1]
        row[SLOPE_T] += weight * slope[2]
        node = tree.parent[node]


@inline_kernel
def value_of(light):
    """The one number that variances and gradients are of: luma of the square roots of radiance, 0..1."""
    red = math.sqrt(min(max(light[0], ZERO), ONE))
    green = math.sqrt(min(max(light[1], ZERO), ONE))
    blue = math.sqrt(min(max(light[2], ZERO), ONE))
    return (red + np.float32(2.0) * green + blue) * np.float32(0.25)


@inline_kernel
def importance(node, rect, sums, fading):
    """Space-time variance times area; few samples leave room for what they missed. fading: exp(-3.47 age of epoch)."""
    row = sums[node]
    seen = row[WEIGHT] * fading
    variance = UNSEEN / (1.0 + max(seen, 0.0))
    if seen > 1e-6:
        mean = row[VALUE] / row[WEIGHT]
        variance += max(row[SQUARE] / row[WEIGHT] - mean * mean, 0.0)
    return variance * (rect[node, 2] - rect[node, 0]) * (rect[node, 3] - rect[node, 1])


@kernel
def adjust(cut, count, tree, fading, trend, least, most):
    """Take one step towards tiles of equal importance: merge the two least important, split the most important one.

    Parameters
    ----------
    cut : Cut, updated; count : int, nodes of the cut; tree : Tree
    fading : float, exp(-AGEING (now - epoch)), turns weights of `sums` into present ones
    trend : int, +1 only splits, -1 only merges, 0 does both
    least, most : int, bounds of `count`

    Returns
    -------
    count : int
    """
    nodes, slot = cut.nodes, cut.slot
    rect, child, parent, sums = tree.rect, tree.child, tree.parent, tree.sums
    split, merge, high, low = -1, -1, -1.0, np.inf
    for k in range(count):
        node = nodes[k]
        if child[node, 0] >= 0:
            found = importance(node, rect, sums, fading)
            if found > high:
                split, high = node, found
        above = parent[node]
        if above >= 0 and child[above, 0] == node and slot[child[above, 1]] >= 0:
            found = importance(above, rect, sums, fading)
            if found < low:
                merge, low = above, found
    if trend == 0 and (low >= high or merge < 0 or split < 0 or parent[split] == merge):
        return count
    if trend <= 0 and merge >= 0 and count > least:
        first, second = child[merge, 0], child[merge, 1]
        nodes[slot[first]] = merge
        slot[merge], slot[first] = slot[first], -1
        count -= 1
        nodes[slot[second]] = nodes[count]
        slot[nodes[count]] = slot[second]
        slot[second] = -1
    if trend >= 0 and split >= 0 and count < most:
        first, second = child[split, 0], child[split, 1]
        nodes[slot[split]] = first
        slot[first], slot[split] = slot[split], -1
        nodes[count], slot[second] = second, count
        count += 1
    return count


@kernel
def aim(cut, count, rect, seed, first, centres, table, xy, crosshairs):
    """Place crosshairs in tiles picked at random, and a ray where the tile's last centre is seen now.

    Parameters
    ----------
    cut : Cut; count : int, nodes of the cut; rect : (n, 4) int32, of the tree
    seed, first : int, random numbers are hashes of (seed, number of the crosshair)
    centres : Centres; table : (rows, 12) float32 panel_from_object
    xy : (m, 2) float32, written; crosshairs : Crosshairs, written

    Returns
    -------
    rays : int
    """
    nodes, tile, begin, then = cut.nodes, crosshairs.tile, crosshairs.begin, crosshairs.then
    last_position, last_value = centres.position, centres.value
    right, bottom = np.float32(rect[0, 2]), np.float32(rect[0, 3])
    rays = 0
    for k in range(tile.shape[0]):
        key = hash_uint32(np.uint32(seed), np.uint32(first + k))
        node = nodes[int((np.uint64(key) * np.uint64(count)) >> np.uint64(32))]
        across, down = unit(hash_uint32(key, np.uint32(1))), unit(hash_uint32(key, np.uint32(2)))
        x = rect[node, 0] + across * (rect[node, 2] - rect[node, 0])
        y = rect[node, 1] + down * (rect[node, 3] - rect[node, 1])
        tile[k], begin[k] = node, rays
        then[k, 0], then[k, 1] = last_value[node, 0], last_value[node, 1]
        for ray in range(CROSS):
            dx = -ONE if ray == 1 else (ONE if ray == 2 else ZERO)
            dy = -ONE if ray == 3 else (ONE if ray == 4 else ZERO)
            xy[rays, 0], xy[rays, 1] = inside(np.float32(x) + dx, right), inside(np.float32(y) + dy, bottom)
            rays += 1
        row = int(last_position[node, 3])
        if row >= 0:
            a, b, c = last_position[node, 0], last_position[node, 1], last_position[node, 2]
            u, v, z = pixel_of(a, b, c, row, table)
            if z > ZERO and u >= ZERO and v >= ZERO and u < right and v < bottom:
                xy[rays, 0], xy[rays, 1] = u, v
                rays += 1
    begin[tile.shape[0]] = rays
    return rays


@inline_kernel
def unit(bits):
    """A random number in [0, 1) of 24 bits of a hash."""
    return np.float32(np.uint32(bits) >> np.uint32(8)) * np.float32(2.0**-24)


@inline_kernel
def inside(at, end):
    """A coordinate mirrored back into [0, end)."""
    if at < ZERO:
        return -at
    if at >= end:
        return min(np.float32(2.0) * end - at, end * np.float32(1.0 - 1e-6))
    return at


@kernel
def gradients(samples, crosshairs, now, last_value, slopes):
    """Write finite differences of crosshairs, and of their tile's last centre against the ray that went there again.

    samples : (m,) SAMPLE, all rays of the crosshairs, in order; crosshairs : Crosshairs; now : float seconds
    last_value : (n, 2) float32, Centres.value, updated
    slopes : (m, 4) float32, written for each ray: |d value| by pixel x, by pixel y, by second, and 1 at centres that
        have all three; else zeros
    """
    tile, begin, then = crosshairs.tile, crosshairs.begin, crosshairs.then
    slopes[:] = ZERO
    for k in range(tile.shape[0]):
        centre, node = begin[k], tile[k]
        middle = value_of(samples[centre]["radiance"])
        if begin[k + 1] - centre > CROSS:
            again = value_of(samples[centre + CROSS]["radiance"])
            slopes[centre, 2] = abs(again - then[k, 0]) / max(now - then[k, 1], LEAST_WAIT_S)
            slopes[centre, 3] = ONE
        for axis in range(2):
            low, high = samples[centre + 1 + 2 * axis], samples[centre + 2 + 2 * axis]
            span = max(abs(high["xy"][axis] - low["xy"][axis]), np.float32(0.5))
            slopes[centre, axis] = abs(value_of(high["radiance"]) - value_of(low["radiance"])) / span
        if slopes[centre, 3] == ZERO:
            slopes[centre, 0] = slopes[centre, 1] = ZERO
        last_value[node, 0], last_value[node, 1] = middle, now


@kernel
def store(samples, slopes, weight, now, maps, tree, ring):
    """Keep samples, and move a few old ones to where they are seen now.

    Parameters
    ----------
    samples : (n,) SAMPLE; slopes : (n, 4) float32, see gradients; weight : float, exp(AGEING (now - epoch))
    now : float, seconds of the samples' clock; maps : PointMaps of their event
    tree : Tree, sums are updated; ring : SampleRing, updated
    """
    position, state, cell, cursors = ring.position, ring.state, ring.cell, ring.cursors
    table, cell_of = maps.panel_from_object, tree.cell_of
    capacity = position.shape[0]
    last = maps.object_from_eye.shape[0] - 1
    for s in range(samples.shape[0]):
        sample, k = samples[s], cursors[OVERWRITE]
        if cell[k] >= 0:
            count_sample(cell[k], tree, -1.0, state[k])
        row = min(int(sample["object_id"]), last)
        x, y = sample["xy"][0], sample["xy"][1]
        u, v = maps.corner[0] + x, maps.corner[1] + y
        a, b, c = position_of(u, v, sample["depth"], row, maps.frame, maps.object_from_eye)
        position[k, 0], position[k, 1], position[k, 2], position[k, 3] = a, b, c, np.float32(row)
        for n in range(3):
            ring.radiance[k, n] = sample["radiance"][n]
        state[k, STORED_TIME], state[k, STORED_WEIGHT] = now, weight
        state[k, STORED_VALUE] = value_of(sample["radiance"])
        for n in range(4):
            state[k, STORED_SLOPES + n] = slopes[s, n]
        cell[k] = cell_at(x, y, cell_of)
        count_sample(cell[k], tree, 1.0, state[k])
        cursors[OVERWRITE] = (k + 1) % capacity
        cursors[STORED] = min(cursors[STORED] + 1, capacity)
        for _ in range(REPROJECTED):
            k = cursors[REPROJECT] % cursors[STORED]
            cursors[REPROJECT] = k + 1
            x, y, z = pixel_of(position[k, 0], position[k, 1], position[k, 2], int(position[k, 3]), table)
            seen = cell_at(x, y, cell_of) if z > ZERO else -1
            if seen != cell[k]:
                count_sample(cell[k], tree, -1.0, state[k])
                count_sample(seen, tree, 1.0, state[k])
                cell[k] = seen


@inline_kernel
def count_sample(node, tree, sign, state):
    """Add a stored sample to a finest node and all above it, or take it away. sign : 1 or -1; state : row of a ring"""
    add_along(node, tree, sign * state[STORED_WEIGHT], state[STORED_VALUE], state[STORED_SLOPES:])


@inline_kernel
def cell_at(x, y, cell_of):
    """Finest node of a position in pixels, -1 outside the panel."""
    if not (x >= ZERO and y >= ZERO and x < np.float32(cell_of.shape[1]) and y < np.float32(cell_of.shape[0])):
        return -1
    return cell_of[int(y), int(x)]


@kernel
def remember(crosshairs, first, position, centres):
    """Note where each crosshair's centre was stored.

    crosshairs : Crosshairs; first : int, row of their first sample; centres : Centres, written
    """
    tile, begin = crosshairs.tile, crosshairs.begin
    for k in range(tile.shape[0]):
        centres.position[tile[k], :] = position[(first + begin[k]) % position.shape[0], :]
