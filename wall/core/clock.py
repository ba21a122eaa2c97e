"""Time as an argument: what a clock is, and one that tests and the single process turn by hand."""

from __future__ import annotations

from typing import Protocol


class Clock(Protocol):
    """What tells the time to those who must not read it themselves."""

    def now(self) -> float:
        """Seconds of the head's monotonic clock."""
        ...


class ManualClock:
    """A clock that stands still until it is advanced."""

    def __init__(self, start: float = 0.0) -> None:
        self.time = start

    def now(self) -> float:
        """The time it was advanced to, seconds."""
        return self.time

    def advance(self, seconds: float) -> None:
        """Turn it forwards."""
        self.time += seconds
