"""Samples of a store in other places: sorted into a second one, or moved up where others have left.

What a store's arrays are: picture.Store.
"""

from __future__ import annotations

import numpy as np

from wall.core.jit import inline_kernel, kernel
from wall.deepbuffer.kernels.pixel_buffer import TILE

ZERO = np.float32(0.0)


@kernel
def sort_store(
    place, name, colour, state, screen, surface, albedo, count, by_tile, columns, starts, place_out, name_out,
    colour_out, state_out, screen_out, surface_out, albedo_out,
):  # fmt: skip
    """Copy what lives to a second store, in the order of tiles or of objects, and return how many that are.

    by_tile : bool; columns : int, tiles in a row; starts : (1 + objects or tiles,) int64, scratch
    Samples that are outside the picture or forgotten are left behind. The order within a key stays.
    """
    starts[:] = 0
    for k in range(count):
        if screen[2, k] > ZERO:
            starts[sort_key(name, screen, k, by_tile, columns) + 1] += 1
    for n in range(1, starts.shape[0]):
        starts[n] += starts[n - 1]
    kept = starts[-1]
    for k in range(count):
        if not screen[2, k] > ZERO:
            continue
        n = sort_key(name, screen, k, by_tile, columns)
        j = starts[n]
        starts[n] += 1
        copy_sample(
            place, name, colour, state, screen, surface, albedo, k, place_out, name_out, colour_out, state_out,
            screen_out, surface_out, albedo_out, j,
        )  # fmt: skip
    return kept


@inline_kernel
def sort_key(name, screen, k, by_tile, columns):
    if by_tile:
        return int(screen[1, k]) // TILE * columns + int(screen[0, k]) // TILE
    return np.int64(name[k])


@kernel
def close_ranks(place, name, colour, state, screen, surface, albedo, count, latest):
    """Leave behind what is outside the picture, forgotten, or too old.

    place, name, colour, state, screen, surface, albedo : the store, see picture.Store; changed in place
    latest : float32 seconds of the store's clock; samples of this time and earlier ones go

    Returns
    -------
    count : int, samples that stay
    """
    kept = 0
    for k in range(count):
        if not screen[2, k] > ZERO or state[0, k] <= latest:
            continue
        if kept < k:
            copy_sample(
                place, name, colour, state, screen, surface, albedo, k, place, name, colour, state, screen, surface,
                albedo, kept,
            )  # fmt: skip
        kept += 1
    return kept


@inline_kernel
def copy_sample(
    place, name, colour, state, screen, surface, albedo, k, place_out, name_out, colour_out, state_out, screen_out,
    surface_out, albedo_out, j,
):  # fmt: skip
    """Sample k of one store, or of the same, to place j of another."""
    name_out[j] = name[k]
    for c in range(3):
        place_out[c, j] = place[c, k]
        screen_out[c, j] = screen[c, k]
    for c in range(4):
        colour_out[j, c] = colour[k, c]
    state_out[0, j], state_out[1, j] = state[0, k], state[1, k]
    if albedo.shape[1] > 0:
        surface_out[j] = surface[k]
        for c in range(3):
            albedo_out[c, j] = albedo[c, k]
