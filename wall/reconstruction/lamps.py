"""Lamps where every object sees them, and who can be lit anew."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wall.core.data import Float32
from wall.reconstruction.kernels import relight as kernels_relight
from wall.scene.build import Scene
from wall.scene.model import Moment


class Lamps(NamedTuple):
    """Lamps in the frames of all objects at one moment; see kernels_relight.lamp_tables."""

    lamps: Float32  # (n + 1, lamps, 6)
    suns: int
    up: Float32  # (n + 1, 3)

    @classmethod
    def at(cls, scene: Scene, moment: Moment) -> Lamps:
        n, suns, points = len(scene.instances), scene.directional_lights, scene.point_lights
        lamps, up = np.empty((n + 1, len(suns) + len(points), 6), np.float32), np.empty((n + 1, 3), np.float32)
        kernels_relight.lamp_tables(
            moment.world_from_object, moment.directions, np.array([s.irradiance for s in suns]).reshape(-1, 3),
            moment.point_positions, np.array([p.intensity for p in points]).reshape(-1, 3), lamps, up,
        )  # fmt: skip
        return cls(lamps, len(suns), up)


NO_LAMPS = Lamps(np.zeros((0, 0, 6), np.float32), 0, np.zeros((0, 3), np.float32))


def matt_objects(scene: Scene) -> NDArray[np.uint8]:
    """(n + 1,) uint8: objects whose colour is surface colour times light: no sky, no mirrors, nothing that glows."""
    materials = [scene.materials[scene.meshes[i.mesh].material] for i in scene.instances]
    return np.array([0, *(m.mirror == 0.0 and max(m.emission) == 0.0 for m in materials)], np.uint8)


def relit_objects(matt: NDArray[np.uint8], now: Lamps, was: Lamps | None) -> NDArray[np.uint8]:
    """(n + 1,) uint8: which of the `matt` objects stand in another light than before; all if nothing was before."""
    if was is None:
        return matt.copy()
    if was is now:
        return np.zeros_like(matt)
    relit: NDArray[np.uint8] = matt & ((now.lamps != was.lamps).any(axis=(1, 2)) | (now.up != was.up).any(axis=1))
    return relit


class Relit:
    """Which objects' stored samples are to be lit anew at a refresh.

    Those in another light than at the refresh before, and those that have got samples of another light than the
    picture's since: even if no lamp moves any more.
    """

    def __init__(self, matt: NDArray[np.uint8]) -> None:
        """`matt`: see matt_objects."""
        self._matt = matt
        self._late = np.zeros_like(matt)
        self._noted: Lamps | None = None

    def note(self, lamps: Lamps, shown: Lamps) -> None:
        """Samples came that were traced under `lamps`; the picture shows the light of `shown`."""
        if lamps is not self._noted:
            self._noted = lamps
            self._late |= relit_objects(self._matt, lamps, shown)

    def take(self, now: Lamps, was: Lamps | None) -> NDArray[np.uint8]:
        """(n + 1,) uint8, for a refresh under `now` after one under `was`; what was noted is forgotten."""
        changed: NDArray[np.uint8] = relit_objects(self._matt, now, was) | self._late
        self._late[:], self._noted = 0, None
        return changed
