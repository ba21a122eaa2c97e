"""A framelet's times stay exact over days of refreshes."""

import numpy as np

from wall.core.data import Framelet, Rect

REFRESHES = 1_000_000
REFRESH_S = 1.0 / 60.0


def test_times_do_not_drift_over_a_million_refreshes() -> None:
    """float32 holds an age of a s to spacing(a); moving the origin adds nothing that grows with the refreshes."""
    framelet = Framelet.blank(Rect(x=0, y=0, width=4, height=1), frozenset({"time"}))
    assert framelet.time is not None
    start = 1000.0
    framelet.stamp(start)
    traced = np.array([start - 1.0, start - 0.125, start, -np.inf])
    framelet.time[0] = traced - framelet.time_origin
    for k in range(REFRESHES):
        framelet.stamp(start + (k + 1) * REFRESH_S)
    ages = start + REFRESHES * REFRESH_S - traced
    found = framelet.time_origin + framelet.time[0].astype(np.float64)
    np.testing.assert_array_less(np.abs(found[:3] - traced[:3]), np.spacing(ages[:3].astype(np.float32)))
    assert found[3] == -np.inf
