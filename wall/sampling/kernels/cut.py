"""The K-D cut: split leaves at the weighted median, merge sibling leaves, a few at a time."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from wall.core.jit import inline_kernel, kernel
from wall.sampling.kernels.adaptive import BLOCK, HEIGHT, WIDTH, X, Y, sum_tiles

# pixels, of any tile, whole blocks, most >= 2 least; in smaller tiles rays crowd (docs/lab/quality.md)
LEAST_EDGE, MOST_EDGE = 12, 64
SPLIT, MERGE = 2.0, 1.0  # of the wanted importance: leaves above are split, pairs of leaves below become one
LEFT, RIGHT = 0, 1  # columns of `child`
LEAF, FREE = -1, -2  # in child[node, LEFT]; FREE in parent
LEAVES, NODES, VACANT, CURSOR = 0, 1, 2, 3  # entries of `state`


class Tree(NamedTuple):
    """The nodes above the tiles. There is room for twice as many nodes as there can be leaves."""

    child: np.ndarray  # (capacity, 2) int32: LEFT and RIGHT child, or LEAF
    parent: np.ndarray  # (capacity,) int32; LEAF of the root, FREE of a node that is not in use
    vacant: np.ndarray  # (capacity,) int32: stack of nodes that were given up
    order: np.ndarray  # (capacity,) int32: the leaves from left to right in the tree
    state: np.ndarray  # (4,) int64: LEAVES, NODES in use or given up, VACANT nodes, CURSOR where to go on


@kernel
def plant(width, height, tiles, tree):
    """Make one leaf of all (height, width) pixels. tiles : Tiles and tree : Tree, written"""
    tiles.rects[0, X], tiles.rects[0, Y], tiles.rects[0, WIDTH], tiles.rects[0, HEIGHT] = 0, 0, width, height
    tree.child[0, LEFT], tree.parent[0] = LEAF, LEAF
    tiles.tile_of[:] = 0
    tree.state[LEAVES], tree.state[NODES], tree.state[VACANT], tree.state[CURSOR] = 1, 1, 0, 0


@kernel
def adjust(score, wanted, steps, tiles, tree):
    """Take up to `steps` splits and merges towards `wanted` leaves of equal sums of scores.

    A leaf with more than SPLIT times the wanted sum is split across its longer axis, and so is one that is longer than
    MOST_EDGE. Two sibling leaves become one if they have less than MERGE times the wanted sum together. Every call goes
    on at the node where the last one stopped. Every split keeps LEAST_EDGE on both sides, so that there are never more
    than max(1, w // LEAST_EDGE) max(1, h // LEAST_EDGE) leaves.

    Parameters
    ----------
    score : (h, w) float32, none negative; wanted : float, number of leaves; steps : int
    tiles : Tiles, rects, sums and tile_of are updated, `order` is that of before; tree : Tree, updated

    Returns
    -------
    taken : int, splits and merges
    """
    rects, sums, child, state = tiles.rects, tiles.sums, tree.child, tree.state
    wanted_sum = sum_tiles(score, tiles)[0] / wanted
    taken = 0
    for _ in range(state[NODES]):
        if taken >= steps:
            break
        node = state[CURSOR] % state[NODES]
        state[CURSOR] = node + 1
        if tree.parent[node] == FREE:
            continue
        edge = max(rects[node, WIDTH], rects[node, HEIGHT])
        if child[node, LEFT] == LEAF:
            if (sums[node] > SPLIT * wanted_sum and edge >= 2 * LEAST_EDGE) or edge > MOST_EDGE:
                split(score, node, tiles, tree)
                taken += 1
        elif edge <= MOST_EDGE:
            a, b = child[node, LEFT], child[node, RIGHT]
            if child[a, LEFT] == LEAF and child[b, LEFT] == LEAF and sums[a] + sums[b] < MERGE * wanted_sum:
                merge(score, node, tiles, tree)
                taken += 1
    if taken > 0:
        list_leaves(child, tree.order)
    return taken


@inline_kernel
def split(score, node, tiles, tree):
    """Split a leaf in two, across its longer axis, where half of its sum lies on either side, as near as may be."""
    rects = tiles.rects
    x, y = int(rects[node, X]), int(rects[node, Y])
    width, height = int(rects[node, WIDTH]), int(rects[node, HEIGHT])
    across = width >= height
    at = cut_at(score, x, y, width, height, across)
    a, b = new_node(tree.vacant, tree.state), new_node(tree.vacant, tree.state)
    if across:
        set_rect(rects, a, x, y, at, height)
        set_rect(rects, b, x + at, y, width - at, height)
    else:
        set_rect(rects, a, x, y, width, at)
        set_rect(rects, b, x, y + at, width, height - at)
    tree.child[node, LEFT], tree.child[node, RIGHT] = a, b
    for leaf in (a, b):
        tree.child[leaf, LEFT], tree.parent[leaf] = LEAF, node
        claim(score, leaf, tiles)
    tree.state[LEAVES] += 1


@inline_kernel
def cut_at(score, x, y, width, height, across):
    """Pixels before the cut: the weighted median of the longer axis, LEAST_EDGE from both ends; or the middle.

    It is rounded to whole blocks.

    score : (h, w) float32; x, y, width, height : int, the rectangle; across : bool, whether its longer axis is x
    """
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
    return min(max((at + BLOCK // 2) // BLOCK, LEAST_EDGE // BLOCK), (length - LEAST_EDGE) // BLOCK) * BLOCK


@inline_kernel
def merge(score, node, tiles, tree):
    """Make one leaf of a node's two."""
    for leaf in (tree.child[node, LEFT], tree.child[node, RIGHT]):
        tree.parent[leaf] = FREE
        tree.vacant[tree.state[VACANT]] = leaf
        tree.state[VACANT] += 1
    tree.child[node, LEFT] = LEAF
    claim(score, node, tiles)
    tree.state[LEAVES] -= 1


@inline_kernel
def new_node(vacant, state):
    """Number of a node that is not in use, one that was given up where there is any."""
    if state[VACANT] > 0:
        state[VACANT] -= 1
        return np.int64(vacant[state[VACANT]])
    state[NODES] += 1
    return state[NODES] - 1


@inline_kernel
def set_rect(rects, node, x, y, width, height):
    """Write a node's rectangle."""
    rects[node, X], rects[node, Y], rects[node, WIDTH], rects[node, HEIGHT] = x, y, width, height


@inline_kernel
def claim(score, leaf, tiles):
    """Give a leaf the pixels of its rectangle and their sum."""
    rects = tiles.rects
    total = 0.0
    for i in range(rects[leaf, Y], rects[leaf, Y] + rects[leaf, HEIGHT]):
        for j in range(rects[leaf, X], rects[leaf, X] + rects[leaf, WIDTH]):
            tiles.tile_of[i, j] = leaf
            total += score[i, j]
    tiles.sums[leaf] = total


@inline_kernel
def list_leaves(child, order):
    """Write the leaves from left to right to the front of order (capacity,) int32; its far end is the stack."""
    top, n = order.shape[0] - 1, 0
    order[top] = 0
    while top < order.shape[0]:
        node = order[top]
        top += 1
        while child[node, LEFT] != LEAF:
            top -= 1
            order[top] = child[node, RIGHT]
            node = child[node, LEFT]
        order[n] = node
        n += 1
    return n
