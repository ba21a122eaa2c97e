"""Which picture a renderer showed at each moment: the last that was complete, until the next one is.

Pure: told of pictures in the order of their completion. Only those that a moment shows are kept.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from wall.geometry.panels import Panel
from wall.study.peers.drawing import Codes


class Held:
    """Takes pictures as they are completed, and keeps what each moment shows; black before the first."""

    def __init__(self, moments: Sequence[float], size: tuple[int, int]) -> None:
        """`moments`: growing, seconds of the camera's path; `size`: width, height."""
        self._moments, self._held = tuple(moments), np.zeros((size[1], size[0], 3), np.uint8)
        self.shown: list[Codes] = []  # of the moments that are over
        self.completed: list[float] = []

    def take(self, image: Codes, time: float) -> None:
        """A picture that was complete at `time`."""
        self._pass(time)
        self._held = image
        self.completed.append(time)

    def end(self) -> None:
        """The last picture is shown at all moments that are left."""
        self._pass(float("inf"))

    def _pass(self, time: float) -> None:
        while len(self.shown) < len(self._moments) and self._moments[len(self.shown)] < time:
            self.shown.append(self._held)


class Pictures:
    """Pictures of moments, as `scores.score` asks for them."""

    def __init__(self, moments: Sequence[float], shown: Sequence[Codes]) -> None:
        self._shown = dict(zip(moments, shown, strict=True))

    def codes(self, panel: Panel, time: float) -> Codes:
        """(h, w, 3) uint8 sRGB that the one panel showed at a moment."""
        return self._shown[time]
