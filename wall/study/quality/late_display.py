"""A display that takes its time: what is made at a refresh becomes light some refreshes later, foreseen or not."""

from __future__ import annotations

from collections import deque

from wall.core.data import Event, Float32
from wall.geometry.prediction import Predictor, foreseen
from wall.roles.manager import EVENTS_A_REFRESH


class LateDisplay:
    """It hears of inputs as often as a manager publishes them."""

    def __init__(self, refresh_hz: float, *, refreshes: int, predicted: bool, ahead: bool) -> None:
        """`refreshes`: how many lie between making a picture and seeing it, 0 is none; `predicted`: pictures are made
        for when they are seen; `ahead`: rays are traced for that moment as well."""
        self._predictor, self._ahead = Predictor(refreshes / refresh_hz, on=predicted), ahead and predicted
        self._pictures: deque[Float32] = deque(maxlen=refreshes + 1)
        self._interval, self._due = 1.0 / (refresh_hz * EVENTS_A_REFRESH), 0.0
        self._foreseen: Event | None = None

    def traced(self, event: Event, time: float) -> Event:
        """What rays are traced under at `time` (seconds, growing), when `event` is the newest."""
        if self._foreseen is None or time >= self._due:
            self._due = time + self._interval
            self._foreseen = foreseen(event, self.made(event, time))
        return self._foreseen if self._ahead else event

    def made(self, event: Event, time: float) -> Event:
        """What a picture made at `time`, when `event` is the newest, is to show."""
        self._predictor.take(event)
        return self._predictor.at(time)

    def seen(self, made: Float32) -> Float32:
        """What is seen from now on, when `made` is handed in: the oldest picture under way."""
        self._pictures.append(made if self._pictures.maxlen == 1 else made.copy())
        return self._pictures[0]
