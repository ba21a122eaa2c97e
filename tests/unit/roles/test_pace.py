"""So many times a second, however the looks at the clock fall."""

from __future__ import annotations

import random
from itertools import pairwise

import pytest

from wall.roles.pace import Pace


@pytest.mark.parametrize("late_s", [0.0, 0.003, 0.012])
def test_it_happens_as_often_as_asked_and_no_more(late_s: float) -> None:
    """60 looks a second, each late by up to some milliseconds."""
    pace, rng = Pace(10.0, 60.0), random.Random(1)
    times = [now for k in range(600) if pace.begin(now := k / 60 + rng.uniform(0.0, late_s))]
    assert 98 <= len(times) <= 100
    assert min(b - a for a, b in pairwise(times)) > 0.08


def test_after_a_pause_nothing_is_caught_up_with() -> None:
    pace = Pace(10.0, 60.0)
    assert pace.begin(0.0)
    assert pace.begin(5.0)
    assert not pace.begin(5.05)


def test_what_is_forced_counts() -> None:
    pace = Pace(10.0, 60.0)
    assert all(pace.begin(k / 60, force=True) for k in range(30))
    assert not pace.begin(30 / 60)
    assert pace.begin(35 / 60)
