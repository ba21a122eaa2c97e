"""Decide which stored samples are visible, and weigh them: depths compared over 3x3 pixels, weights by age.

Indices are unsigned: no test whether they count from the end.
"""

from __future__ import annotations

import numpy as np

from wall.core.jit import inline_kernel, kernel
from wall.deepbuffer.kernels.columns import DEPTH, NEAREST_DEPTH, NEAREST_OBJECT, NEAREST_X, NEAREST_Y, X, Y
from wall.deepbuffer.kernels.pixel_buffer import TILE
from wall.deepbuffer.kernels.reproject import OUTSIDE

uint32 = np.uint32
INFINITE = np.float32(np.inf)
ZERO, ONE, HALF = np.float32(0.0), np.float32(1.0), np.float32(0.5)
BEHIND = np.float32(1.05)  # ratio of depths: a sample so much deeper than its pixel's nearest is hidden
COVERS = np.float32(0.5**2)  # squared pixels: a nearer sample closer than this covers a deeper one,
AMIDST, ALONE = np.float32(0.75), np.float32(0.3)  # pixels: so do n whose mean lies within AMIDST + ALONE / n
SLOT = np.float32(6.0)  # pixels of 3x3 that show nearer samples: with fewer, a pixel showing the deeper one is a gap
WAIT_S = np.float32(0.5)  # hidden samples are rejected from this age on; younger ones may become visible again
SILHOUETTE_PER_S = np.float32(8.0)  # how much faster samples lose weight at silhouettes, where coverage changes
DENSE = np.float32(4.0)  # effective samples of a pixel: with more, they spread less and age faster, in proportion,
SHARPEST = np.float32(3.0)  # times at most (a factor)
CONSERVATIVE_DEPTH, DECAY, SHARPNESS = 0, 1, 2  # columns of bounds
SLOWEST = np.float32(0.3)  # factor of decay where samples are few: there are no better ones


@kernel
def find_nearest(store, count, nearest):
    """Find each pixel's nearest sample. Rejected samples leave the image.

    store : SampleStore; count : int, samples stored
    nearest : (h, w, 4) float32, written, see PixelHistory

    Returns
    -------
    alive : int, samples in the image
    """
    screen, flat, width = store.screen_position, nearest.reshape(-1), uint32(nearest.shape[1])
    for i in range(0, flat.shape[0], 4):
        flat[i], flat[i + 3] = INFINITE, -ONE
    alive = 0
    for k in range(count):
        z = screen[DEPTH, k]
        if not z > ZERO:
            continue
        if store.confidence[k] == ZERO:
            screen[DEPTH, k] = OUTSIDE
            continue
        alive += 1
        x, y, object_id = screen[X, k], screen[Y, k], np.float32(store.object_id[k])
        i = (uint32(y) * width + uint32(x)) * uint32(4)
        a, b, c, d = flat[i], flat[i + uint32(1)], flat[i + uint32(2)], flat[i + uint32(3)]
        closer = z < a  # as likely as not: selecting costs less than guessing
        flat[i] = min(z, a)
        flat[i + uint32(1)] = x if closer else b
        flat[i + uint32(2)] = y if closer else c
        flat[i + uint32(3)] = object_id if closer else d
    return alive


@kernel
def bound_depths(nearest, moved, decay, silhouette, density, bounds):
    """Bound the depth up to which samples are visible without further tests, their decay, and how far they spread.

    Where samples are dense, enough are near and new: the tent would only blur, the old would only lag behind.

    nearest : (h, w, 4) float32, see PixelHistory
    moved : (n + 1,) uint8, objects that moved in the image; decay : (rows, columns) float32, 1 / seconds, of each tile
    silhouette : float32, 1 / seconds, SILHOUETTE_PER_S unless nothing is to age
    density : (h + 2, w + 2, 4) float32, splat sums of the image before, weight last
    bounds : (h, w, 3) float32, written.
        CONSERVATIVE_DEPTH: the least depth over 3x3 pixels, enlarged by BEHIND. DECAY, 1 / seconds: the tile's decay
        times weight / DENSE from SLOWEST to SHARPEST (1 where nothing was shown); where deeper surfaces show within
        these pixels `silhouette` more, times that if none of them moves. SHARPNESS: weight / DENSE from 1 to SHARPEST
    """
    height, width = bounds.shape[0], bounds.shape[1]
    depth = np.empty((height + 2, width + 2), np.float32)  # edges stand twice, which changes no extreme
    moving = np.empty_like(depth)
    for i in range(height + 2):
        row = min(max(i - 1, 0), height - 1)
        for j in range(width):
            object_id = nearest[row, j, NEAREST_OBJECT]
            depth[i, j + 1] = nearest[row, j, NEAREST_DEPTH]
            moving[i, j + 1] = np.float32(moved[uint32(max(object_id, ZERO))]) if object_id >= ZERO else ZERO
        depth[i, 0], depth[i, width + 1] = depth[i, 1], depth[i, width]
        moving[i, 0], moving[i, width + 1] = moving[i, 1], moving[i, width]
    low, high, any_moves = np.empty_like(depth[0]), np.empty_like(depth[0]), np.empty_like(depth[0])
    for i in range(height):
        for j in range(width + 2):  # vector code, as below
            a, b, c = depth[i, j], depth[i + 1, j], depth[i + 2, j]
            low[j] = min(a, min(b, c))
            a, b, c = a if a < INFINITE else ZERO, b if b < INFINITE else ZERO, c if c < INFINITE else ZERO
            high[j] = max(a, max(b, c))
            any_moves[j] = max(moving[i, j], max(moving[i + 1, j], moving[i + 2, j]))
        for j in range(width):
            bound = min(low[j], min(low[j + 1], low[j + 2])) * BEHIND
            edge = max(high[j], max(high[j + 1], high[j + 2])) > bound
            moves = max(any_moves[j], max(any_moves[j + 1], any_moves[j + 2]))
            dense = density[i + 1, j + 1, 3] * (ONE / DENSE)
            pace = min(max(dense, SLOWEST), SHARPEST) if dense > ZERO else ONE
            at_edge = silhouette * (ONE if moves > ZERO else pace) if edge else ZERO
            bounds[i, j, CONSERVATIVE_DEPTH] = bound
            bounds[i, j, DECAY] = pace * decay[i // TILE, j // TILE] + at_edge
            bounds[i, j, SHARPNESS] = min(max(dense, ONE), SHARPEST)


@inline_kernel
def hidden(x, y, z, nearest):
    """Whether nearer samples cover the position of one.

    Some lies within COVERS, or all of 3x3 pixels show nearer ones, or it lies amidst those that do. Beside a silhouette
    all nearer samples lie on one side, so that their mean is far: counting them alone would let silhouettes grow by
    half a pixel. Sums of zeros and ones, since branches here are guesses: it is 3 times as fast.

    nearest : (h, w, 4) float32, see PixelHistory
    """
    top, bottom = max(np.int32(y) - 1, 0), min(np.int32(y) + 2, nearest.shape[0])
    left, right = max(np.int32(x) - 1, 0), min(np.int32(x) + 2, nearest.shape[1])
    covers, count, across, down = ZERO, ZERO, ZERO, ZERO
    for m in range(top, bottom):
        for n in range(left, right):
            i, j = uint32(m), uint32(n)  # unsigned: no test whether it counts from the end
            dx, dy = nearest[i, j, NEAREST_X] - x, nearest[i, j, NEAREST_Y] - y
            nearer = ONE if nearest[i, j, NEAREST_DEPTH] * BEHIND < z else ZERO
            count += nearer
            across += nearer * dx
            down += nearer * dy
            covers += nearer if dx * dx + dy * dy < COVERS else ZERO
    own = nearest[uint32(y), uint32(x), NEAREST_DEPTH] * BEHIND < z
    reach = AMIDST * count + ALONE
    amidst = (count > ZERO) & (across * across + down * down < reach * reach) & ((count >= SLOT) | own)
    return (covers > ZERO) | amidst | (count >= np.float32((bottom - top) * (right - left)))


@kernel
def weigh(store, count, cutoff, nearest, bounds, now, young, weight, untested):
    """Weigh each sample: its confidence reduced by its age; nothing where it is hidden, too old or outside.

    What is hidden waits for a while, then is rejected. Samples younger than `young` seconds are never hidden: what
    they hide may not have been traced yet.

    Parameters
    ----------
    store : SampleStore; rejected samples get depth OUTSIDE and no confidence; count : int, samples stored
    cutoff : float32 seconds of the store's clock; samples from before it are evicted, in the same way
    nearest, bounds : see PixelHistory and bound_depths
    now, young : float32 seconds of the store's clock
    weight : (capacity,) float32, written
    untested : (capacity,) uint32, scratch: samples whose visibility needs a test
    """
    screen, times, confidence = store.screen_position, store.time, store.confidence
    flat, width = bounds.reshape(-1), uint32(bounds.shape[1])
    tests = uint32(0)
    for k in range(count):  # no branches
        z = screen[DEPTH, k]
        inside = z > ZERO
        i = uint32(screen[Y, k] if inside else ZERO) * width + uint32(screen[X, k] if inside else ZERO)
        i *= uint32(3)
        time = times[k]
        age = now - time
        a = max(age, ZERO) * flat[i + uint32(DECAY)]
        w = confidence[k] / (ONE + a * (ONE + a * (HALF + a * np.float32(1.0 / 6.0))))
        weight[k] = w if inside & (time >= cutoff) else ZERO
        untested[tests] = uint32(k)
        tests += uint32(1) if inside & (age > young) & (z > flat[i]) else uint32(0)
    for n in range(tests):  # in a loop of their own the tests overlap
        k = untested[n]
        weight[k] *= ZERO if hidden(screen[X, k], screen[Y, k], screen[DEPTH, k], nearest) else ONE
    for n in range(tests):
        k = untested[n]
        if weight[k] == ZERO and now - times[k] >= WAIT_S:
            screen[DEPTH, k] = OUTSIDE
            confidence[k] = ZERO
    if cutoff > -INFINITE:
        for k in range(count):
            if times[k] < cutoff:
                screen[DEPTH, k] = OUTSIDE
                confidence[k] = ZERO
