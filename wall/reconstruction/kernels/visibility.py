"""Which stored samples are seen, and what each counts: depths compared over 3x3 pixels, weights by age.

Indices are unsigned: no test whether they count from the end.
"""

from __future__ import annotations

import numpy as np

from wall.core.jit import inline_kernel, kernel
from wall.deepbuffer.kernels.pixel_buffer import TILE
from wall.deepbuffer.kernels.reproject import OUTSIDE

uint32 = np.uint32
INFINITE = np.float32(np.inf)
ZERO, ONE, HALF = np.float32(0.0), np.float32(1.0), np.float32(0.5)
BEHIND = np.float32(1.05)  # a sample deeper than its pixel's nearest by this factor is hidden
COVERS = np.float32(0.5**2)  # squared pixels: a nearer sample closer than this covers a deeper one,
AMIDST, ALONE = np.float32(0.75), np.float32(0.3)  # and so do n whose mean lies closer than AMIDST + ALONE / n pixels
SLOT = np.float32(6.0)  # of nine pixels: with fewer nearer ones, a pixel that shows the deeper surface itself is a gap
WAITS = np.float32(0.5)  # seconds: so young a hidden sample is kept, for it may come out again
RIM = np.float32(8.0)  # 1 / s: how much faster samples lose weight at silhouettes, where coverage changes
CROWD = np.float32(4.0)  # weight of a pixel beyond which its samples spread less and age faster, in proportion,
SHARPEST = np.float32(3.0)  # up to so many times
SLOWEST = np.float32(0.3)  # where samples are few, weights fall at so much of the usual pace: there are no better ones


@kernel
def keep_nearest(name, state, screen, count, nearest):
    """Each pixel's nearest sample. Forgotten samples leave the picture.

    nearest : (h, w, 4) float32, written: depth (inf where nothing is), x, y in the picture, object id (-1)

    Returns
    -------
    alive : int, samples in the picture
    """
    flat, width = nearest.reshape(-1), uint32(nearest.shape[1])
    for i in range(0, flat.shape[0], 4):
        flat[i], flat[i + 3] = INFINITE, -ONE
    alive = 0
    for k in range(count):
        z = screen[2, k]
        if not z > ZERO:
            continue
        if state[1, k] == ZERO:
            screen[2, k] = OUTSIDE
            continue
        alive += 1
        x, y, thing = screen[0, k], screen[1, k], np.float32(name[k])
        i = (uint32(y) * width + uint32(x)) * uint32(4)
        a, b, c, d = flat[i], flat[i + uint32(1)], flat[i + uint32(2)], flat[i + uint32(3)]
        closer = z < a  # as likely as not: selecting costs less than guessing
        flat[i] = min(z, a)
        flat[i + uint32(1)] = x if closer else b
        flat[i + uint32(2)] = y if closer else c
        flat[i + uint32(3)] = thing if closer else d
    return alive


@kernel
def front_bounds(nearest, moved, decay, rim, gathered, front, sharpness):
    """Up to which depth a sample is seen without further tests, how fast old samples lose weight, how far all spread.

    Where samples crowd, there are enough near and new ones: the tent would only blur, the old only lag behind.

    nearest : (h, w, 4) float32, see keep_nearest
    moved : (n + 1,) uint8, what moves in the picture; decay : (rows, columns) float32, 1 / seconds, of each tile
    rim : float32, 1 / seconds, RIM unless nothing is to age
    gathered : (h + 2, w + 2, 4) float32, of the picture before, weight last
    front : (h, w, 2) float32, written: the least depth over 3x3 pixels, enlarged by BEHIND; 1 / seconds: the tile's
        decay times weight / CROWD from SLOWEST to SHARPEST (1 where nothing was shown); where deeper surfaces show
        within these pixels `rim` more, times that if none of them moves
    sharpness : (h, w) float32, written: weight / CROWD from 1 to SHARPEST, see splat
    """
    height, width = front.shape[0], front.shape[1]
    depth = np.empty((height + 2, width + 2), np.float32)  # edges stand twice, which changes no extreme
    moving = np.empty_like(depth)
    for i in range(height + 2):
        row = min(max(i - 1, 0), height - 1)
        for j in range(width):
            thing = nearest[row, j, 3]
            depth[i, j + 1] = nearest[row, j, 0]
            moving[i, j + 1] = np.float32(moved[uint32(max(thing, ZERO))]) if thing >= ZERO else ZERO
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
            crowd = gathered[i + 1, j + 1, 3] * (ONE / CROWD)
            pace = min(max(crowd, SLOWEST), SHARPEST) if crowd > ZERO else ONE
            front[i, j, 0] = bound
            at_edge = rim * (ONE if moves > ZERO else pace) if edge else ZERO
            front[i, j, 1] = pace * decay[i // TILE, j // TILE] + at_edge
            sharpness[i, j] = min(max(crowd, ONE), SHARPEST)


@inline_kernel
def hidden(x, y, z, nearest):
    """Whether nearer samples cover the place of one.

    Some lies within COVERS, or all of 3x3 pixels show nearer ones, or it lies amidst those that do. Beside a silhouette
    all nearer samples lie on one side, so that their mean is far: counting them alone would let silhouettes grow by
    half a pixel. Sums of zeros and ones, since branches here are guesses: it is 3 times as fast.

    nearest : (h, w, 4) float32, see keep_nearest
    """
    top, bottom = max(np.int32(y) - 1, 0), min(np.int32(y) + 2, nearest.shape[0])
    left, right = max(np.int32(x) - 1, 0), min(np.int32(x) + 2, nearest.shape[1])
    covers, count, across, down = ZERO, ZERO, ZERO, ZERO
    for m in range(top, bottom):
        for n in range(left, right):
            i, j = uint32(m), uint32(n)  # unsigned: no test whether it counts from the end
            dx, dy = nearest[i, j, 1] - x, nearest[i, j, 2] - y
            nearer = ONE if nearest[i, j, 0] * BEHIND < z else ZERO
            count += nearer
            across += nearer * dx
            down += nearer * dy
            covers += nearer if dx * dx + dy * dy < COVERS else ZERO
    own = nearest[uint32(y), uint32(x), 0] * BEHIND < z
    reach = AMIDST * count + ALONE
    amidst = (count > ZERO) & (across * across + down * down < reach * reach) & ((count >= SLOT) | own)
    return (covers > ZERO) | amidst | (count >= np.float32((bottom - top) * (right - left)))


@kernel
def weigh(state, screen, count, cutoff, nearest, front, now, young, weight, doubtful):
    """What each sample counts: its confidence by its age; nothing where it is hidden, too old or outside.

    What is hidden waits for a while, then dies. Samples younger than `young` seconds are never hidden: what they hide
    may not have been seen yet.

    Parameters
    ----------
    state : (2, capacity) float32; screen : (3, capacity) float32; what dies gets depth OUTSIDE and no confidence
    cutoff : float32 seconds of the store's clock; samples from before it die
    nearest, front : see keep_nearest and front_bounds
    now, young : float32 seconds of the store's clock
    weight : (capacity,) float32, written
    doubtful : (capacity,) uint32, scratch: whose visibility needs a test
    """
    bounds, width = front.reshape(-1), uint32(front.shape[1])
    tests = uint32(0)
    for k in range(count):  # no branches
        z = screen[2, k]
        inside = z > ZERO
        i = uint32(screen[1, k] if inside else ZERO) * width + uint32(screen[0, k] if inside else ZERO)
        time = state[0, k]
        age = now - time
        a = max(age, ZERO) * bounds[uint32(2) * i + uint32(1)]
        w = state[1, k] / (ONE + a * (ONE + a * (HALF + a * np.float32(1.0 / 6.0))))
        weight[k] = w if inside & (time >= cutoff) else ZERO
        doubtful[tests] = uint32(k)
        tests += uint32(1) if inside & (age > young) & (z > bounds[uint32(2) * i]) else uint32(0)
    for n in range(tests):  # in a loop of their own the tests overlap
        k = doubtful[n]
        weight[k] *= ZERO if hidden(screen[0, k], screen[1, k], screen[2, k], nearest) else ONE
    for n in range(tests):
        k = doubtful[n]
        if weight[k] == ZERO and now - state[0, k] >= WAITS:
            screen[2, k] = OUTSIDE
            state[1, k] = ZERO
    if cutoff > -INFINITE:
        for k in range(count):
            if state[0, k] < cutoff:
                screen[2, k] = OUTSIDE
                state[1, k] = ZERO
