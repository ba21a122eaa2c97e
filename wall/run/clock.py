"""Time as an argument: a real clock on the head's timeline, and one that tests and single runs turn by hand."""

from __future__ import annotations

import time
from typing import Protocol


class Clock(Protocol):
    def now(self) -> float:
        """Seconds of the head's monotonic clock."""
        ...


class HeadClock:
    """This machine's monotonic clock, shifted to the head's. On the head's own host the shift is 0."""

    def __init__(self) -> None:
        self.shift = 0.0
        self._best_round_trip = float("inf")

    def now(self) -> float:
        return time.monotonic() + self.shift

    def learn(self, sent: float, head_time: float) -> None:
        """A ping sent at `sent` (own monotonic time) came back with the head's time: keep the fastest one's shift.

        The error is at most half the round trip.
        """
        back = time.monotonic()
        if back - sent < self._best_round_trip:
            self._best_round_trip = back - sent
            self.shift = head_time - (sent + back) / 2


class ManualClock:
    def __init__(self, start: float = 0.0) -> None:
        self.time = start

    def now(self) -> float:
        return self.time

    def advance(self, seconds: float) -> None:
        self.time += seconds
