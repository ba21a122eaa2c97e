"""What a batch of a sampler that does not reproject is traced under: its rows, each for the moment when it is shown.

A sample waits for the next refresh of its compositor, half of one on average, for the display's delay and for its row;
then it is seen until the next refresh, and the middle of that time is where its error is least. A double-buffered frame
waits for its last ray too, and is seen as long as the next one takes. What belongs to one image, such as a frame, is
predicted once, so that the image has no seams.
"""

from __future__ import annotations

from contextlib import AbstractContextManager
from typing import Any

from wall.core.data import Event, Float32, Region
from wall.geometry.moving import MovingEvent
from wall.geometry.prediction import foreseen
from wall.roles.plan import Plan, make_predictor
from wall.roles.view import LONGEST_INTERVAL_S, NEWEST_SHARE
from wall.sampling.base import Targets

Parts = list[tuple[Event, Float32]]  # events to trace under, and (n, 2) positions, panel pixels


class RowPrediction:
    """Of one region; its threads share it."""

    def __init__(self, plan: Plan, region: Region, lock: AbstractContextManager[Any]) -> None:
        """`lock` lets one thread in. Raises ValueError for a panel whose rows are all shown at once."""
        scan = plan.layout.panel(region).scan
        if scan is None:
            raise ValueError("a panel without row_time has no moments to predict")
        self._scan, self._predictor = scan, make_predictor(plan, region.view)
        self._period = 1.0 / plan.views[region.view].refresh_hz
        self._lock = lock
        self._image: tuple[tuple[int, int], int] | None = None  # number of its event, and of its frame
        self._expected: MovingEvent | None = None  # of that image; None: nothing moves
        self._began, self._newest = 0.0, 0.0  # when its first and its newest batch were chosen
        self._making, self._interval = 0.0, 0.0  # seconds that a frame takes, and from one to the next, moving means

    def parts(self, targets: Targets, newest: Event, now: float, *, one_image: bool) -> Parts:
        """The positions of a batch in bands of rows, each with the event that it is traced under.

        `one_image`: what is traced under one event, or as one frame, is all predicted for the same moment. The event
        is that of `targets`, the same object, where nothing is expected to move.
        """
        with self._lock:
            expected = self._expected_of(targets, newest, now, one_image=one_image)
        if expected is None:
            return [(targets.event, targets.xy)]
        bands = self._scan.bands(targets.xy) or [(0.0, targets.xy)]
        return [(foreseen(targets.event, expected.after(seconds)), xy) for seconds, xy in bands]

    def rests(self, newest: Event, now: float) -> bool:
        """Whether nothing is expected to move; then what was predicted before is forgotten."""
        with self._lock:
            self._predictor.take(newest)
            rests = not isinstance(self._predictor.at(now), MovingEvent)
            if rests:
                self._image = None
            return rests

    def _expected_of(self, targets: Targets, newest: Event, now: float, *, one_image: bool) -> MovingEvent | None:
        """What is expected when the first row is seen; None: nothing moves."""
        self._predictor.take(newest)
        image = (targets.event.number, targets.frame)
        if one_image and image == self._image:
            self._newest = now
            if targets.frame or isinstance(self._predictor.at(now), MovingEvent):
                return self._expected
            self._expected = None
            return None
        if targets.frame and now - self._began < LONGEST_INTERVAL_S:
            self._making += NEWEST_SHARE * (self._newest - self._began - self._making)
            self._interval += NEWEST_SHARE * (now - self._began - self._interval)
        self._image, self._began, self._newest = image, now, now
        seen = 0.5 * max(self._interval, self._period)
        expected = self._predictor.at(now, self._making + 0.5 * self._period + seen)
        self._expected = expected if isinstance(expected, MovingEvent) else None
        return self._expected
