"""When stored samples may lie where a scene is cut away, and the planes in the frames of the samples' objects."""

from __future__ import annotations

import numpy as np

from wall.core.data import Float32
from wall.deepbuffer.pose import Posed
from wall.scene.build import Scene
from wall.scene.cuts import planes_of
from wall.scene.model import Moment


class CutTracker:
    """Tracks the cuts of one image: objects and cuts move, and samples come that saw them elsewhere."""

    def __init__(self, scene: Scene) -> None:
        self.used = bool(scene.cuts)
        self._scene = scene
        self._shown: Moment | None = None
        self._due = False

    def show(self, event: Posed) -> None:
        """Show `event` from now on."""
        if self.used:
            shown, self._shown = self._shown, self._scene.at(event.scene_time, event.edits)
            self._due |= shown is not self._shown

    def note(self, event: Posed) -> None:
        """Samples come that were traced under `event`."""
        self._due = self._due or (self.used and self._scene.at(event.scene_time, event.edits) is not self._shown)

    def take(self) -> Float32 | None:
        """Planes, see planes_in_objects, of the event shown; None where no stored sample lies beyond one.

        The answer is given once: the samples beyond them are to be rejected.
        """
        due, self._due = self._due, False
        if not due or self._shown is None or not any(cut.enabled for cut in self._shown.shading.cuts):
            return None
        return planes_in_objects(self._shown)


def planes_in_objects(moment: Moment) -> Float32:
    """(n + 1, k, 4) float32: the k planes of `planes_of` in the frame of every object; row 0, the sky, is never cut."""
    planes, placed = planes_of(moment.shading.cuts, np.zeros(3)), moment.world_from_object
    found = np.zeros((len(placed) + 1, len(planes), 4), np.float32)
    found[0, :, 3] = 1.0
    found[1:, :, :3] = planes[:, :3] @ placed[:, :3, :3]
    found[1:, :, 3] = planes[:, 3] - placed[:, :3, 3] @ planes[:, :3].T
    return found
