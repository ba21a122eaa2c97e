"""A scene as plain arrays: what the tracer reads, whatever file it came from.

Meshes are stored about their own origin, so that float32 vertices keep their precision wherever the object
stands; every placement is a float64 matrix `world_from_object`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from wall.core.data import Float32, Float64
from wall.geometry.lens import Lens, NamedCamera
from wall.scene.animation import Moving
from wall.scene.series import Series

if TYPE_CHECKING:
    from wall.config.scene import AnimationConfig

DARKEST_LEFT, SHORTEST_WAY = 1e-6, 1e-9  # that absorption is known by: a colour, world units; less counts as this
SHARPEST_SPOT = 1e-3  # between the cosines of a spot's angles, as glTF says
Wrap: TypeAlias = Literal["repeat", "clamp", "mirror"]
AlphaMode: TypeAlias = Literal["opaque", "mask", "blend"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Texture:
    """An image of what a material is at each place of a surface. Lookups are filtered."""

    name: str
    texels: NDArray[np.uint8]  # (h, w, 3), row 0 at the top (v = 1); sRGB, or values 0..1 as bytes where `linear`
    linear: bool = False
    alpha: NDArray[np.uint8] | None = None  # (h, w) as bytes; None: opaque
    wrap: tuple[Wrap, Wrap] = ("repeat", "repeat")  # beyond its edges, along u and v
    uv_set: int = 0  # which pair of a mesh's texture coordinates it is looked up by


class TextureSet(NamedTuple):
    """A material's textures, as indices in Scene.textures."""

    base_color: int | None = None  # multiplies base_color
    metallic_roughness: int | None = None  # linear; green multiplies roughness, blue metallic; on paths alone
    emission: int | None = None  # multiplies emission
    normal: int | None = None  # linear; normals along u, along v and off the surface, 0..1 for -1..1


NO_TEXTURES = TextureSet()


@dataclass(frozen=True, slots=True, kw_only=True)
class Material:
    """What a surface looks like. `direct` light knows it as diffuse with a share of mirror; paths know all of it.

    A new property goes here and into tracing.kernels.values.MATERIAL; tracing.kernels.scatter reads it.
    """

    name: str
    base_color: tuple[float, float, float] = (0.8, 0.8, 0.8)  # linear RGB reflectance, 0..1
    mirror: float = 0.0  # share of the ray that is mirrored, 0..1
    emission: tuple[float, float, float] = (0.0, 0.0, 0.0)  # W sr^-1 m^-2; lights others on paths alone
    emits_behind: bool = True  # also from the back, on paths; the front sees a triangle's corners counterclockwise
    metallic: float = 0.0  # 0..1, as in glTF
    roughness: float = 1.0  # 0..1, of the interface; GGX with alpha = roughness squared
    specular: float = 0.0  # 0..1, how much of an interface lies over diffuse light; 0: none
    ior: float = 1.5  # index of refraction, of glass and of the interface
    transmission: float = 0.0  # share that is glass, 0..1
    thin: bool = False  # glass is a sheet: light goes straight on
    attenuation_color: tuple[float, float, float] = (1.0, 1.0, 1.0)  # 0..1, of white light after attenuation_distance
    attenuation_distance: float = math.inf  # world units of way inside glass that is not thin
    textures: TextureSet = NO_TEXTURES
    normal_scale: float = 1.0  # of the parts along u and v of the normals of textures
    alpha_mode: AlphaMode = "opaque"  # mask: not there where alpha < alpha_cutoff; blend: there with probability alpha
    alpha: float = 1.0  # 0..1; times the alpha of the texture of base colour
    alpha_cutoff: float = 0.5

    @property
    def absorption(self) -> tuple[float, float, float]:
        """What glass takes of light, RGB per world unit of way inside it: exp(-absorption d) is left (Beer-Lambert)."""
        if self.transmission <= 0.0 or self.thin:
            return 0.0, 0.0, 0.0
        distance = max(self.attenuation_distance, SHORTEST_WAY)
        r, g, b = (-math.log(max(c, DARKEST_LEFT)) / distance for c in self.attenuation_color)
        return r, g, b


@dataclass(frozen=True, slots=True, kw_only=True)
class Mesh:
    """Triangles, spheres, or curves, in object space with one material; it may be placed many times."""

    name: str
    vertices: Float32  # (v, 3) object space, relative to `origin`
    triangles: NDArray[np.uint32]  # (t, 3)
    material: int  # index in Scene.materials
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0)  # add to vertices, object space; zero in a Scene
    normals: Float32 | None = None  # (v, 3) unit shading normals; None = flat
    uvs: Float32 | None = None  # (v, 2 n), n sets of u and v, v up
    colors: Float32 | None = None  # (v, 3) linear RGB, multiplies base_color
    spheres: Float32 | None = None  # (v, 4) centres, which are the vertices, and radii; None: triangles
    segments: NDArray[np.uint32] | None = None  # (s,) of curves: the first of two vertices; None: spheres are apart

    @property
    def primitives(self) -> int:
        """How many triangles, spheres or segments of curves it has."""
        if self.segments is not None:
            return len(self.segments)
        return len(self.triangles) if self.spheres is None else len(self.spheres)

    def uvs_of(self, texture: Texture) -> Float32 | None:
        """(v, 2), the texture coordinates that `texture` is looked up by; None: the mesh has none."""
        return None if self.uvs is None else self.uvs[:, 2 * texture.uv_set :][:, :2]


@dataclass(frozen=True, slots=True, kw_only=True)
class Instance:
    """A mesh placed in the world. Instance k of a scene has object id k + 1, uint32, so ids never wrap."""

    name: str
    mesh: int  # index in Scene.meshes
    world_from_object: Float64  # (4, 4), affine, at scene time 0 before animation
    parents: tuple[str, ...] = ()  # names of objects that take it along where they are moved, turned or hidden


@dataclass(frozen=True, slots=True, kw_only=True)
class PointLight:
    """A light that shines from one point in all directions."""

    position: tuple[float, float, float]  # world
    intensity: tuple[float, float, float]  # linear RGB, W sr^-1


@dataclass(frozen=True, slots=True, kw_only=True)
class SpotLight:
    """A light that shines from one point into a cone, fading from an inner angle to an outer one."""

    position: tuple[float, float, float]  # world
    direction: tuple[float, float, float]  # world, unit, in which it shines
    intensity: tuple[float, float, float]  # linear RGB, W sr^-1, along its direction
    inner_angle: float  # degrees from the direction: full intensity up to here
    outer_angle: float  # degrees, above the inner one, at most 90: no light from here on

    @property
    def falloff(self) -> tuple[float, float]:
        """a, b of the share of intensity at an angle, clamp(a cos(angle) + b, 0, 1)^2 (KHR_lights_punctual)."""
        inner, outer = math.cos(math.radians(self.inner_angle)), math.cos(math.radians(self.outer_angle))
        scale = 1.0 / max(SHARPEST_SPOT, inner - outer)
        return scale, -outer * scale


@dataclass(frozen=True, slots=True, kw_only=True)
class DirectionalLight:
    """A light infinitely far away, as the sun."""

    direction: tuple[float, float, float]  # world, unit, from the surface towards the light
    irradiance: tuple[float, float, float]  # linear RGB, W m^-2 on a facing surface
    angular_diameter: float = 0.0  # degrees, on paths: shadows have penumbrae; direct light takes it as 0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class AreaLight:
    """A convex polygon that shines; a scene has it as an instance of a mesh."""

    position: tuple[float, float, float]  # of its centre, world
    corners: Float64  # (k, 3) about the centre, counterclockwise seen from its front
    radiance: tuple[float, float, float]  # linear RGB, W sr^-1 m^-2; lights others on paths alone
    both_sides: bool = False


Light: TypeAlias = PointLight | SpotLight | DirectionalLight | AreaLight


@dataclass(frozen=True, slots=True, kw_only=True)
class Sky:
    """Radiance by height of the direction: ground below, horizon at 0, zenith above (linear blend in y)."""

    zenith: tuple[float, float, float] = (0.35, 0.55, 0.95)
    horizon: tuple[float, float, float] = (0.9, 0.95, 1.0)
    ground: tuple[float, float, float] = (0.25, 0.23, 0.2)


@dataclass(frozen=True, slots=True, kw_only=True)
class Environment:
    """A lat-long image of the radiance from all directions, in place of the sky.

    Its middle is seen along -z, its right half towards +x, its top row straight up, before it is turned.
    """

    name: str
    texels: Float32  # (h, 2 h, 3) linear RGB, W sr^-1 m^-2; bilinear between texel centres
    rotation: float = 0.0  # degrees about +y, counterclockwise seen from above
    strength: float = 1.0  # factor that the texels hold already

    @property
    def middle(self) -> np.float32:
        """Where the direction -z lies in the image, 0..1 from the left: what kernels know of the rotation."""
        return np.float32((0.5 + self.rotation / 360.0) % 1.0)

    def gain(self, strength: float) -> np.float32:
        """By what the texels are to be multiplied for another strength."""
        return np.float32(strength / self.strength if self.strength > 0.0 else 1.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class AmbientOcclusion:
    """An even white light in place of all others, which only hides behind what is near."""

    distance: float  # world units, as far as surfaces hide it
    colors: bool = True  # surfaces have their own; else they are white


@dataclass(frozen=True, slots=True, kw_only=True)
class Cut:
    """A plane beyond which, where its normal points, nothing is there."""

    position: tuple[float, float, float]  # of a point of the plane, world
    normal: tuple[float, float, float]  # world, any length; of length 0 it cuts nothing
    enabled: bool = True


@dataclass(frozen=True, slots=True, kw_only=True)
class Source:
    """What a file or a scene function gives, before the configuration adds to it; None = does not say."""

    meshes: tuple[Mesh, ...]
    materials: tuple[Material, ...]
    instances: tuple[Instance, ...]
    textures: tuple[Texture, ...] = ()
    lights: tuple[Light, ...] | None = None
    sky: Sky | None = None
    environment: Environment | None = None  # in place of the sky
    animation: tuple[AnimationConfig, ...] = ()
    motions: tuple[Moving, ...] = ()  # of instances by their numbers, beside `animation`
    series: tuple[Series, ...] = ()  # steps in time, which are instances that take turns
    cameras: tuple[NamedCamera, ...] = ()
    path_depth: int | None = None  # most surfaces that scatter a path; None: direct light alone
    occlusion: AmbientOcclusion | None = None  # paths of one surface, and no light that is followed
    ground: bool = False  # one is laid under everything
    of_paths: tuple[str, ...] = ()  # materials of a file that direct light shows as others: metal, glass, what shines
    notes: tuple[str, ...] = ()  # each repair or assumption, for a reader


@dataclass(frozen=True, slots=True, kw_only=True)
class Shading:
    """How the scene is lit, looks and is seen: all that parameters change (scene.parameters).

    What an edit leaves as it was stays the same object.
    """

    point_lights: tuple[PointLight, ...]
    spot_lights: tuple[SpotLight, ...]
    directional_lights: tuple[DirectionalLight, ...]
    sky: Sky
    materials: tuple[Material, ...]
    path_depth: int | None  # most surfaces that scatter a path; None: direct light alone
    lens: Lens | None = None  # that it is seen through; None: a pinhole
    environment_strength: float = 1.0  # of the scene's environment, where there is one
    occlusion_distance: float = 0.0  # world units, of ambient occlusion, where that is the light
    objects: tuple[tuple[str, tuple[float, ...]], ...] = ()  # name paths and numbers of those moved and hidden by edits
    cuts: tuple[Cut, ...] = ()

    @property
    def lights(self) -> tuple[PointLight | SpotLight | DirectionalLight, ...]:
        """Every light, kind by kind."""
        return (*self.point_lights, *self.spot_lights, *self.directional_lights)


@dataclass(frozen=True, slots=True, kw_only=True)
class Moment:
    """Everything that moves or can be edited, at one scene time under one state of edits."""

    world_from_object: Float64  # (instances, 4, 4)
    steps: tuple[int, ...]  # of each of the scene's series, the step that is shown
    moved: NDArray[np.intp]  # (m,) instances, each once, in order: all others are as at rest
    point_positions: Float64  # (point lights, 3)
    spot_positions: Float64  # (spot lights, 3)
    directions: Float64  # (directional lights, 3) unit
    shading: Shading
