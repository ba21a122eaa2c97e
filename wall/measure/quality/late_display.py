"""A display that takes its time: what is made at a refresh becomes light some refreshes later, foreseen or not."""

from __future__ import annotations

from collections import deque

from wall.data import Event, Float32
from wall.geometry.prediction import Predictor
from wall.processes.manager import EVENTS_A_REFRESH


class LateDisplay:
    """It hears of inputs as often as a manager publishes them, while rays are traced under the newest ones."""

    def __init__(self, refresh_hz: float, *, refreshes: int, predicted: bool) -> None:
        """`refreshes`: how many lie between making a picture and seeing it; 0 is at once."""
        self._predictor = Predictor(refreshes / refresh_hz, on=predicted)
        self._pictures: deque[Float32] = deque(maxlen=refreshes + 1)
        self._interval, self._due = 1.0 / (refresh_hz * EVENTS_A_REFRESH), 0.0

    def hear(self, event: Event, time: float) -> None:
        """The newest event at `time` (seconds, growing)."""
        if time >= self._due:
            self._predictor.take(event)
            self._due = time + self._interval

    def expected(self, event: Event, time: float) -> Event:
        """What a picture made at `time`, when `event` is the newest, is to show."""
        self._predictor.take(event)
        return self._predictor.at(time)

    def seen(self, made: Float32) -> Float32:
        """What is seen from now on, when `made` is handed in: the oldest picture under way."""
        self._pictures.append(made if self._pictures.maxlen == 1 else made.copy())
        return self._pictures[0]
