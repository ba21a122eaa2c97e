"""Which stored samples an edit of the shading makes doubtful, where they cannot be lit anew exactly.

Direct light: a surface's samples depend on the lights, the sky and its own material; a mirror's on everything. On paths
every sample depends on everything, the lens too: another one shows other surfaces in a pixel.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from wall.scene.build import Scene
from wall.scene.model import Cut, Material, Shading


class ShadingChanges:
    """Compares the shadings of two moments of one scene, object by object; 0 is the background."""

    def __init__(self, scene: Scene) -> None:
        materials = [scene.meshes[instance.mesh].material for instance in scene.instances]
        self._material = np.array([-1, *materials], np.int64)  # (n + 1,)
        self._mirrors = self.mirrors(scene.materials)
        self._paths, self._lit = scene.path_depth is not None, scene.occlusion is None

    def mirrors(self, materials: Sequence[Material]) -> NDArray[np.bool_]:
        """(n + 1,) bool: objects that are mirrors under these materials of the scene."""
        return np.array([False, *(materials[k].mirror > 0.0 for k in self._material[1:].tolist())])

    def between(self, now: Shading, was: Shading, relit: NDArray[np.bool_]) -> NDArray[np.uint8] | None:
        """(n + 1,) uint8: objects whose samples are doubtful under `now` if they were traced under `was`.

        None where both are the same. relit : (n + 1,) bool, objects whose samples are lit anew
        """
        if now is was:
            return None
        doubted = np.zeros(len(self._material), np.bool_)
        pairs = zip(now.materials, was.materials, strict=True)
        materials = [k for k, (new, old) in enumerate(pairs) if new is not old and new != old]
        sky = (now.sky, now.environment_strength) != (was.sky, was.environment_strength)
        light = self._lit and now.lights != was.lights
        way = [(of.path_depth, of.lens, of.occlusion_distance) for of in (now, was)]
        objects = now.objects != was.objects
        cuts = cutting(now) != cutting(was)
        if not (materials or sky or light or objects or cuts or way[0] != way[1]):
            return None
        if self._paths or objects or cuts:  # of shadows and of what was behind, no sample knows
            return np.ones_like(doubted, np.uint8)
        if sky or light:
            shadows = places_of(now) != places_of(was)  # may have moved: no sample knows
            doubted |= True if shadows else ~relit
            doubted[0] = sky
        if materials:
            doubted |= np.isin(self._material, materials) | self._mirrors
        return doubted.astype(np.uint8)


def cutting(shading: Shading) -> list[Cut]:
    """The cuts that cut anything away."""
    return [cut for cut in shading.cuts if cut.enabled]


def places_of(shading: Shading) -> tuple[tuple[float, float, float], ...]:
    """Where every light is."""
    return (
        *(light.position for light in shading.point_lights),
        *(light.position for light in shading.spot_lights),
        *(light.direction for light in shading.spot_lights),
        *(light.direction for light in shading.directional_lights),
    )
