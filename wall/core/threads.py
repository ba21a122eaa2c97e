"""Share a loop over kernels out to threads: each gets a range of its own, and writes nothing that another writes."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor, wait
from itertools import pairwise
from typing import TypeVar

T = TypeVar("T")


class Threads:
    """So many threads at work at once, the caller's among them. Kernels release Python's lock."""

    def __init__(self, count: int = 1) -> None:
        """`count` of threads, 1 or more; those beside the caller's end when this object does."""
        self.count = count
        self._others = ThreadPoolExecutor(count - 1, "share") if count > 1 else None

    def share(self, length: int, what: Callable[[int, int], T], *, unit: int = 1) -> list[T]:
        """Call `what(first, last)` for ranges that cover 0..length, and return its results in order, when all are done.

        Ranges begin at multiples of `unit`, are as equal as that allows, and are the same at every call.
        """
        ranges = split(length, self.count, unit)
        if self._others is None or len(ranges) < 2:
            return [what(first, last) for first, last in ranges]
        others = [self._others.submit(what, first, last) for first, last in ranges[1:]]
        try:
            own = what(*ranges[0])
        finally:
            wait(others)  # whatever happens: they write to arrays that the caller goes on with
        return [own, *(other.result() for other in others)]


def split(length: int, parts: int, unit: int = 1) -> list[tuple[int, int]]:
    """Ranges (first, last) that cover 0..length, `parts` at most, none empty, that begin at multiples of `unit`."""
    units = -(-length // unit)
    edges = [min(units * k // parts * unit, length) for k in range(parts + 1)]
    return [(first, last) for first, last in pairwise(edges) if first < last]
