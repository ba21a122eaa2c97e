"""Decide which stored samples are visible, and weigh them: depths compared over 3x3 pixels, weights by age.

Indices are unsigned: no test whether they count from the end.
"""

from __future__ import annotations

from typing import NamedTuple

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
CHUNK = 128  # samples that are weighed together; of reproject.BLOCK a part
TESTED = 64  # samples that are tested together
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


class Behind(NamedTuple):
    """Ratios of depths from which a sample counts as behind a nearer one, float32."""

    own: np.float32  # of the same object
    other: np.float32


def behind(pixel: float) -> Behind:
    """The ratios where a pixel's edge is `pixel` times its distance; see Pose.pixel."""
    least = max(min(STEEPEST * pixel, FARTHEST), NEAREST_BEHIND)
    return Behind(np.float32(1.0 + least), np.float32(1.0 + TOUCHING * least))


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
    copied = row_of_tiles = -1
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
        if i // TILE != row_of_tiles:
            row_of_tiles = i // TILE
            for j in range(len(slow)):
                slow[j] = decay[row_of_tiles, j // TILE]
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


@kernel
def weigh(store, first, last, nearest, ratios, bounds, now, young, weight, untested):
    """Weigh the samples first to last - 1: confidence reduced by age; nothing where they are hidden or outside.

    What is hidden waits for a while, then is rejected. Samples younger than `young` seconds are never hidden: what
    they hide may not have been traced yet.

    Parameters
    ----------
    store : SampleStore; rejected samples get depth OUTSIDE and no confidence
    first, last : int, `first` a multiple of CHUNK
    nearest, ratios, bounds : see PixelHistory, Behind and bound_depths
    now, young : float32 seconds of the store's clock
    weight : (capacity,) float32, written
    untested : (capacity,) uint32, scratch from `first` on: samples whose visibility needs a test
    """
    screen, times, confidence = store.screen_position, store.time, store.confidence
    tests = weigh_by_age(store, first, last, nearest, ratios, bounds, now, young, weight, untested)
    reject_hidden(store, untested[first:tests], nearest, ratios, weight)
    for n in range(uint32(first), tests):
        k = untested[n]
        if weight[k] == ZERO and now - times[k] >= WAIT_S:
            screen[DEPTH, k] = OUTSIDE
            confidence[k] = ZERO


@kernel
def weigh_by_age(store, first, last, nearest, ratios, bounds, now, young, weight, untested):
    """Weigh samples as if all were visible, and list those that may not be; see weigh.

    In chunks: what pixels say is looked up sample by sample, all else is vector code.

    Returns
    -------
    end : uint32, of the list in `untested`, which begins at `first`
    """
    screen, times, confidence, objects = store.screen_position, store.time, store.confidence, store.object_id
    shown, closer = nearest.reshape(-1), ratios.own / ratios.other
    bounds_of, decay_of = bounds[CONSERVATIVE_DEPTH].reshape(-1), bounds[DECAY].reshape(-1)
    width, tests = uint32(bounds.shape[2]), uint32(first)
    pixel, doubtful = np.empty(CHUNK, np.uint32), np.empty(CHUNK, np.uint8)
    bound, decay, other = np.empty(CHUNK, np.float32), np.empty(CHUNK, np.float32), np.empty(CHUNK, np.float32)
    for start in range(first, last, CHUNK):
        end = min(start + CHUNK, last)
        x, y, depth = screen[X, start:end], screen[Y, start:end], screen[DEPTH, start:end]
        time, trust, own, out = times[start:end], confidence[start:end], objects[start:end], weight[start:end]
        for k in range(end - start):
            inside = depth[k] > ZERO
            row, column = np.int32(y[k] if inside else ZERO), np.int32(x[k] if inside else ZERO)
            pixel[k] = uint32(row) * width + uint32(column)
        for k in range(end - start):
            i = pixel[k]
            bound[k], decay[k] = bounds_of[i], decay_of[i]
            other[k] = shown[uint32(4) * i + uint32(NEAREST_OBJECT)]
        some = uint32(0)
        for k in range(end - start):
            z, age = depth[k], now - time[k]
            inside = z > ZERO
            a = max(age, ZERO) * decay[k]
            w = trust[k] / (ONE + a * (ONE + a * (HALF + a * np.float32(1.0 / 6.0))))
            out[k] = w if inside else ZERO
            near = z * (closer if other[k] != np.float32(own[k]) else ONE)
            doubtful[k] = np.uint8(inside & (age > young) & (near > bound[k]))
            some += uint32(doubtful[k])
        if some > 0:
            for k in range(end - start):  # no branches
                untested[tests] = uint32(start + k)
                tests += uint32(doubtful[k])
    return tests


@kernel
def reject_hidden(store, untested, nearest, ratios, weight):
    """Take the weight of the samples whose position nearer ones cover.

    Some lies within COVERS, or all of 3x3 pixels show nearer ones, or it lies amidst those that do. Beside a silhouette
    all nearer samples lie on one side, so that their mean is far: counting them alone would let silhouettes grow by
    half a pixel. What the 3x3 pixels show is copied for a chunk of samples first; then all is vector code, sums of
    zeros and ones in place of branches, which would be guesses.

    store : SampleStore; untested : (n,) uint32, indices of samples; nearest : (h, w, 4) float32, see PixelHistory
    ratios : Behind; weight : (capacity,) float32, updated
    """
    screen, objects = store.screen_position, store.object_id
    flat, height, width = nearest.reshape(-1), nearest.shape[0], nearest.shape[1]
    around = np.empty((9, 4 * TESTED), np.float32)  # of each of 3x3 pixels: depth, x, y, object, for sample by sample
    x, y, z = np.empty(TESTED, np.float32), np.empty(TESTED, np.float32), np.empty(TESTED, np.float32)
    own, pixels = np.empty(TESTED, np.float32), np.empty(TESTED, np.float32)
    count, empty, covered = np.empty(TESTED, np.float32), np.empty(TESTED, np.float32), np.empty(TESTED, np.float32)
    across, down, shows = np.empty(TESTED, np.float32), np.empty(TESTED, np.float32), np.empty(TESTED, np.float32)
    for start in range(0, len(untested), TESTED):
        length = min(TESTED, len(untested) - start)
        for n in range(length):
            k = untested[start + n]
            x[n], y[n], z[n] = screen[X, k], screen[Y, k], screen[DEPTH, k]
            own[n] = np.float32(objects[k])
            pixels[n] = copy_around(flat, height, width, np.int64(y[n]), np.int64(x[n]), around, uint32(4 * n))
        count[:] = ZERO
        empty[:] = ZERO
        across[:] = ZERO
        down[:] = ZERO
        covered[:] = ZERO
        for m in range(9):
            other = around[m]
            for n in range(length):
                dx, dy = other[4 * n + NEAREST_X] - x[n], other[4 * n + NEAREST_Y] - y[n]
                ratio = ratios.own if other[4 * n + NEAREST_OBJECT] == own[n] else ratios.other
                nearer = ONE if other[4 * n + NEAREST_DEPTH] * ratio < z[n] else ZERO
                count[n] += nearer
                empty[n] += ONE if other[4 * n + NEAREST_OBJECT] < ZERO else ZERO
                across[n] += nearer * dx
                down[n] += nearer * dy
                covered[n] += nearer if dx * dx + dy * dy < COVERS else ZERO
        for n in range(length):  # the sample's own pixel
            ratio = ratios.own if around[4, 4 * n + NEAREST_OBJECT] == own[n] else ratios.other
            shows[n] = ONE if around[4, 4 * n + NEAREST_DEPTH] * ratio < z[n] else ZERO
        for n in range(length):
            reach = AMIDST * count[n] + ALONE
            near = across[n] * across[n] + down[n] * down[n] < reach * reach
            amidst = (count[n] > ZERO) & near & ((count[n] >= SLOT - EMPTY * empty[n]) | (shows[n] > ZERO))
            covered[n] = ZERO if (covered[n] > ZERO) | amidst | (count[n] >= pixels[n]) else ONE
        for n in range(length):
            weight[untested[start + n]] *= covered[n]


@inline_kernel
def copy_around(flat, height, width, i, j, around, at):
    """Copy what the 3x3 pixels about (i, j) show, beyond the image something far away; returns how many are in it.

    flat : (4 h w,) float32; height, width : int; around : (9, 4 n) float32, written from column `at` on
    """
    if (i > 0) & (j > 0) & (i < height - 1) & (j < width - 1):
        for m in range(3):
            k = uint32(4) * (uint32(i - 1 + m) * uint32(width) + uint32(j - 1))
            copy_pixel(flat, k, around[3 * m], at)
            copy_pixel(flat, k + uint32(4), around[3 * m + 1], at)
            copy_pixel(flat, k + uint32(8), around[3 * m + 2], at)
        return np.float32(9.0)
    inside = ZERO
    for m in range(3):
        for n in range(3):
            row, column, out = i - 1 + m, j - 1 + n, around[3 * m + n]
            if (row >= 0) & (column >= 0) & (row < height) & (column < width):
                copy_pixel(flat, uint32(4) * (uint32(row) * uint32(width) + uint32(column)), out, at)
                inside += ONE
            else:
                out[at + uint32(NEAREST_DEPTH)] = INFINITE
                out[at + uint32(NEAREST_X)] = out[at + uint32(NEAREST_Y)] = out[at + uint32(NEAREST_OBJECT)] = ZERO
    return inside


@inline_kernel
def copy_pixel(source, i, out, at):
    """Copy four numbers, all read before any is written, so that they become a vector."""
    a, b, c, d = source[i], source[i + uint32(1)], source[i + uint32(2)], source[i + uint32(3)]
    out[at], out[at + uint32(1)], out[at + uint32(2)], out[at + uint32(3)] = a, b, c, d
