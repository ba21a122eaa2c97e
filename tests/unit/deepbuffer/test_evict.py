"""Which samples are too old to stay: at least as many as wanted stay, and hardly more, in whatever order they lie."""

from __future__ import annotations

import numpy as np
import pytest

from wall.core.data import Float32
from wall.deepbuffer.kernels.evict import AGES, EXACT, oldest_kept
from wall.deepbuffer.store import SampleStore

NOW = 100.5
CLASS = 1 / 128  # of an age: as exact as ages are told apart
ONE_DEVIATION = 0.5 / EXACT**0.5  # share of all, of a quantile told by EXACT of them: worst at the median


def cutoff(times: Float32, wanted: int, *, outside: Float32 | None = None) -> np.float32:
    """By the kernel, with a scratch that was used before."""
    store = SampleStore.of(len(times), lit=False)
    store.time[:], store.screen_position[2] = times, 1.0
    if outside is not None:
        store.screen_position[2] = np.where(outside, -1.0, 1.0)
    scratch = np.full(AGES, 7, np.int32)
    return np.float32(oldest_kept(store, len(times), np.float32(NOW), wanted, scratch))


@pytest.mark.parametrize("wanted", [1, 10, 1000, 1999, 2000])
def test_so_many_stay_and_none_beyond_the_class_of_the_oldest(random_numbers: np.random.Generator, wanted: int) -> None:
    times = (NOW - random_numbers.random(2000)).astype(np.float32)
    limit = cutoff(times, wanted)
    ages = np.sort(np.float32(NOW) - times)
    oldest_wanted = ages[wanted - 1]
    staying = np.float32(NOW) - times[times >= limit]
    assert len(staying) >= wanted
    assert staying.max() <= oldest_wanted * (1 + CLASS)


def test_order_makes_no_difference(random_numbers: np.random.Generator) -> None:
    times = (NOW - random_numbers.random(500)).astype(np.float32)
    assert cutoff(times, 200) == cutoff(times[::-1].copy(), 200) == cutoff(np.sort(times), 200)


def test_with_fewer_than_wanted_all_stay() -> None:
    assert cutoff(np.float32([1.0, 2.0]), 3) == -np.inf
    assert cutoff(np.zeros(0, np.float32), 1) == -np.inf


def test_what_is_outside_the_image_is_not_counted() -> None:
    times = np.float32([100.4, 100.3, 100.2, 100.1])
    outside = np.float32([1, 0, 0, 0])
    limit = cutoff(times, 2, outside=outside)
    assert 100.1 < limit <= np.float32(100.2)


def test_samples_of_the_future_are_the_youngest() -> None:
    times = np.float32([101.0, 102.0, 100.0, 99.0])
    limit = cutoff(times, 2)
    assert 100.0 < limit <= 101.0


def test_of_many_samples_about_as_many_as_wanted_stay(random_numbers: np.random.Generator) -> None:
    times = (NOW - random_numbers.random(12 * EXACT + 5)).astype(np.float32)
    for wanted in (len(times) // 7, len(times) // 2):
        staying = np.count_nonzero(times >= cutoff(times, wanted))
        by_class = wanted * CLASS
        assert abs(staying - wanted) <= 2 * ONE_DEVIATION * len(times) + by_class
