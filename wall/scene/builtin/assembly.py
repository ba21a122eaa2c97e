"""A small workshop for scenes made by code: name materials and meshes, place them, light them, set them going."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wall.config.scene import AnimationConfig, SpinConfig
from wall.core.data import Float64
from wall.scene.animation import Vector
from wall.scene.builtin.shapes import placed
from wall.scene.model import Instance, Light, Material, Mesh, Sky, Source, Texture, TextureSet
from wall.scene.repair import RawMesh


@dataclass(slots=True)
class Assembly:
    """Collects the parts of a Source; materials and meshes are named by the numbers that are returned."""

    meshes: list[Mesh] = field(default_factory=list)
    materials: list[Material] = field(default_factory=list)
    textures: list[Texture] = field(default_factory=list)
    instances: list[Instance] = field(default_factory=list)
    tracks: list[AnimationConfig] = field(default_factory=list)

    def material(self, name: str, color: Vector, mirror: float = 0.0, **others: Any) -> int:
        """Adds a material."""
        self.materials.append(Material(name=name, base_color=color, mirror=mirror, **others))
        return len(self.materials) - 1

    def textured(self, name: str, texels: NDArray[np.uint8]) -> int:
        """Adds a material that shows a texture, (h, w, 3) sRGB."""
        self.textures.append(Texture(name=name, texels=texels))
        return self.material(name, (1.0, 1.0, 1.0), textures=TextureSet(len(self.textures) - 1))

    def mesh(self, name: str, shape: RawMesh, material: int) -> int:
        """Adds a shape as a mesh of a material, with texture coordinates where the material has a texture."""
        uvs = None if self.materials[material].textures.base_color is None else shape.uvs
        self.meshes.append(replace(shape, name=name, uvs=uvs).shaded(material))
        return len(self.meshes) - 1

    def place(self, name: str, mesh: int, world_from_object: Float64) -> None:
        """Adds an instance of a mesh."""
        self.instances.append(Instance(name=name, mesh=mesh, world_from_object=world_from_object))

    def put(self, name: str, shape: RawMesh, material: int, at: Vector = (0.0, 0.0, 0.0)) -> None:
        """Adds a mesh that stands once."""
        self.place(name, self.mesh(name, shape, material), placed(*at))

    def spin(self, objects: str, period_s: float, center: Vector | None = None) -> None:
        """Objects whose names match turn about the y axis of their own or another centre; a negative period: back."""
        axis = (0.0, math.copysign(1.0, period_s), 0.0)
        self.tracks.append(SpinConfig(type="spin", object=objects, axis=axis, period_s=abs(period_s), center=center))

    def source(self, lights: tuple[Light, ...], sky: Sky, *, path_depth: int | None = None) -> Source:
        """All that was added, with these lights and this sky."""
        return Source(
            meshes=tuple(self.meshes),
            materials=tuple(self.materials),
            textures=tuple(self.textures),
            instances=tuple(self.instances),
            lights=lights,
            sky=sky,
            path_depth=path_depth,
            animation=tuple(self.tracks),
        )
