"""Lights in the frames of all objects at one moment, and which objects stand in another light than before."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wall.core.data import Float32
from wall.deepbuffer.kernels.lights import light_tables
from wall.scene.build import Scene
from wall.scene.model import Moment
from wall.scene.sky import sky_irradiance


class ObjectLights(NamedTuple):
    """The lights of one moment as every object sees them; see light_tables."""

    rows: Float32  # (n + 1, lights, 6): directional lights first, then point lights
    directional: int
    up: Float32  # (n + 1, 3)
    sky: Float32 = np.zeros((0, 3), np.float32)  # (k, 3) irradiance by the normal's height

    @classmethod
    def at(cls, scene: Scene, moment: Moment) -> ObjectLights:
        """The scene's lights at `moment`."""
        n, shading = len(scene.instances), moment.shading
        directional, points = shading.directional_lights, shading.point_lights
        rows, up = np.empty((n + 1, len(directional) + len(points), 6), np.float32), np.empty((n + 1, 3), np.float32)
        light_tables(
            moment.world_from_object, moment.directions,
            np.array([light.irradiance for light in directional]).reshape(-1, 3),
            moment.point_positions, np.array([light.intensity for light in points]).reshape(-1, 3), rows, up,
        )  # fmt: skip
        return cls(rows, len(directional), up, sky_irradiance(shading.sky))

    @property
    def relightable(self) -> NDArray[np.bool_]:
        """(n + 1,) bool: objects in whose frame the lights are known."""
        return np.asarray(self.up.any(axis=1))


NO_LIGHTS = ObjectLights(np.zeros((0, 0, 6), np.float32), 0, np.zeros((0, 3), np.float32))


class Diffuse(NamedTuple):
    """What can be lit anew: objects that only reflect diffusely, and the sky's light on them."""

    objects: NDArray[np.uint8]  # (n + 1,) 1: neither the sky, nor a mirror, nor glowing
    sky_irradiance: Float32  # (k, 3) by the normal's height

    @classmethod
    def of(cls, scene: Scene) -> Diffuse:
        """The diffuse objects of a scene."""
        materials = [scene.materials[scene.meshes[i.mesh].material] for i in scene.instances]
        diffuse = [m.mirror == 0.0 and max(m.emission) == 0.0 for m in materials]
        return cls(np.array([0, *diffuse], np.uint8), sky_irradiance(scene.sky))


class LightChanges:
    """Tells which objects' stored samples are to be lit anew at a refresh.

    Those in another light than at the refresh before, and those that got samples of another light than the image's
    since: even if no light moves any more.
    """

    def __init__(self, diffuse: NDArray[np.uint8]) -> None:
        """`diffuse`: see Diffuse.objects."""
        self._diffuse = diffuse
        self._late = np.zeros_like(diffuse)
        self._noted: ObjectLights | None = None

    def note(self, lights: ObjectLights, shown: ObjectLights) -> None:
        """Samples came that were traced under `lights`; the image shows the light of `shown`."""
        if lights is not self._noted:
            self._noted = lights
            self._late |= self._between(lights, shown)

    def take(self, now: ObjectLights, was: ObjectLights | None) -> NDArray[np.uint8]:
        """(n + 1,) uint8, for a refresh under `now` after one under `was`; what was noted is forgotten."""
        changed: NDArray[np.uint8] = self._between(now, was) | self._late
        self._late[:], self._noted = 0, None
        return changed

    def _between(self, now: ObjectLights, was: ObjectLights | None) -> NDArray[np.uint8]:
        """(n + 1,) uint8: diffuse objects in another light than before; all if nothing was before."""
        if was is None:
            return self._diffuse.copy()
        if was is now:
            return np.zeros_like(self._diffuse)
        moved = (now.rows != was.rows).any(axis=(1, 2)) | (now.up != was.up).any(axis=1)
        if now.sky is not was.sky:
            moved |= now.relightable
        changed: NDArray[np.uint8] = self._diffuse & moved
        return changed
