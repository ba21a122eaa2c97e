"""Loops shared out to threads."""

from __future__ import annotations

import math
import threading

import pytest
from hypothesis import given
from hypothesis import strategies as st

from wall.core.threads import Threads, split


@given(st.integers(0, 500), st.integers(1, 12), st.integers(1, 40))
def test_ranges_cover_everything_once_begin_at_units_and_are_as_equal_as_those_allow(
    length: int, parts: int, unit: int
) -> None:
    ranges = split(length, parts, unit)
    assert [k for first, last in ranges for k in range(first, last)] == list(range(length))
    assert len(ranges) <= parts
    assert all(first % unit == 0 and first < last for first, last in ranges)
    units = [-(-(last - first) // unit) for first, last in ranges]
    assert max(units, default=0) <= math.ceil(math.ceil(length / unit) / parts)


def test_results_come_in_order_from_threads_that_run_at_once() -> None:
    """Each waits for the others: with fewer threads none would come through."""
    together = threading.Barrier(3)

    def meet(first: int, last: int) -> tuple[int, int, int]:
        together.wait(timeout=30)
        return first, last, threading.get_ident()

    results = Threads(3).share(10, meet)
    assert [(first, last) for first, last, _ in results] == [(0, 3), (3, 6), (6, 10)]
    assert results[0][2] == threading.get_ident()
    assert len({ident for *_, ident in results}) == 3


def test_one_thread_and_one_range_stay_with_the_caller() -> None:
    for threads, length in ((Threads(), 100), (Threads(4), 1)):
        assert threads.share(length, lambda first, last: threading.get_ident()) == [threading.get_ident()]
    assert Threads(4).share(0, lambda first, last: 0) == []


@pytest.mark.parametrize("wrong", [0, 2])
def test_what_goes_wrong_in_any_thread_is_raised_after_all_have_ended(wrong: int) -> None:
    ended = []

    def fail(first: int, last: int) -> None:
        if first == wrong:
            raise ZeroDivisionError
        threading.Event().wait(0.05)
        ended.append(first)

    with pytest.raises(ZeroDivisionError):
        Threads(3).share(3, fail)
    assert sorted([*ended, wrong]) == [0, 1, 2]
