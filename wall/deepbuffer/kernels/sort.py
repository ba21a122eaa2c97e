"""Sort the store by tile or by object, compact it, or copy some tiles' samples to work on them alone.

Sorting and compacting remove samples outside the image: those whose depth on the screen is OUTSIDE, which rejected
and evicted samples get at a refresh.
"""

from __future__ import annotations

import numpy as np

from wall.core.jit import inline_kernel, kernel
from wall.deepbuffer.kernels.columns import DEPTH, X, Y
from wall.deepbuffer.kernels.pixel_buffer import TILE

uint32 = np.uint32  # as indices: no test whether they count from the end
ZERO = np.float32(0.0)
REACH = 2  # pixels beyond a tile: samples there may share a pixel with one that spreads from inside it


@kernel
def count_keys(store, first, last, by_tile, columns, counts):
    """Count the samples first to last - 1 of the image by their tile or object.

    store : SampleStore; first, last : int; by_tile : bool; columns : int, tiles in a row
    counts : (objects or tiles,) int64, written
    """
    counts[:] = 0
    for k in range(first, last):
        if store.screen_position[DEPTH, k] > ZERO:
            counts[sort_key(store, k, by_tile, columns)] += 1


@kernel
def copy_sorted(store, first, last, by_tile, columns, starts, out):
    """Copy the samples first to last - 1 of the image to a second store, in the order of tiles or of objects.

    store, out : SampleStore, of one capacity; the order within a key stays
    first, last, by_tile, columns : see count_keys
    starts : (objects or tiles,) int64, where those of each key go; written: the end of where they went
    """
    for k in range(first, last):
        if not store.screen_position[DEPTH, k] > ZERO:
            continue
        n = sort_key(store, k, by_tile, columns)
        j = starts[n]
        starts[n] += 1
        copy_sample(store, k, out, j)


@inline_kernel
def sort_key(store, k, by_tile, columns):
    """The tile or the object of sample k."""
    if by_tile:
        return int(store.screen_position[Y, k]) // TILE * columns + int(store.screen_position[X, k]) // TILE
    return np.int64(store.object_id[k])


@kernel
def compact(store, count, latest):
    """Remove samples that are outside the image or as old as `latest`; the others keep their order.

    store : SampleStore, changed in place
    latest : float32 seconds of the store's clock; samples of this time and earlier ones are removed

    Returns
    -------
    count : int, samples that stay
    """
    kept = 0
    for k in range(count):
        if not store.screen_position[DEPTH, k] > ZERO or store.time[k] <= latest:
            continue
        if kept < k:
            copy_sample(store, k, store, kept)
        kept += 1
    return kept


@kernel
def copy_newer(store, count, latest, out):
    """Copy the samples that are not rejected to another store, but none from before `latest`.

    store, out : SampleStore, which may have room for some of them; latest : float32 seconds of the store's clock

    Returns
    -------
    count : int, samples copied
    """
    copied = 0
    for k in range(count):
        if store.confidence[k] > ZERO and store.time[k] >= latest and copied < out.time.shape[0]:
            copy_sample(store, k, out, copied)
            copied += 1
    return copied


@kernel
def gather(store, count, tiles, out, indices):
    """Copy what is needed to weigh and splat the samples of some tiles, and those that spread into pixels next to them.

    store, out : SampleStore; count : int, samples stored; tiles : (rows, columns) bool
    indices : (capacity,) uint32, written: where each copy came from

    Returns
    -------
    count : int, samples copied
    """
    screen, copied = store.screen_position, out.screen_position
    rows, columns = tiles.shape
    near = np.zeros((rows * TILE + 2 * REACH, columns * TILE + 2 * REACH), np.bool_)  # pixels, with a border
    for row in range(rows):
        for column in range(columns):
            if tiles[row, column]:
                i, j = row * TILE, column * TILE
                near[i : i + TILE + 2 * REACH, j : j + TILE + 2 * REACH] = True
    copies, flat, width = 0, near.reshape(-1), uint32(near.shape[1])
    for k in range(count):
        inside = screen[DEPTH, k] > ZERO
        x, y = screen[X, k] if inside else ZERO, screen[Y, k] if inside else ZERO
        indices[copies] = k
        copies += 1 if inside & flat[(uint32(y) + uint32(REACH)) * width + uint32(x) + uint32(REACH)] else 0
    for n in range(copies):
        k = indices[n]
        copied[X, n], copied[Y, n], copied[DEPTH, n] = screen[X, k], screen[Y, k], screen[DEPTH, k]
        out.object_id[n], out.time[n], out.confidence[n] = store.object_id[k], store.time[k], store.confidence[k]
        for c in range(4):
            out.radiance[n, c] = store.radiance[k, c]
    return copies


@kernel
def give_back(part, count, indices, store):
    """Write what weighing changed in the `count` samples of `part` back to where `gather` found them."""
    for n in range(count):
        store.confidence[indices[n]] = part.confidence[n]
        store.screen_position[DEPTH, indices[n]] = part.screen_position[DEPTH, n]


@inline_kernel
def copy_sample(store, k, out, j):
    """Copy sample k of one store to slot j of another, or of the same."""
    out.object_id[j] = store.object_id[k]
    for c in range(3):
        out.position[c, j] = store.position[c, k]
        out.screen_position[c, j] = store.screen_position[c, k]
    for c in range(4):
        out.radiance[j, c] = store.radiance[k, c]
    out.time[j], out.confidence[j] = store.time[k], store.confidence[k]
    if store.albedo.shape[1] > 0:
        out.normal[j] = store.normal[k]
        for c in range(3):
            out.albedo[c, j] = store.albedo[c, k]
    if store.light_visibility.shape[0] > 0:
        out.light_visibility[j] = store.light_visibility[k]
    if store.light.shape[0] > 0:
        for c in range(3):
            out.light[j, c] = store.light[k, c]
