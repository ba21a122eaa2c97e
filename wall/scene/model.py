"""A scene as plain arrays: what the tracer reads, whatever file it came from.

Meshes are stored about their own origin, so that float32 vertices keep their precision wherever the object
stands; every placement is a float64 matrix `world_from_object`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from wall.config.scene import AnimationConfig
from wall.core.data import Float32, Float64

LARGEST_IOR = 4.0  # index of refraction that files may give


@dataclass(frozen=True, slots=True, kw_only=True)
class Texture:
    """An image that a material's base colour is multiplied by.

    Lookups are bilinear and repeat.
    """

    name: str
    texels: NDArray[np.uint8]  # (h, w, 3) sRGB, row 0 at the top (v = 1)


@dataclass(frozen=True, slots=True, kw_only=True)
class Material:
    """What a surface looks like. `direct` light knows it as diffuse with a share of mirror; paths know all of it.

    A new property goes here and into tracing.kernels.values.MATERIAL; tracing.kernels.scatter reads it.
    """

    name: str
    base_color: tuple[float, float, float] = (0.8, 0.8, 0.8)  # linear RGB reflectance, 0..1
    texture: int | None = None  # index in Scene.textures; multiplies base_color
    mirror: float = 0.0  # share of the ray that is mirrored, 0..1
    emission: tuple[float, float, float] = (0.0, 0.0, 0.0)  # W sr^-1 m^-2; lights others on paths alone
    emits_behind: bool = (
        True  # also from the back, on paths; the front is where a triangle's corners go counterclockwise
    )
    metallic: float = 0.0  # 0..1, as in glTF
    roughness: float = 1.0  # 0..1, of the interface; GGX with alpha = roughness squared
    specular: float = 0.0  # 0..1, how much of an interface lies over diffuse light; 0: none
    ior: float = 1.5  # index of refraction, of glass and of the interface
    transmission: float = 0.0  # share that is glass, 0..1


@dataclass(frozen=True, slots=True, kw_only=True)
class Mesh:
    """A triangle mesh in object space with one material; it may be placed many times."""

    name: str
    vertices: Float32  # (v, 3) object space, relative to `origin`
    triangles: NDArray[np.uint32]  # (t, 3)
    material: int  # index in Scene.materials
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0)  # add to vertices, object space; zero in a Scene
    normals: Float32 | None = None  # (v, 3) unit shading normals; None = flat
    uvs: Float32 | None = None  # (v, 2), v up
    colors: Float32 | None = None  # (v, 3) linear RGB, multiplies base_color


@dataclass(frozen=True, slots=True, kw_only=True)
class Instance:
    """A mesh placed in the world. Instance k of a scene has object id k + 1, uint32, so ids never wrap."""

    name: str
    mesh: int  # index in Scene.meshes
    world_from_object: Float64  # (4, 4), affine, at scene time 0 before animation


@dataclass(frozen=True, slots=True, kw_only=True)
class PointLight:
    """A light that shines from one point in all directions."""

    position: tuple[float, float, float]  # world
    intensity: tuple[float, float, float]  # linear RGB, W sr^-1


@dataclass(frozen=True, slots=True, kw_only=True)
class DirectionalLight:
    """A light infinitely far away, as the sun."""

    direction: tuple[float, float, float]  # world, unit, from the surface towards the light
    irradiance: tuple[float, float, float]  # linear RGB, W m^-2 on a facing surface


Light: TypeAlias = PointLight | DirectionalLight


@dataclass(frozen=True, slots=True, kw_only=True)
class Sky:
    """Radiance by height of the direction: ground below, horizon at 0, zenith above (linear blend in y)."""

    zenith: tuple[float, float, float] = (0.35, 0.55, 0.95)
    horizon: tuple[float, float, float] = (0.9, 0.95, 1.0)
    ground: tuple[float, float, float] = (0.25, 0.23, 0.2)


@dataclass(frozen=True, slots=True, kw_only=True)
class Source:
    """What a file or a scene function gives, before the configuration adds to it; None = does not say."""

    meshes: tuple[Mesh, ...]
    materials: tuple[Material, ...]
    instances: tuple[Instance, ...]
    textures: tuple[Texture, ...] = ()
    lights: tuple[Light, ...] | None = None
    sky: Sky | None = None
    animation: tuple[AnimationConfig, ...] = ()
    path_depth: int | None = None  # most surfaces that scatter a path; None: direct light alone
    notes: tuple[str, ...] = ()  # each repair or assumption, for a reader


@dataclass(frozen=True, slots=True, kw_only=True)
class Shading:
    """How the scene is lit and what surfaces look like: all that parameters change (scene.parameters).

    What an edit leaves as it was stays the same object.
    """

    point_lights: tuple[PointLight, ...]
    directional_lights: tuple[DirectionalLight, ...]
    sky: Sky
    materials: tuple[Material, ...]
    path_depth: int | None  # most surfaces that scatter a path; None: direct light alone


@dataclass(frozen=True, slots=True, kw_only=True)
class Moment:
    """Everything that moves or can be edited, at one scene time under one state of edits."""

    world_from_object: Float64  # (instances, 4, 4)
    point_positions: Float64  # (point lights, 3)
    directions: Float64  # (directional lights, 3) unit
    shading: Shading
