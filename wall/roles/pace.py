"""Let something happen at most so often, on a clock that is only looked at now and then."""

from __future__ import annotations

import math

LATE = 0.5  # intervals between looks: what is due less than so long after one happens at it


class Pace:
    """So many times a second on average, and never more: `begin` says whether it is time."""

    def __init__(self, hz: float, looks_hz: float) -> None:
        """`looks_hz`: how often it is asked about, which is more often than `hz`."""
        self.period, self._early = 1.0 / hz, LATE / looks_hz
        self._due = -math.inf

    def begin(self, now: float, *, force: bool = False) -> bool:
        """Whether it happens now; then the next time is a period later. `force`: it does, due or not."""
        if not force and now < self._due - self._early:
            return False
        self._due = (now if force else max(self._due, now)) + self.period
        return True
