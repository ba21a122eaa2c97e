"""Decide which stored samples are visible, and weigh them: depths compared over 3x3 pixels, weights by age.

Indices are unsigned: no test whether they count from the end.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from wall.core.jit import inline_kernel, kernel
from wall.deepbuffer.kernels.columns import DEPTH, NEAREST_DEPTH, NEAREST_OBJECT, NEAREST_X, NEAREST_Y, X, Y
from wall.deepbuffer.kernels.pixel_buffer import TILE
from wall.deepbuffer.kernels.reproject import OUTSIDE
from wall.deepbuffer.kernels.sort import REACH

uint32 = np.uint32
INFINITE = np.float32(np.inf)
ZERO, ONE, HALF = np.float32(0.0), np.float32(1.0), np.float32(0.5)
STEEPEST = 16.0  # pixels in depth for one across, 86 degrees: what is deeper within 3x3 by a steeper slope is behind,
FARTHEST = 0.05  # or by this share of its depth where pixels are large
NEAREST_BEHIND = 1e-4  # but by no less, since depths are float32
TOUCHING = 0.1  # times that where the nearer one is of another object, which may touch but mostly does not go on
LISTED = 64  # samples at a time
COVERS = np.float32(0.5**2)  # squared pixels: a nearer sample closer than this covers a deeper one,
AMIDST, ALONE = np.float32(0.75), np.float32(0.3)  # pixels: so do n whose mean lies within AMIDST + ALONE / n
SLOT = np.float32(6.0)  # pixels of 3x3 that show nearer samples: with fewer, a pixel showing the deeper one is a gap,
EMPTY = np.float32(2.0 / 3.0)  # less for each of them that shows nothing, which says nothing of gaps
WAIT_S = np.float32(0.5)  # hidden samples are rejected from this age on; younger ones may become visible again
SILHOUETTE_PER_S = np.float32(8.0)  # how much faster samples lose weight at silhouettes, where coverage changes
DENSE = np.float32(4.0)  # effective samples of a pixel: with more, they spread less and age faster, in proportion,
SHARPEST = np.float32(3.0)  # times at most (a factor)
CONSERVATIVE_DEPTH, DECAY, SHARPNESS = 0, 1, 2  # planes of bounds
SLOWEST = np.float32(0.3)  # factor of decay where samples are few: there are no better ones


class Band(NamedTuple):
    """Rows of an image, and the samples that show in them and in the row on either side."""

    top: int
    bottom: int  # the row below the last
    indices: Any  # (listed,) uint32 or more, into the store, in its order
    listed: int  # of them


class Behind(NamedTuple):
    """Ratios of depths from which a sample counts as behind a nearer one, float32."""

    own: np.float32  # of the same object
    other: np.float32


def behind(pixel: float) -> Behind:
    """The ratios where a pixel's edge is `pixel` times its distance; see Pose.pixel."""
    least = max(min(STEEPEST * pixel, FARTHEST), NEAREST_BEHIND)
    return Behind(np.float32(1.0 + least), np.float32(1.0 + TOUCHING * least))


@kernel
def list_rows(store, count, top, bottom, indices):
    """List the samples of the image that lie in rows top to bottom - 1 of pixels, in the order of the store.

    store : SampleStore; count : int, samples stored; indices : (count,) uint32 or more, written

    Returns
    -------
    listed : int, samples
    """
    screen, inside = store.screen_position, np.zeros(LISTED, np.uint8)
    first, end, listed = np.float32(top), np.float32(bottom), 0
    for start in range(0, count, LISTED):
        length = min(LISTED, count - start)
        y, depth = screen[Y, start : start + length], screen[DEPTH, start : start + length]
        some = uint32(0)
        for k in range(length):
            inside[k] = np.uint8((depth[k] > ZERO) & (y[k] >= first) & (y[k] < end))
            some += uint32(inside[k])
        if some == length:  # as often as none: samples are sorted
            out = indices[listed : listed + length]
            for k in range(length):
                out[k] = uint32(start + k)
            listed += length
        elif some > 0:
            for k in range(length):  # no branches
                indices[listed] = uint32(start + k)
                listed += np.int64(inside[k])
    return listed


@kernel
def find_nearest(store, count, nearest, tiles, band):
    """Find each pixel's nearest sample. Rejected samples leave the image.

    store : SampleStore; count : int, samples stored
    nearest : (h, w, 4) float32, written, see PixelHistory
    tiles : (rows, columns) bool, where they are found anew; all their samples are in the store
    band : Band of rows that are written, and whose samples are read and rejected; None for the whole image
    """
    screen, flat, width = store.screen_position, nearest.reshape(-1), uint32(nearest.shape[1])
    top, bottom = uint32(0), uint32(nearest.shape[0])
    if band is not None:
        count, top, bottom = band.listed, uint32(band.top), uint32(band.bottom)
    for i in range(top, bottom):
        for column in range(tiles.shape[1]):
            if tiles[i // TILE, column]:
                for j in range(column * TILE, min((column + 1) * TILE, nearest.shape[1])):
                    nearest[i, j, NEAREST_DEPTH], nearest[i, j, NEAREST_OBJECT] = INFINITE, -ONE
    for n in range(count):
        k = n if band is None else band.indices[n]
        if band is not None and not top <= uint32(screen[Y, k]) < bottom:
            continue
        z = screen[DEPTH, k]
        if not z > ZERO:
            continue
        if store.confidence[k] == ZERO:
            screen[DEPTH, k] = OUTSIDE
            continue
        x, y, object_id = screen[X, k], screen[Y, k], np.float32(store.object_id[k])
        i = (uint32(y) * width + uint32(x)) * uint32(4)
        a, b, c, d = flat[i], flat[i + uint32(1)], flat[i + uint32(2)], flat[i + uint32(3)]
        closer = z < a  # as likely as not: selecting costs less than guessing
        flat[i] = min(z, a)
        flat[i + uint32(1)] = x if closer else b
        flat[i + uint32(2)] = y if closer else c
        flat[i + uint32(3)] = object_id if closer else d


@kernel
def bound_depths(nearest, ratio, moved, decay, silhouette, density, tiles, bounds, top, bottom):
    """Bound the depth up to which samples are visible without further tests, their decay, and how far they spread.

    Where samples are dense, enough are near and new: the tent would only blur, the old would only lag behind.

    nearest : (h, w, 4) float32, see PixelHistory; ratio : float32, Behind.own
    moved : (n + 1,) uint8, objects that moved in the image; decay : (rows, columns) float32, 1 / seconds, of each tile
    silhouette : float32, 1 / seconds, SILHOUETTE_PER_S unless nothing is to age
    density : (h + 2, w + 2, 4) float32, splat sums of the image before, weight last
    tiles : (rows, columns) bool, where bounds are wanted, and for pixels within REACH
    top, bottom : int, of the rows top to bottom - 1
    bounds : (3, h, w) float32, written.
        CONSERVATIVE_DEPTH: the least depth over 3x3 pixels times `ratio`: for samples of the object that their
        pixel shows; those of others are tested sooner. DECAY, 1 / seconds: the tile's decay
        times weight / DENSE from SLOWEST to SHARPEST (1 where nothing was shown); where deeper surfaces show within
        these pixels `silhouette` more, times that if none of them moves. SHARPNESS: weight / DENSE from 1 to SHARPEST
    """
    height, width = bounds.shape[1], bounds.shape[2]
    weights = density.reshape(-1)
    near = np.empty((3, width + 2), np.float32)  # three rows at a time; edges stand twice, which changes no extreme
    far, moving = np.empty_like(near), np.empty_like(near)
    low, high, moves = np.empty(width + 2, np.float32), np.empty(width + 2, np.float32), np.empty(width + 2, np.float32)
    slow, dense = np.empty(tiles.shape[1] * TILE, np.float32), np.empty(width, np.float32)
    all_move = moved[1:].all()  # as the camera does, but for the sky when it only slides
    copied = -1
    for i in range(top, bottom):  # few arrays a loop: all are vector code
        if not (tiles[max(i - REACH, 0) // TILE].any() | tiles[min(i + REACH, height - 1) // TILE].any()):
            continue
        for k in range(max(i - 1, copied + 1), min(i + 2, height)):
            copy_row(nearest[k].reshape(-1), moved, all_move, near[k % 3], far[k % 3], moving[k % 3])
            copied = k
        up, own, down = max(i - 1, 0) % 3, i % 3, min(i + 1, height - 1) % 3
        extremes(near[up], near[own], near[down], low, far[up], far[own], far[down], high)
        for j in range(width + 2):
            moves[j] = max(moving[up, j], max(moving[own, j], moving[down, j]))
        row = weights[4 * (i + 1) * (width + 2) + 4 :]
        for j in range(width):
            dense[j] = row[4 * j + 3] * (ONE / DENSE)
        for column in range(tiles.shape[1]):
            slow[column * TILE : (column + 1) * TILE] = decay[i // TILE, column]
        bound, decays, sharpness = bounds[CONSERVATIVE_DEPTH, i], bounds[DECAY, i], bounds[SHARPNESS, i]
        for j in range(width):
            bound[j] = min(low[j], min(low[j + 1], low[j + 2])) * ratio
        for j in range(width):
            edge = max(high[j], max(high[j + 1], high[j + 2])) > bound[j]
            pace = min(max(dense[j], SLOWEST), SHARPEST) if dense[j] > ZERO else ONE
            at_edge = silhouette * (ONE if max(moves[j], max(moves[j + 1], moves[j + 2])) > ZERO else pace)
            decays[j] = pace * slow[j] + (at_edge if edge else ZERO)
        for j in range(width):
            sharpness[j] = min(max(dense[j], ONE), SHARPEST)


@inline_kernel
def copy_row(nearest, moved, all_move, near, far, moving):
    """Copy a row of nearest samples: depth, depth or 0 where there is none, and whether the object moves."""
    width = near.shape[0] - 2
    a, b, c = near[1 : width + 1], far[1 : width + 1], moving[1 : width + 1]
    for j in range(width):
        a[j] = nearest[4 * j + NEAREST_DEPTH]
    for j in range(width):
        b[j] = a[j] if a[j] < INFINITE else ZERO
    if all_move:  # no look-up
        first = ZERO if moved[0] != 0 else ONE
        for j in range(width):
            c[j] = ONE if nearest[4 * j + NEAREST_OBJECT] >= first else ZERO
    else:
        for j in range(width):
            object_id = nearest[4 * j + NEAREST_OBJECT]
            c[j] = np.float32(moved[uint32(object_id)]) if object_id >= ZERO else ZERO
    near[0], near[width + 1] = near[1], near[width]
    far[0], far[width + 1] = far[1], far[width]
    moving[0], moving[width + 1] = moving[1], moving[width]


@inline_kernel
def extremes(a, b, c, low, d, e, f, high):
    """The least of three rows, and the greatest of three others."""
    for j in range(low.shape[0]):
        low[j] = min(a[j], min(b[j], c[j]))
    for j in range(high.shape[0]):
        high[j] = max(d[j], max(e[j], f[j]))


@inline_kernel
def hidden(x, y, z, object_id, nearest, ratios):
    """Whether nearer samples cover the position of one.

    Some lies within COVERS, or all of 3x3 pixels show nearer ones, or it lies amidst those that do. Beside a silhouette
    all nearer samples lie on one side, so that their mean is far: counting them alone would let silhouettes grow by
    half a pixel. Sums of zeros and ones, since branches here are guesses: it is 3 times as fast.

    object_id : float32; nearest : (h, w, 4) float32, see PixelHistory; ratios : Behind
    """
    top, bottom = max(np.int32(y) - 1, 0), min(np.int32(y) + 2, nearest.shape[0])
    left, right = max(np.int32(x) - 1, 0), min(np.int32(x) + 2, nearest.shape[1])
    covers, count, across, down, empty = ZERO, ZERO, ZERO, ZERO, ZERO
    for m in range(top, bottom):
        for n in range(left, right):
            i, j = uint32(m), uint32(n)  # unsigned: no test whether it counts from the end
            dx, dy = nearest[i, j, NEAREST_X] - x, nearest[i, j, NEAREST_Y] - y
            ratio = ratios.own if nearest[i, j, NEAREST_OBJECT] == object_id else ratios.other
            nearer = ONE if nearest[i, j, NEAREST_DEPTH] * ratio < z else ZERO
            count += nearer
            empty += ONE if nearest[i, j, NEAREST_OBJECT] < ZERO else ZERO
            across += nearer * dx
            down += nearer * dy
            covers += nearer if dx * dx + dy * dy < COVERS else ZERO
    i, j = uint32(y), uint32(x)
    ratio = ratios.own if nearest[i, j, NEAREST_OBJECT] == object_id else ratios.other
    own = nearest[i, j, NEAREST_DEPTH] * ratio < z
    reach = AMIDST * count + ALONE
    amidst = (count > ZERO) & (across * across + down * down < reach * reach) & ((count >= SLOT - EMPTY * empty) | own)
    return (covers > ZERO) | amidst | (count >= np.float32((bottom - top) * (right - left)))


@kernel
def weigh(store, first, last, nearest, ratios, bounds, now, young, weight, untested):
    """Weigh the samples first to last - 1: confidence reduced by age; nothing where they are hidden or outside.

    What is hidden waits for a while, then is rejected. Samples younger than `young` seconds are never hidden: what
    they hide may not have been traced yet.

    Parameters
    ----------
    store : SampleStore; rejected samples get depth OUTSIDE and no confidence; first, last : int
    nearest, ratios, bounds : see PixelHistory, Behind and bound_depths
    now, young : float32 seconds of the store's clock
    weight : (capacity,) float32, written
    untested : (capacity,) uint32, scratch from `first` on: samples whose visibility needs a test
    """
    screen, times, confidence, objects = store.screen_position, store.time, store.confidence, store.object_id
    shown, closer = nearest.reshape(-1), ratios.own / ratios.other
    bound, decay = bounds[CONSERVATIVE_DEPTH].reshape(-1), bounds[DECAY].reshape(-1)
    width, tests = uint32(bounds.shape[2]), uint32(first)
    for k in range(uint32(first), uint32(last)):  # no branches
        z = screen[DEPTH, k]
        inside = z > ZERO
        i = uint32(screen[Y, k] if inside else ZERO) * width + uint32(screen[X, k] if inside else ZERO)
        age = now - times[k]
        a = max(age, ZERO) * decay[i]
        w = confidence[k] / (ONE + a * (ONE + a * (HALF + a * np.float32(1.0 / 6.0))))
        weight[k] = w if inside else ZERO
        other = shown[uint32(4) * i + uint32(NEAREST_OBJECT)] != np.float32(objects[k])
        untested[tests] = uint32(k)
        tests += uint32(1) if inside & (age > young) & (z * (closer if other else ONE) > bound[i]) else uint32(0)
    for n in range(uint32(first), tests):  # in a loop of their own the tests overlap
        k = untested[n]
        weight[k] *= (
            ZERO
            if hidden(screen[X, k], screen[Y, k], screen[DEPTH, k], np.float32(objects[k]), nearest, ratios)
            else ONE
        )
    for n in range(uint32(first), tests):
        k = untested[n]
        if weight[k] == ZERO and now - times[k] >= WAIT_S:
            screen[DEPTH, k] = OUTSIDE
            confidence[k] = ZERO
