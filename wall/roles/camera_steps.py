"""Whether a camera may have jumped: to look which stored samples it still sees takes longer than most of an event."""

from __future__ import annotations

import math

from wall.core.data import Camera

LONGER = 1.25  # than the step before: then a look is taken
LOOK_EVERY = 4  # steps, at the least: one of 2.5 times the speed may pass until then


class CameraSteps:
    """How far a camera went from one event to the next."""

    def __init__(self) -> None:
        self._moved = self._turned = 0.0
        self._passed = 0  # since the last look

    def ask_for_a_look(self, before: Camera, now: Camera) -> bool:
        """Whether to look after this step: it is longer than the one before, or no look was taken for some time."""
        moved = math.dist(before.position, now.position)
        turned = math.dist(before.world_from_wall, now.world_from_wall)
        longer = moved > LONGER * self._moved or turned > LONGER * self._turned
        self._moved, self._turned, self._passed = moved, turned, self._passed + 1
        if longer or self._passed >= LOOK_EVERY:
            self._passed = 0
            return True
        return False
