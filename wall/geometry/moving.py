"""An event with the motion that is expected of it: what a display that lights one row after the other shows."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from wall.core.data import Event
from wall.geometry.twist import moved


@dataclass(frozen=True, slots=True, kw_only=True)
class MovingEvent(Event):
    """A predicted event, and how it goes on from its moment."""

    twist: tuple[float, ...]  # (6,) a second, in the camera's own frame; see geometry.twist
    scene_rate: float  # seconds of the animation a second

    def after(self, seconds: float) -> MovingEvent:
        """The event so many seconds later, at constant speed. Its number stays."""
        camera = moved(self.camera, seconds * np.array(self.twist))
        return replace(self, camera=camera, scene_time=self.scene_time + seconds * self.scene_rate)


def later(event: Event, seconds: float) -> Event:
    """An event so many seconds later; the same object where nothing is expected to move."""
    return event.after(seconds) if isinstance(event, MovingEvent) else event
