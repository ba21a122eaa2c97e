"""Adaptive frameless rendering of 2005, the sampler: statistics in a K-D tree, a cut through it, crosshairs.

Dayal, Woolley, Watson and Luebke, "Adaptive frameless rendering" (EGSR 2005). Every node of the tree keeps sums over
the samples that lie in it, each weighing exp(3.47 (time - epoch)): the common factor exp(-3.47 (now - epoch)) that
turns this into the paper's exp(-3.47 age) need not be kept up to date, as means and variances do not see it.
"""

# mypy: allow-untyped-defs, allow-untyped-calls, allow-untyped-decorators, allow-incomplete-defs, allow-any-generics
from __future__ import annotations

import math

import numpy as np

from wall.core.jit import inline_kernel, kernel
from wall.deepbuffer.kernels.reproject import pixel_of, place_of
from wall.sampling.kernels.permutation import hash_uint32

ZERO, ONE = np.float32(0.0), np.float32(1.0)
AGEING = 3.47  # 1 / s
REPROJECTED = 4  # old samples for every new one
CROSS = 5  # rays of a crosshair: centre, left, right, up, down; the sixth is the temporal one
LEAST_WAIT_S = 1e-3  # between a centre and the ray that goes there again, for a finite slope
UNSEEN = 0.02  # variance assumed of a tile without samples, shared among those it has
# what a node sums up: weight; value; its square; weight, x, y and t of gradients
WEIGHT, VALUE, SQUARE, SLOPES, SLOPE_X, SLOPE_Y, SLOPE_T = 0, 1, 2, 3, 4, 5, 6
SUMS = 7


@kernel
def build_tree(width, height, smallest, rect, child, parent, cell_of):
    """Halve the longer side until no side is above `smallest` pixels.

    rect : (n, 4) int32 left, top, right, bottom; child : (n, 2) int32, -1 = none; parent : (n,) int32
    cell_of : (h, w) int32, finest node of each pixel; all written. Returns how many nodes there are: n = 2 width height
    is enough.
    """
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
def add_along(node, parent, sums, weight, value, slope):
    """Add a sample (or take it away: a negative weight) to a finest node and all above it."""
    while node >= 0:
        row = sums[node]
        row[WEIGHT] += weight
        row[VALUE] += weight * value
        row[SQUARE] += weight * value * value
        row[SLOPES] += weight * slope[3]
        row[SLOPE_X] += weight * slope[0]
        row[SLOPE_Y] += weight * slope[1]
        row[SLOPE_T] += weight * slope[2]
        node = parent[node]


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
def adjust(cut, count, spot, rect, child, parent, sums, fading, trend, least, most):
    """One step towards tiles of equal importance: merge the two least important, split the most important one.

    Parameters
    ----------
    cut : (n,) int32 nodes of the cut, `count` of them; spot : (n,) int32 each node's place in it, -1 = not in it
    rect, child, parent : the tree, see build_tree; sums : (n, SUMS) float64 of its nodes
    fading : float, exp(-AGEING (now - epoch)), turns weights of `sums` into present ones
    trend : int, +1 only splits, -1 only merges, 0 does both
    least, most : int, bounds of `count`

    Returns
    -------
    count : int
    """
    split, merge, high, low = -1, -1, -1.0, np.inf
    for k in range(count):
        node = cut[k]
        if child[node, 0] >= 0:
            found = importance(node, rect, sums, fading)
            if found > high:
                split, high = node, found
        above = parent[node]
        if above >= 0 and child[above, 0] == node and spot[child[above, 1]] >= 0:
            found = importance(above, rect, sums, fading)
            if found < low:
                merge, low = above, found
    if trend == 0 and (low >= high or merge < 0 or split < 0 or parent[split] == merge):
        return count
    if trend <= 0 and merge >= 0 and count > least:
        first, second = child[merge, 0], child[merge, 1]
        cut[spot[first]] = merge
        spot[merge], spot[first] = spot[first], -1
        count -= 1
        cut[spot[second]] = cut[count]
        spot[cut[count]] = spot[second]
        spot[second] = -1
    if trend >= 0 and split >= 0 and count < most:
        first, second = child[split, 0], child[split, 1]
        cut[spot[split]] = first
        spot[first], spot[split] = spot[split], -1
        cut[count], spot[second] = second, count
        count += 1
    return count


@kernel
def aim(cut, count, rect, seed, first, last_place, last_value, table, xy, tile, begin, then):
    """Crosshairs in tiles picked at random, and where the tile's last centre is now, to be traced again.

    Parameters
    ----------
    cut, count, rect : see adjust
    seed, first : int, random numbers are hashes of (seed, number of the crosshair)
    last_place : (n, 4) float32, each node's last centre and its row of `table`, -1 = none
    last_value : (n, 2) float32, its value and time
    xy : (m, 2) float32, written; tile : (k,) int32, node of each crosshair, written
    begin : (k + 1,) int32, first ray of each crosshair, written; five or six rays each
    then : (k, 2) float32, last_value of each crosshair's tile, written

    Returns
    -------
    rays : int
    """
    right, bottom = np.float32(rect[0, 2]), np.float32(rect[0, 3])
    rays = 0
    for k in range(tile.shape[0]):
        key = hash_uint32(np.uint32(seed), np.uint32(first + k))
        node = cut[int((np.uint64(key) * np.uint64(count)) >> np.uint64(32))]
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
        row = int(last_place[node, 3])
        if row >= 0:
            a, b, c = last_place[node, 0], last_place[node, 1], last_place[node, 2]
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
def gradients(samples, tile, begin, then, now, last_value, slopes):
    """Finite differences of crosshairs, and of their tile's last centre against the ray that went there again.

    samples : all rays of the crosshairs, in order; tile, begin, then : see aim; now : float seconds
    last_value : (n, 2) float32, value and time of each node's last centre, updated
    slopes : (m, 4) float32, written for each ray: |d value| by pixel x, by pixel y, by second, and 1 at centres that
        have all three; else zeros
    """
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
def store(
    samples, slopes, weight, now, frame, corner, object_from_eye, table, cell_of, parent, sums, place, colour, state,
    cell, hands
):  # fmt: skip
    """Keep samples, and move a few old ones to where they are seen now.

    Parameters
    ----------
    samples : (n,) SAMPLE; slopes : (n, 4) float32, see gradients; weight : float, exp(AGEING (now - epoch))
    now : float, seconds of the samples' clock
    frame, corner, object_from_eye, table : of their event
    cell_of, parent, sums : the tree, see build_tree and adjust; sums updated
    place : (capacity, 4) float32 point and row of the tables; colour : (capacity, 3) float32
    state : (capacity, 7) float64 time, weight, value, slopes
    cell : (capacity,) int32, finest node that counts the sample, -1 = none
    hands : (3,) int64: next to overwrite, next to reproject, samples kept; updated
    """
    capacity = place.shape[0]
    last = object_from_eye.shape[0] - 1
    for s in range(samples.shape[0]):
        sample, k = samples[s], hands[0]
        if cell[k] >= 0:
            add_along(cell[k], parent, sums, -state[k, 1], state[k, 2], state[k, 3:])
        row = min(int(sample["object_id"]), last)
        x, y = sample["xy"][0], sample["xy"][1]
        a, b, c = place_of(corner[0] + x, corner[1] + y, sample["depth"], row, frame, object_from_eye)
        place[k, 0], place[k, 1], place[k, 2], place[k, 3] = a, b, c, np.float32(row)
        colour[k, 0], colour[k, 1], colour[k, 2] = sample["radiance"][0], sample["radiance"][1], sample["radiance"][2]
        state[k, 0], state[k, 1], state[k, 2] = now, weight, value_of(sample["radiance"])
        for n in range(4):
            state[k, 3 + n] = slopes[s, n]
        cell[k] = cell_at(x, y, cell_of)
        add_along(cell[k], parent, sums, state[k, 1], state[k, 2], state[k, 3:])
        hands[0] = (k + 1) % capacity
        hands[2] = min(hands[2] + 1, capacity)
        for _ in range(REPROJECTED):
            k = hands[1] % hands[2]
            hands[1] = k + 1
            x, y, z = pixel_of(place[k, 0], place[k, 1], place[k, 2], int(place[k, 3]), table)
            seen = cell_at(x, y, cell_of) if z > ZERO else -1
            if seen != cell[k]:
                add_along(cell[k], parent, sums, -state[k, 1], state[k, 2], state[k, 3:])
                add_along(seen, parent, sums, state[k, 1], state[k, 2], state[k, 3:])
                cell[k] = seen


@inline_kernel
def cell_at(x, y, cell_of):
    if not (x >= ZERO and y >= ZERO and x < np.float32(cell_of.shape[1]) and y < np.float32(cell_of.shape[0])):
        return -1
    return cell_of[int(y), int(x)]


@kernel
def remember(tile, begin, first, place, last_place):
    """Note where each crosshair's centre was stored: ring numbers from `first` on. last_place : (n, 4), written."""
    for k in range(tile.shape[0]):
        last_place[tile[k], :] = place[(first + begin[k]) % place.shape[0], :]
