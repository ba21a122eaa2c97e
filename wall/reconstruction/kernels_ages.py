"""Which samples are too old to stay, whatever order they are stored in: counted by classes of age; room for others."""

from __future__ import annotations

import numpy as np

from wall.jit import kernel

AGE_SHIFT = 16  # a class of age: the bits of its float32 above so many; each is 1/128 of an age wide at most
AGES = 1 << (31 - AGE_SHIFT)
ZERO = np.float32(0.0)


@kernel
def oldest_kept(state, screen, count, now, wanted, ages):
    """The time before which samples must go, so that at least `wanted` stay, and no more than a class of age beyond.

    state : (2, capacity) float32, seconds and confidence; screen : (3, capacity) float32, depth > 0 in the picture
    now : float32 seconds of the store's clock; later times count as now
    ages : (AGES,) int32, scratch

    Returns
    -------
    cutoff : float32 seconds, -inf if there are fewer than `wanted`
    """
    ages[:] = 0
    for k in range(count):
        age = now - state[0, k]
        if screen[2, k] > ZERO:
            ages[np.float32(max(age, ZERO)).view(np.int32) >> AGE_SHIFT] += 1
    younger = 0
    for age in range(ages.shape[0]):
        younger += ages[age]
        if younger >= wanted:
            return first_younger(now, np.int32((age + 1) << AGE_SHIFT).view(np.float32))
    return np.float32(-np.inf)


@kernel
def first_younger(now, limit):
    """The least float32 time whose age at `now` (float32 seconds, as all here), as float32, is below `limit`."""
    time = np.nextafter(np.nextafter(now - limit, np.float32(-np.inf)), np.float32(-np.inf))
    while now - time >= limit:
        time = np.nextafter(time, np.float32(np.inf))
    return time


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
