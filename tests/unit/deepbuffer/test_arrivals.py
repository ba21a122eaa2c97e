"""What is counted of the samples that came for a deep buffer."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from wall.core.data import SAMPLE, Batch, Rect
from wall.deepbuffer.arrivals import NEVER, Arrivals


def batch(xy: ArrayLike, *, time: float, event: int = 1) -> Batch:
    places = np.asarray(xy, np.float32).reshape(-1, 2)
    samples = np.zeros(len(places), SAMPLE)
    samples["xy"], samples["time"] = places, 0.25
    return Batch(
        view=0, panel=0, rect=Rect(x=0, y=0, width=2, height=1), rank=1, sequence=1, camera_event=event, scene_event=0,
        base_time=time - 0.25, samples=samples, adaptive=True,
    )  # fmt: skip


def test_the_oldest_pixel_is_the_one_whose_newest_sample_is_the_oldest() -> None:
    arrivals = Arrivals(2, 1)
    arrivals.note(batch([(0.5, 0.5)], time=3.0))
    assert arrivals.oldest_sample(4.0) == np.inf, "one pixel never had a sample"

    arrivals.note(batch([(1.5, 0.5), (0.2, 0.2)], time=2.0))

    assert arrivals.oldest_sample(4.0) == 2.0
    assert arrivals.samples_shown == 3


def test_samples_outside_the_panel_are_told_and_do_not_count() -> None:
    arrivals = Arrivals(2, 1)
    assert arrivals.note(batch([(-0.5, 0.5), (2.0, 0.5), (0.5, np.nan)], time=3.0)) == 3
    assert (arrivals.samples_shown, arrivals.newest_event) == (0, NEVER)


def test_the_newest_event_stays_when_an_older_one_comes_late() -> None:
    arrivals = Arrivals(2, 1)
    for event in (4, 3):
        arrivals.note(batch([(0.5, 0.5)], time=3.0, event=event))
    assert arrivals.newest_event == (4, 0)
    assert arrivals.note(batch([], time=3.0, event=9)) == 0
    assert arrivals.newest_event == (4, 0), "a batch without samples shows nothing"
