"""The clock of a rank on another host follows the head's: throughout, without steps, never backwards."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from wall.run.clock import DRIFT, REMEMBERED, SLEW, HeadClock

DAY_S = 86400.0
PPM_20 = 20e-6  # how fast the local quartz runs ahead
OFFSET_S = -1e5  # the head's machine started later


class DriftingHost:
    """A local clock that runs 20 ppm fast, and a head that answers pings after random delays."""

    def __init__(self) -> None:
        self.head, self._rng = 2e5, np.random.default_rng(1)
        self.clock = HeadClock(self.local)

    def local(self) -> float:
        return (self.head - OFFSET_S) * (1 + PPM_20)

    def ping(self, shortest: float = 1e-3, jitter: float = 2e-3) -> None:
        there, back = shortest + jitter * self._rng.exponential(size=2)
        sent = self.local()
        self.head += there
        answered = self.head
        self.head += back
        self.clock.learn(sent, answered)

    def error(self) -> float:
        return self.clock.now() - self.head


def test_clock_that_drifts_20_ppm_stays_right_for_a_day() -> None:
    host, every = DriftingHost(), 10.0
    errors = []
    for _ in range(int(DAY_S / every)):
        host.ping()
        host.head += every
        errors.append(abs(host.error()))
    bound = 20e-3 / 2 + (DRIFT + PPM_20) * every * REMEMBERED  # half of a slow round trip, and the age of the best one
    assert max(errors) < bound
    assert np.median(errors) < 3e-3


def test_a_bad_first_measurement_is_slewed_away_without_time_running_backwards() -> None:
    host = DriftingHost()
    host.ping(shortest=0.0, jitter=0.5)
    before = host.error()
    assert abs(before) > 0.05, "a delay on one way alone looks like an offset"
    host.ping(shortest=1e-4, jitter=0.0)
    times, heads = [], []
    for _ in range(1000):
        times.append(host.clock.now())
        heads.append(host.head)
        host.head += 0.02
    steps = np.diff(times) / np.diff(heads)
    assert all(later > earlier for earlier, later in pairwise(times))
    assert np.all(np.abs(steps - 1) <= SLEW * 1.01 + PPM_20)
    assert abs(host.error()) < 1e-3
