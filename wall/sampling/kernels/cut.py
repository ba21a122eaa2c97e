"""The K-D cut: split leaves at the weighted median, merge sibling leaves, a few at a time."""

from __future__ import annotations

import numpy as np

from wall.core.jit import inline_kernel, kernel

LEAF, FREE = -1, -2  # in child[node, 0]; FREE in parent
SPLIT, MERGE = 2.0, 1.0  # of the wanted importance: leaves above are split, pairs of leaves below become one
LEAVES, NODES, VACANT, CURSOR = 0, 1, 2, 3  # in `state`


@kernel
def plant(width, height, rects, child, parent, tile_of, state):
    """One leaf over (h, w) pixels.

    width, height : int, pixels; rects, child, parent, tile_of, state : see adjust, written
    """
    rects[0, 0], rects[0, 1], rects[0, 2], rects[0, 3] = 0, 0, width, height
    child[0, 0], parent[0] = LEAF, LEAF
    tile_of[:] = 0
    state[LEAVES], state[NODES], state[VACANT], state[CURSOR] = 1, 1, 0, 0


@kernel
def adjust(score, wanted, steps, least, most, rects, child, parent, sums, tile_of, vacant, order, state):
    """Up to `steps` splits and merges towards `wanted` leaves of equal sums of scores.

    A leaf with more than SPLIT times the wanted sum is split along its longer axis; two sibling leaves with less than
    MERGE times it together become one. Every call goes on at the node where the last one stopped.

    Parameters
    ----------
    score : (h, w) float32, none negative; wanted : float, number of leaves
    least, most : int, shortest and longest edge of a leaf, pixels, most >= 2 least; a longer one is split whatever its
        sum. Every split keeps `least` on both sides: never more than max(1, w // least) max(1, h // least) leaves
    rects : (capacity, 4) int32, x, y, width, height; twice as many nodes as there can be leaves
    child : (capacity, 2) int32; parent : (capacity,) int32
    sums : (capacity,) float64, of leaves; tile_of : (h, w) int32, the leaf of each pixel
    vacant : (capacity,) int32, nodes that were given up
    order : (capacity,) int32, written if anything changed: the leaves from left to right in the tree
    state : (4,) int64: leaves, nodes in use or given up, how many were given up, where to go on

    Returns
    -------
    taken : int, splits and merges
    """
    total = 0.0
    for node in range(state[NODES]):
        if child[node, 0] == LEAF and parent[node] != FREE:
            total += sums[node]
    wanted_sum = total / wanted
    taken = 0
    for _ in range(state[NODES]):
        if taken >= steps:
            break
        node = state[CURSOR] % state[NODES]
        state[CURSOR] = node + 1
        if parent[node] == FREE:
            continue
        width, height = rects[node, 2], rects[node, 3]
        if child[node, 0] == LEAF:
            heavy = sums[node] > SPLIT * wanted_sum and max(width, height) >= 2 * least
            if heavy or max(width, height) > most:
                split(score, node, least, rects, child, parent, sums, tile_of, vacant, state)
                taken += 1
        elif max(width, height) <= most:
            a, b = child[node, 0], child[node, 1]
            if child[a, 0] == LEAF and child[b, 0] == LEAF and sums[a] + sums[b] < MERGE * wanted_sum:
                merge(score, node, rects, child, parent, sums, tile_of, vacant, state)
                taken += 1
    if taken > 0:
        leaves_in_order(child, order)
    return taken


@inline_kernel
def split(score, node, least, rects, child, parent, sums, tile_of, vacant, state):
    """Two leaves for one, cut across the longer axis where half of its sum lies on either side, as near as may be."""
    x, y, width, height = rects[node, 0], rects[node, 1], rects[node, 2], rects[node, 3]
    across = width >= height
    at = cut_at(score, x, y, width, height, across, least)
    a, b = new_node(vacant, state), new_node(vacant, state)
    if across:
        place_node(rects, a, x, y, at, height)
        place_node(rects, b, x + at, y, width - at, height)
    else:
        place_node(rects, a, x, y, width, at)
        place_node(rects, b, x, y + at, width, height - at)
    child[node, 0], child[node, 1] = a, b
    for leaf in (a, b):
        child[leaf, 0], parent[leaf] = LEAF, node
        claim(score, leaf, rects, sums, tile_of)
    state[LEAVES] += 1


@inline_kernel
def cut_at(score, x, y, width, height, across, low):
    """Pixels before the cut: the weighted median of the longer axis, `low` from both ends; the middle if all is 0."""
    length = width if across else height
    total = 0.0
    for i in range(y, y + height):
        for j in range(x, x + width):
            total += score[i, j]
    at, seen = length // 2, 0.0
    for k in range(length if total > 0.0 else 0):
        line = 0.0
        for m in range(height if across else width):
            line += score[y + m, x + k] if across else score[y + k, x + m]
        if seen + line >= 0.5 * total:
            at = k if 0.5 * total - seen < 0.5 * line else k + 1
            break
        seen += line
    return min(max(at, low), length - low)


@inline_kernel
def merge(score, node, rects, child, parent, sums, tile_of, vacant, state):
    """One leaf for two."""
    for leaf in (child[node, 0], child[node, 1]):
        parent[leaf] = FREE
        vacant[state[VACANT]] = leaf
        state[VACANT] += 1
    child[node, 0] = LEAF
    claim(score, node, rects, sums, tile_of)
    state[LEAVES] -= 1


@inline_kernel
def new_node(vacant, state):
    if state[VACANT] > 0:
        state[VACANT] -= 1
        return np.int64(vacant[state[VACANT]])
    state[NODES] += 1
    return state[NODES] - 1


@inline_kernel
def place_node(rects, node, x, y, width, height):
    rects[node, 0], rects[node, 1], rects[node, 2], rects[node, 3] = x, y, width, height


@inline_kernel
def claim(score, leaf, rects, sums, tile_of):
    """Pixels and their sum now belong to this leaf."""
    total = 0.0
    for i in range(rects[leaf, 1], rects[leaf, 1] + rects[leaf, 3]):
        for j in range(rects[leaf, 0], rects[leaf, 0] + rects[leaf, 2]):
            tile_of[i, j] = leaf
            total += score[i, j]
    sums[leaf] = total


@inline_kernel
def leaves_in_order(child, order):
    """order : (capacity,) int32, written from the front; its far end serves as the stack."""
    top, n = order.shape[0] - 1, 0
    order[top] = 0
    while top < order.shape[0]:
        node = order[top]
        top += 1
        while child[node, 0] != LEAF:
            top -= 1
            order[top] = child[node, 1]
            node = child[node, 0]
        order[n] = node
        n += 1
    return n
