"""One scene as several views show it: the same objects and lights, another integrator or another lens."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

from wall.geometry.lens import Lens
from wall.scene.build import Scene
from wall.scene.model import AmbientOcclusion


class Way(NamedTuple):
    """All in which views of one scene may differ, but for cameras."""

    path_depth: int | None  # as in Scene
    occlusion: AmbientOcclusion | None
    lens: Lens | None


def way_of(scene: Scene) -> Way:
    """How a scene is shown."""
    return Way(scene.path_depth, scene.occlusion, scene.lens)


def shown_by(scene: Scene, way: Way) -> Scene:
    """The scene shown in another way; the same object where it is shown so already."""
    return scene if way_of(scene) == way else replace(scene, **way._asdict())
