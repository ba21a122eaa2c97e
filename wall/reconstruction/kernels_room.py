"""Room in a store of samples between two refreshes: what lives moves up, in the order in which it stands."""

from __future__ import annotations

import numpy as np

from wall.jit import kernel

ZERO = np.float32(0.0)


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
            name[kept] = name[k]
            for c in range(3):
                place[c, kept] = place[c, k]
                screen[c, kept] = screen[c, k]
            for c in range(4):
                colour[kept, c] = colour[k, c]
            state[0, kept], state[1, kept] = state[0, k], state[1, k]
            if albedo.shape[1] > 0:
                surface[kept] = surface[k]
                for c in range(3):
                    albedo[c, kept] = albedo[c, k]
        kept += 1
    return kept
