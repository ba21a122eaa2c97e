"""The Shading Cache's mesh: light at vertices of subdivided triangles, in object space; samples set and refine it.

After Tole, Pellacini, Walter and Greenberg, "Interactive global illumination in dynamic scenes" (2002). Every triangle
of every object is the root of a tree of patches. A patch is split at the middle of its longest edge, which its
neighbour shares, into two.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from wall.core.jit import inline_kernel, kernel
from wall.deepbuffer.kernels.reproject import pixel_of
from wall.study.quality.kernels.render_cache import FULL_CHANGE, LEAST_CHANGE, root

ZERO, ONE, HALF, TWO = np.float32(0.0), np.float32(1.0), np.float32(0.5), np.float32(2.0)
LARGE = np.float32(1e9)  # pixels: size of a patch that reaches behind the eye
REACH = 2  # pixels around a contradicting sample, whose patches age


class Patches(NamedTuple):
    """The trees: room for n patches and v vertices, of which the first t and u are the scene's own."""

    corners: np.ndarray  # (n, 4) int32: vertices, the longest edge first; and the middle that it came from
    child: np.ndarray  # (n,) int32: the patch at the first corner, the next is at the second; -1: not split
    turn: np.ndarray  # (t,) uint8: how far a root's corners are turned against its triangle's
    first: np.ndarray  # (objects + 1,) int32: an object's first root; row 0 is the sky
    position: np.ndarray  # (v, 3) float32: object space
    light: np.ndarray  # (v, 3) float32: radiance over albedo
    age: np.ndarray  # (v,) float32: turns, 1 is as many rays as there are pixels; -1: nothing is known
    middles: np.ndarray  # (m, 3) int32: vertices of an edge and its middle, by hash; -1: none; m a power of 2
    counts: np.ndarray  # (2,) int64: patches and vertices in use


class Points(NamedTuple):
    """What is seen at n points of the image."""

    seen: np.ndarray  # (n, 2) int32: object, 0 is the sky; triangle of its mesh
    weights: np.ndarray  # (n, 2) float32: of the triangle's second and third corner
    albedo: np.ndarray  # (n, 3) float32: by which light is multiplied; of the sky its radiance


@kernel
def turn_roots(patches):
    """Turn the corners of every root until its longest edge lies between the first two."""
    corners, position = patches.corners, patches.position
    for k in range(patches.turn.shape[0]):
        turn = longest(position, corners[k, 0], corners[k, 1], corners[k, 2])
        patches.turn[k] = turn
        a, b, c = corners[k, 0], corners[k, 1], corners[k, 2]
        corners[k, 0], corners[k, 1], corners[k, 2] = turned(a, b, c, turn)


@inline_kernel
def turned(a, b, c, turn):
    """Three values, `turn` places on."""
    if turn == 1:
        return b, c, a
    if turn == 2:
        return c, a, b
    return a, b, c


@inline_kernel
def longest(position, a, b, c):
    """How far the corners must be turned for the longest edge to come first."""
    first = second = third = ZERO
    for n in range(3):
        first += (position[b, n] - position[a, n]) ** 2
        second += (position[c, n] - position[b, n]) ** 2
        third += (position[a, n] - position[c, n]) ** 2
    if first >= second and first >= third:
        return 0
    return 1 if second >= third else 2


@inline_kernel
def locate(patches, points, k):
    """The patch that point k shows, and the point's weights of its corners."""
    root_patch = patches.first[points.seen[k, 0]] + points.seen[k, 1]
    p, q = points.weights[k, 0], points.weights[k, 1]
    a, b, c = turned(ONE - p - q, p, q, patches.turn[root_patch])
    return descend(patches, root_patch, a, b, c)


@inline_kernel
def descend(patches, patch, a, b, c):
    """From a patch to the unsplit one in it at weights a, b, c; its number, and the weights of its corners."""
    child, corners = patches.child, patches.corners
    while child[patch] >= 0:
        first = child[patch]
        if a >= b:
            patch, wp, wm, wr, vertex = first, a - b, TWO * b, c, corners[patch, 0]
        else:
            patch, wp, wm, wr, vertex = first + 1, b - a, TWO * a, c, corners[patch, 1]
        a, b, c = wr, wr, wr  # the corner opposite, unless found below
        middle = corners[first, 3]
        for n in range(3):
            corner = corners[patch, n]
            weight = wp if corner == vertex else wm if corner == middle else wr
            if n == 0:
                a = weight
            elif n == 1:
                b = weight
            else:
                c = weight
    return patch, a, b, c


@inline_kernel
def middle_of(patches, a, b):
    """The vertex in the middle of the edge a, b: made where there is none; -1: there is no room."""
    middles, position, light, age, counts = (
        patches.middles, patches.position, patches.light, patches.age, patches.counts,
    )  # fmt: skip
    low, high = min(a, b), max(a, b)
    mask = middles.shape[0] - 1
    slot = (np.int64(low) * 73856093 ^ np.int64(high) * 19349663) & mask
    while middles[slot, 2] >= 0:
        if middles[slot, 0] == low and middles[slot, 1] == high:
            return middles[slot, 2]
        slot = (slot + 1) & mask
    new = counts[1]
    if new >= position.shape[0]:
        return np.int64(-1)
    counts[1] += 1
    middles[slot, 0], middles[slot, 1], middles[slot, 2] = low, high, new
    for n in range(3):
        position[new, n] = (position[a, n] + position[b, n]) * HALF
        light[new, n] = (light[a, n] + light[b, n]) * HALF
    age[new] = max(age[a], age[b])
    return np.int64(new)


@inline_kernel
def split(patches, patch):
    """Split a patch at its longest edge. Returns whether there was room."""
    corners, position, counts = patches.corners, patches.position, patches.counts
    first = counts[0]
    if first + 2 > patches.child.shape[0]:
        return False
    a, b, c = corners[patch, 0], corners[patch, 1], corners[patch, 2]
    middle = middle_of(patches, a, b)
    if middle < 0:
        return False
    counts[0] += 2
    for n in range(2):
        p, q, r = (a, middle, c) if n == 0 else (middle, b, c)
        p, q, r = turned(p, q, r, longest(position, p, q, r))
        corners[first + n, 0], corners[first + n, 1], corners[first + n, 2] = p, q, r
        corners[first + n, 3], patches.child[first + n] = middle, -1
    patches.child[patch] = first
    return True


@inline_kernel
def size_of(patches, patch, row, table):
    """The longest side of a patch's bounding box in the image, pixels."""
    left = top = LARGE
    right = bottom = -LARGE
    for n in range(3):
        p = patches.position[patches.corners[patch, n]]
        x, y, z = pixel_of(p[0], p[1], p[2], row, table)
        if not z > ZERO:
            return LARGE
        left, right, top, bottom = min(left, x), max(right, x), min(top, y), max(bottom, y)
    return max(right - left, bottom - top)


@kernel
def take(samples, points, patches, table, tuning, seen):
    """Set the light of the patches that samples show; split those that are far from it and not small.

    A sample lies anywhere in its patch: the corners move, by their weights there, so that the patch comes nearer to it
    (the step of Kaczmarz). Corners of which nothing is known take its light.

    Parameters
    ----------
    samples : (n,) SAMPLE; points : Points of the same rays
    patches : Patches, updated; table : (objects + 1, 12) float32 panel_from_object of the samples' event
    tuning : (4,) float32: smallest patch that is split, pixels; step towards a sample, 0..1; least error that splits,
        of sqrt radiance; turns by which patches around a contradiction age
    seen : (h, w, 3) int32, corners of what the last image shows at each pixel; -1: none

    Returns
    -------
    done : int, splits
    """
    light, age, corners = patches.light, patches.age, patches.corners
    found = np.empty(3, np.float32)
    weight = np.empty(3, np.float32)
    done = 0
    for s in range(samples.shape[0]):
        row = points.seen[s, 0]
        if row == 0:
            continue
        radiance = samples[s]["radiance"]
        for n in range(3):
            found[n] = radiance[n] / points.albedo[s, n]
        patch, a, b, c = locate(patches, points, s)
        learn(patches, corners[patch], found)
        error = error_of(patches, patch, a, b, c, radiance, points.albedo[s])
        if error > LEAST_CHANGE:
            part = min((error - LEAST_CHANGE) / (FULL_CHANGE - LEAST_CHANGE), ONE)
            age_around(samples[s]["xy"], part * tuning[3], age, seen)
        if error > tuning[2] and size_of(patches, patch, row, table) > tuning[0] and split(patches, patch):
            done += 1
            patch, a, b, c = descend(patches, patch, a, b, c)
        weight[0], weight[1], weight[2] = a, b, c
        scale = tuning[1] / max(a * a + b * b + c * c, np.float32(1e-6))
        for n in range(3):
            now = a * light[corners[patch, 0], n] + b * light[corners[patch, 1], n] + c * light[corners[patch, 2], n]
            for m in range(3):
                k = corners[patch, m]
                light[k, n] = max(light[k, n] + scale * weight[m] * (found[n] - now), ZERO)
        most = max(a, b, c)
        for m in range(3):
            age[corners[patch, m]] *= ONE - min(max(weight[m], ZERO) / most, ONE)
    return done


@inline_kernel
def learn(patches, corners, found):
    """Give corners of which nothing is known the light `found`."""
    for m in range(3):
        k = corners[m]
        if patches.age[k] < ZERO:
            patches.age[k] = ZERO
            for n in range(3):
                patches.light[k, n] = found[n]


@inline_kernel
def error_of(patches, patch, a, b, c, radiance, albedo):
    """How far the patch is from a sample, of sqrt radiance."""
    light, corners = patches.light, patches.corners
    error = ZERO
    for n in range(3):
        now = a * light[corners[patch, 0], n] + b * light[corners[patch, 1], n] + c * light[corners[patch, 2], n]
        error = max(error, abs(root(radiance[n]) - root(now * albedo[n])))
    return error


@inline_kernel
def age_around(xy, turns, age, seen):
    """Make the vertices seen around a position older."""
    i, j = int(xy[1]), int(xy[0])
    for m in range(max(i - REACH, 0), min(i + REACH + 1, seen.shape[0])):
        for n in range(max(j - REACH, 0), min(j + REACH + 1, seen.shape[1])):
            for k in range(3):
                if seen[m, n, k] >= 0 and age[seen[m, n, k]] >= ZERO:
                    age[seen[m, n, k]] += turns


@kernel
def grow_old(patches, turns):
    """Let all vertices of which something is known age by `turns`."""
    age = patches.age
    for k in range(patches.counts[1]):
        if age[k] >= ZERO:
            age[k] += turns


@kernel
def forget(patches):
    """Give up all splits: the cache has the scene's own vertices again, and what is known of them."""
    roots = patches.turn.shape[0]
    vertices = 0
    for k in range(roots):
        patches.child[k] = -1
        for n in range(3):
            vertices = max(vertices, patches.corners[k, n] + 1)
    patches.counts[0], patches.counts[1] = roots, vertices
    patches.age[vertices:] = -ONE
    patches.middles[:] = -1
