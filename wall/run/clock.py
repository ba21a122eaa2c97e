"""The real clock: this machine's monotonic clock on the timeline of the head's."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable
from typing import NamedTuple

SLEW = 0.05  # seconds of correction a second: time keeps running forwards, and an error of 50 ms is gone in a second
DRIFT = 1e-4  # seconds a second by which an old measurement may be wrong: quartz clocks are within 100 ppm
REMEMBERED = 16  # round trips; the best of them counts


class RoundTrip(NamedTuple):
    """One measurement of the difference between the head's clock and the local one."""

    back: float  # local time when the answer came
    seconds: float  # from question to answer
    offset: float  # head's clock minus local clock, wrong by at most half of `seconds` then

    def error(self, local: float) -> float:
        """The largest error of `offset` at a local time, seconds."""
        return self.seconds / 2 + DRIFT * (local - self.back)


class HeadClock:
    """This machine's monotonic clock, corrected to the head's by round trips. On the head's own host nothing is learnt.

    The first round trip sets the offset. Later ones change it by at most SLEW seconds a second, so that time never
    runs backwards. Any thread may read it; one thread calls `learn`.
    """

    def __init__(self, local: Callable[[], float] = time.monotonic) -> None:
        self._local = local
        self._slew = (0.0, 0.0, 0.0)  # offset then, local time then, offset wanted; replaced as a whole
        self._trips: deque[RoundTrip] = deque(maxlen=REMEMBERED)

    def now(self) -> float:
        """Seconds of the head's monotonic clock."""
        local = self._local()
        return local + self._offset(local)

    def learn(self, sent: float, head_time: float) -> None:
        """Take a round trip into account: a ping sent at `sent` (local time) came back with the head's time."""
        back = self._local()
        first = not self._trips
        self._trips.append(RoundTrip(back, back - sent, head_time - (sent + back) / 2))
        wanted = min(self._trips, key=lambda trip: trip.error(back)).offset
        self._slew = (wanted if first else self._offset(back), back, wanted)

    @property
    def known(self) -> bool:
        """Whether a round trip has been measured."""
        return bool(self._trips)

    def _offset(self, local: float) -> float:
        then, since, wanted = self._slew
        most = SLEW * max(0.0, local - since)
        return then + min(max(wanted - then, -most), most)
