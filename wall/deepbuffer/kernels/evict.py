"""Evict the oldest samples: in any order, they are counted by classes of age."""

from __future__ import annotations

import numpy as np

from wall.core.jit import kernel
from wall.deepbuffer.kernels.columns import DEPTH
from wall.deepbuffer.kernels.reproject import OUTSIDE

AGE_SHIFT = 16  # a class of age: the bits of its float32 above so many; each is 1/128 of an age wide at most
AGES = 1 << (31 - AGE_SHIFT)
EXACT = 1 << 14  # samples: of n times as many only every nth is counted
ZERO = np.float32(0.0)
uint32 = np.uint32  # as indices: no test whether they count from the end


@kernel
def oldest_kept(store, count, now, wanted, ages):
    """The time before which samples are evicted, so that `wanted` stay, or a class of age more.

    Of more than EXACT samples a part is counted: then the share that stays is off by 0.8 % of all (two standard
    deviations) at most, wherever the cut lies.

    store : SampleStore; samples in the image count; count : int, samples stored
    now : float32 seconds of the store's clock; later times count as now
    ages : (AGES,) int32, scratch

    Returns
    -------
    cutoff : float32 seconds, -inf if there are fewer than `wanted`
    """
    ages[:] = 0
    stride = max(count // EXACT, 1)
    for k in range(0, count, stride):
        age = now - store.time[k]
        if store.screen_position[DEPTH, k] > ZERO:
            ages[np.float32(max(age, ZERO)).view(np.int32) >> AGE_SHIFT] += 1
    younger = 0
    for age in range(ages.shape[0]):
        younger += ages[age]
        if younger * stride >= wanted:
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
def evict(store, first, last, cutoff):
    """Reject those of the samples first to last - 1 that are from before `cutoff`.

    store : SampleStore; first, last : int; cutoff : float32 seconds of the store's clock
    """
    for k in range(uint32(first), uint32(last)):
        if store.time[k] < cutoff:
            store.screen_position[DEPTH, k] = OUTSIDE
            store.confidence[k] = ZERO
