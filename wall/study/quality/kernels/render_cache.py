"""The Render Cache's image stages: project points, cull, interpolate, set priorities, choose pixels, age.

Walter, Drettakis and Parker, "Interactive rendering using the Render Cache" (1999); Walter, Drettakis and Greenberg,
"Enhancing and optimizing the Render Cache" (2002).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from wall.core.jit import inline_kernel, kernel
from wall.core.kernels.hashing import hash_uint32
from wall.deepbuffer.kernels.reproject import pixel_of, position_of

ZERO, ONE = np.float32(0.0), np.float32(1.0)
OLDEST = np.float32(255.0)
CULLED = np.float32(1.1)  # a point this much deeper than the mean of its neighbours shows through a nearer surface
SCANNED = 8  # points looked at for the oldest, which a new one overwrites
PREFILTER = 3  # pixels to either side: 7 x 7
HIDDEN_AGES = np.float32(32.0)  # that a point grows older by at a refresh at which another hides it
LEAST_CHANGE, FULL_CHANGE = np.float32(0.03), np.float32(0.25)  # of sqrt radiance: noise; a different surface
CHANGE_AGES = np.float32(160.0)  # that points grow older by around a sample that differs by FULL_CHANGE
CHANGE_REACH = 2  # pixels around such a sample


class Cache(NamedTuple):
    """Points with a colour, and the pixels that show them."""

    position: np.ndarray  # (capacity, 4) float32: point, and its row of the tables, -1: free
    radiance: np.ndarray  # (capacity, 3) float32 linear RGB
    age: np.ndarray  # (capacity,) float32: 0 to OLDEST
    pixel: np.ndarray  # (capacity,) int32: number of the pixel that shows the point, -1: none
    owner: np.ndarray  # (h, w) int32: point that the pixel shows, -1: none
    depth: np.ndarray  # (h, w) float32: of that point, inf: none


@kernel
def project_points(cache, table):
    """Find each pixel's nearest point; points that another hides grow older.

    cache : Cache, pixel, owner and depth are written, age is updated; table : (rows, 12) float32 panel_from_object
    """
    position, age, pixel, owner, depth = cache.position, cache.age, cache.pixel, cache.owner, cache.depth
    height, width = owner.shape
    owner[:] = -1
    pixel[:] = -1
    depth[:] = np.inf
    for k in range(position.shape[0]):
        row = int(position[k, 3])
        if row < 0:
            continue
        x, y, z = pixel_of(position[k, 0], position[k, 1], position[k, 2], row, table)
        if not (z > ZERO and x >= ZERO and y >= ZERO and x < np.float32(width) and y < np.float32(height)):
            continue
        i, j = int(y), int(x)
        other = owner[i, j]
        if other >= 0 and (z > depth[i, j] or (z == depth[i, j] and age[k] > age[other])):
            age[k] = min(age[k] + HIDDEN_AGES, OLDEST)
            continue
        if other >= 0:
            age[other] = min(age[other] + HIDDEN_AGES, OLDEST)
            pixel[other] = -1
        owner[i, j], depth[i, j], pixel[k] = k, z, i * width + j


@kernel
def cull(owner, depth, kept):
    """Take out points that are much deeper than their neighbours' mean. kept : (h, w) int32 like owner, written."""
    height, width = owner.shape
    culled = 0
    for i in range(height):
        for j in range(width):
            kept[i, j] = owner[i, j]
            if owner[i, j] < 0:
                continue
            total, count = 0.0, 0
            for k in range(max(i - 1, 0), min(i + 2, height)):
                for m in range(max(j - 1, 0), min(j + 2, width)):
                    if owner[k, m] >= 0:
                        total += depth[k, m]
                        count += 1
            if depth[i, j] > CULLED * total / count:
                kept[i, j] = -1
                culled += 1
    return culled


@kernel
def interpolate(kept, colour, age, image, priority):
    """Fill small gaps, and say where samples are wanted.

    Parameters
    ----------
    kept : (h, w) int32, point shown by each pixel, -1 = none
    colour : (capacity, 3) float32; age : (capacity,) float32
    image : (h, w, 4) float32, written: 3x3 means weighted 4, 2, 1; where there is none the plain 7x7 mean; weight 1,
        or 0 where that has none either
    priority : (h, w) float32, written: the point's age; else its neighbours' with 3x3 weights, a neighbour without a
        point counting as OLDEST
    """
    height, width = kept.shape
    for i in range(height):
        for j in range(width):
            r = g = b = weight = urgent = total = ZERO
            for k in range(i - 1, i + 2):
                for m in range(j - 1, j + 2):
                    part = np.float32((2 - abs(k - i)) * (2 - abs(m - j)))
                    total += part
                    p = kept[k, m] if k >= 0 and m >= 0 and k < height and m < width else -1
                    if p < 0:
                        urgent += part * OLDEST
                        continue
                    urgent += part * age[p]
                    r, g, b = r + part * colour[p, 0], g + part * colour[p, 1], b + part * colour[p, 2]
                    weight += part
            priority[i, j] = age[kept[i, j]] if kept[i, j] >= 0 else urgent / total
            if weight == ZERO:
                r, g, b, weight = prefiltered(kept, colour, i, j)
            scale = ONE / max(weight, ONE)
            image[i, j, 0], image[i, j, 1], image[i, j, 2] = r * scale, g * scale, b * scale
            image[i, j, 3] = min(weight, ONE)


@inline_kernel
def prefiltered(kept, colour, i, j):
    """Sums over 7x7 pixels: r, g, b and how many have a point."""
    r = g = b = weight = ZERO
    for k in range(max(i - PREFILTER, 0), min(i + PREFILTER + 1, kept.shape[0])):
        for m in range(max(j - PREFILTER, 0), min(j + PREFILTER + 1, kept.shape[1])):
            p = kept[k, m]
            if p >= 0:
                r, g, b = r + colour[p, 0], g + colour[p, 1], b + colour[p, 2]
                weight += ONE
    return r, g, b, weight


@kernel
def choose_pixels(priority, wanted, first_error, chosen):
    """About `wanted` pixels, as dense as their priorities: error diffusion (Floyd and Steinberg 1976), serpentine.

    priority : (h, w) float32 >= 0; first_error : float, where the pattern begins; chosen : (h w, 2) int32 x, y,
    written. Returns how many were chosen.
    """
    height, width = priority.shape
    total = 0.0
    for i in range(height):
        for j in range(width):
            total += priority[i, j]
    scale = wanted / max(total, 1e-9)
    here, below = np.zeros(width + 2), np.zeros(width + 2)
    for j in range(width):  # as if rows came before: else the first rows would lack what they have to pass on
        here[j + 1] = (first_error + 0.6180339887 * j) % 1.0 - 0.5
    count = 0
    for i in range(height):
        below[:] = 0.0
        step = 1 if i % 2 == 0 else -1
        for n in range(width):
            j = n if step == 1 else width - 1 - n
            value = min(priority[i, j] * scale, 1.0) + here[j + 1]
            error = value
            if value >= 0.5:
                error = value - 1.0
                chosen[count, 0], chosen[count, 1] = j, i
                count += 1
            ahead, behind = n + 1 < width, n > 0  # what would leave the image goes straight down
            straight = 5.0
            if ahead:
                here[j + 1 + step] += error * 7.0 / 16.0
                below[j + 1 + step] += error / 16.0
            else:
                straight += 8.0
            if behind:
                below[j + 1 - step] += error * 3.0 / 16.0
            else:
                straight += 3.0
            below[j + 1] += error * straight / 16.0
        here, below = below, here
    return count


@kernel
def shuffle_rows(rows, count, seed):
    """Permute the first `count` of (n, 2) int32 rows in position."""
    for i in range(count - 1, 0, -1):
        j = np.int64((np.uint64(hash_uint32(np.uint32(seed), np.uint32(i))) * np.uint64(i + 1)) >> np.uint64(32))
        x, y = rows[i, 0], rows[i, 1]
        rows[i, 0], rows[i, 1] = rows[j, 0], rows[j, 1]
        rows[j, 0], rows[j, 1] = x, y


@kernel
def store(samples, maps, cache, cursor):
    """Keep new samples as points; where they differ from what was shown, the points around grow older.

    samples : (n,) SAMPLE; maps : PointMaps of their event; cache : Cache, updated
    cursor : int, where the search for an old point goes on; returns the next one
    """
    position, colour, age, pixel, owner = cache.position, cache.radiance, cache.age, cache.pixel, cache.owner
    object_from_eye, corner = maps.object_from_eye, maps.corner
    height, width = owner.shape
    last = object_from_eye.shape[0] - 1
    for s in range(samples.shape[0]):
        sample = samples[s]
        light = sample["radiance"]
        i, j = min(int(sample["xy"][1]), height - 1), min(int(sample["xy"][0]), width - 1)
        slot = owner[i, j]
        if slot >= 0:
            change = ZERO
            for c in range(3):
                change = max(change, abs(root(light[c]) - root(colour[slot, c])))
            part = (change - LEAST_CHANGE) / (FULL_CHANGE - LEAST_CHANGE)
            if part > ZERO:
                age_around(age, owner, i, j, min(part, ONE) * CHANGE_AGES)
        else:
            slot, cursor = oldest(position, age, cursor)
            if pixel[slot] >= 0:
                owner[pixel[slot] // width, pixel[slot] % width] = -1
            pixel[slot] = i * width + j
        row = min(int(sample["object_id"]), last)
        x, y = corner[0] + sample["xy"][0], corner[1] + sample["xy"][1]
        a, b, c = position_of(x, y, sample["depth"], row, maps.frame, object_from_eye)
        position[slot, 0], position[slot, 1], position[slot, 2], position[slot, 3] = a, b, c, np.float32(row)
        colour[slot, 0], colour[slot, 1], colour[slot, 2] = light[0], light[1], light[2]
        age[slot] = ZERO
        owner[i, j] = slot
    return cursor


@inline_kernel
def root(radiance):
    """Square root of radiance, clipped to [0, 1]."""
    return math.sqrt(min(max(radiance, ZERO), ONE))


@inline_kernel
def age_around(age, owner, i, j, ages):
    """Make the points of the pixels around (i, j) older."""
    reach = CHANGE_REACH
    for k in range(max(i - reach, 0), min(i + reach + 1, owner.shape[0])):
        for m in range(max(j - reach, 0), min(j + reach + 1, owner.shape[1])):
            if owner[k, m] >= 0:
                age[owner[k, m]] = min(age[owner[k, m]] + ages, OLDEST)


@inline_kernel
def oldest(position, age, cursor):
    """The oldest of the next SCANNED points, or a free one; and the next cursor."""
    best, most = cursor, np.float32(-1.0)
    for n in range(SCANNED):
        k = (cursor + n) % position.shape[0]
        if position[k, 3] < ZERO:
            return k, (k + 1) % position.shape[0]
        if age[k] > most:
            best, most = k, age[k]
    return best, (cursor + SCANNED) % position.shape[0]
