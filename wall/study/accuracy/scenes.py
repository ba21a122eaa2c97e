"""Scenes of a few triangles, views of them, and the images that the tracer makes of them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wall.config.screens import GridConfig, WallConfig
from wall.core.data import Event, Float32, Float64, Rect, Samples
from wall.geometry.cameras import default_eye, look_at
from wall.geometry.expanding import expand
from wall.geometry.panels import Panel, Wall
from wall.sampling.ownership import block_order
from wall.scene.build import Scene, assemble
from wall.scene.builtin.shapes import sphere
from wall.scene.model import (
    Cut,
    DirectionalLight,
    Instance,
    Light,
    Material,
    Mesh,
    PointLight,
    Sky,
    Source,
    SpotLight,
    Texture,
    TextureSet,
    Wrap,
)
from wall.scene.points import curve_points, sphere_points
from wall.tracing.tracer import Traced, Tracer
from wall.tracing.tracer_scene import TracerScene, make_tracer_scene

Triple = tuple[float, float, float]
BLACK = (0.0, 0.0, 0.0)
BLACK_SKY = Sky(zenith=BLACK, horizon=BLACK, ground=BLACK)


def quad(width: float, height: float, *, material: int = 0, uvs: bool = False, colors: ArrayLike | None = None) -> Mesh:
    """A rectangle in the plane z = 0 about the origin, facing +z; vertices from the lower left counter-clockwise."""
    x, y = width / 2, height / 2
    return Mesh(
        name="quad",
        vertices=np.array([[-x, -y, 0], [x, -y, 0], [x, y, 0], [-x, y, 0]], np.float32),
        triangles=np.array([[0, 1, 2], [0, 2, 3]], np.uint32),
        material=material,
        uvs=np.array([[0, 0], [1, 0], [1, 1], [0, 1]], np.float32) if uvs else None,
        colors=None if colors is None else np.asarray(colors, np.float32),
    )


def sphere_mesh(material: int = 0, *, segments: int = 24, smooth: bool = True) -> Mesh:
    """The unit sphere about the origin."""
    mesh = replace(sphere(segments=segments), name="sphere", uvs=None).shaded(material)
    return mesh if smooth else replace(mesh, normals=None)


def material(r: float, g: float, b: float, *, mirror: float = 0.0, base_color_texture: int | None = None) -> Material:
    """A diffuse colour, or a mirror, with at most one texture."""
    return Material(name="material", base_color=(r, g, b), mirror=mirror, textures=TextureSet(base_color_texture))


def turned(axis: str, degrees: float) -> Float64:
    """(3, 3) rotation about an axis of the world."""
    k = "xyz".index(axis)
    i, j = (k + 1) % 3, (k + 2) % 3
    matrix = np.eye(3)
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    matrix[i, i], matrix[i, j], matrix[j, i], matrix[j, j] = c, -s, s, c
    return matrix


def instance(
    mesh: int,
    *,
    at: Triple = (0.0, 0.0, 0.0),
    turn: tuple[str, float] = ("y", 0.0),
    scale: float | Triple = 1.0,
) -> Instance:
    """Scaled along the object's own axes, turned, then moved."""
    matrix = np.eye(4)
    matrix[:3, :3] = turned(*turn) @ np.diag(np.broadcast_to(scale, 3))
    matrix[:3, 3] = at
    return Instance(name=f"object{mesh}", mesh=mesh, world_from_object=matrix)


def scene_of(
    meshes: Sequence[Mesh],
    instances: Sequence[Instance] | None = None,
    *,
    materials: Sequence[Material] = (Material(name="grey", base_color=(0.5, 0.5, 0.5)),),
    lights: Sequence[Light] = (),
    sky: Sky = BLACK_SKY,
    textures: Sequence[Texture] = (),
) -> Scene:
    """A scene; without `instances` every mesh stands where it was made."""
    placed = [instance(k) for k in range(len(meshes))] if instances is None else instances
    return assemble(
        Source(
            meshes=tuple(meshes),
            materials=tuple(materials),
            instances=tuple(placed),
            textures=tuple(textures),
            lights=tuple(lights),
            sky=sky,
        )
    )


def with_every_feature(scene: Scene) -> Scene:
    """A still scene that looks the same, for a tracer that has every feature: numba compiles one for each set of them.

    Far below, away from all else, lie a small dark object with every texture, vertex colours and smooth normals, which
    shines a little and is in part glass that absorbs, a pane of thin glass, a coloured sphere and a coloured curve;
    every kind of light is there, black, and a cut that is not enabled.
    The sky stays a sky, and an environment an environment.
    """
    first, texel = len(scene.textures), np.full((2, 2, 3), 9, np.uint8)
    wrap: tuple[Wrap, Wrap] = ("clamp", "mirror")
    more = [Texture(name="more", texels=texel, linear=k % 2 == 1, wrap=wrap, uv_set=k // 3) for k in range(4)]
    dark = Material(
        name="every feature", base_color=BLACK, emission=(1e-9, 0.0, 0.0), emits_behind=False,
        metallic=0.5, mirror=0.5, transmission=0.1, attenuation_color=(0.1, 0.2, 0.3), attenuation_distance=1.0,
        textures=TextureSet(*range(first, first + 4)),
    )  # fmt: skip
    square = quad(2.0, 2.0, material=len(scene.materials), uvs=True, colors=np.zeros((4, 3)))
    uvs = np.tile(np.asarray(square.uvs), 2)
    square = replace(square, uvs=uvs, normals=np.tile(np.array([0.0, 0.0, 1.0], np.float32), (4, 1)))
    pane = replace(square, material=square.material + 1, normals=None, uvs=None, colors=None)
    thin = Material(name="thin", base_color=BLACK, transmission=1.0, thin=True)
    point = sphere_points(np.array([[0.0, 0.0, 0.0, 0.1]]), material=pane.material, colors=np.zeros((1, 3)))
    ends = np.array([[0.0, 0.0, 0.0, 0.1], [1.0, 0.0, 0.0, 0.1]])
    curve = curve_points(ends, np.array([True, False]), material=pane.material, colors=np.zeros((2, 3)))
    up, below = (0.0, 1.0, 0.0), (0.0, -500.0, 0.0)
    far = [instance(len(scene.meshes) + k, at=(k, -500.0, 0.0), turn=("x", 90.0), scale=0.1) for k in range(4)]
    lights = (
        PointLight(position=below, intensity=BLACK),
        SpotLight(position=below, direction=up, intensity=BLACK, inner_angle=10.0, outer_angle=20.0),
        DirectionalLight(direction=up, irradiance=BLACK),
        DirectionalLight(direction=up, irradiance=BLACK, angular_diameter=1.0),
    )
    cuts = scene.cuts or (Cut(position=below, normal=up, enabled=False),)
    whole = assemble(
        Source(
            meshes=(*scene.meshes, square, pane, point, curve),
            materials=(*scene.materials, dark, thin),
            instances=(*scene.instances, *far),
            textures=(*scene.textures, *more),
            lights=(*scene.point_lights, *scene.spot_lights, *scene.directional_lights, *lights),
            sky=scene.sky,
            environment=scene.environment,
            path_depth=scene.path_depth,
            series=scene.series,
        )
    )
    return replace(whole, cuts=cuts)


def moved_scene(scene: Scene, by: Triple) -> Scene:
    """The same scene somewhere else: instances and point lights shifted in float64."""
    shift = np.eye(4)
    shift[:3, 3] = by
    return scene_of(
        scene.meshes,
        [replace(i, world_from_object=shift @ i.world_from_object) for i in scene.instances],
        materials=scene.materials,
        textures=scene.textures,
        sky=scene.sky,
        lights=[
            *(replace(p, position=tuple(np.add(p.position, by).tolist())) for p in scene.point_lights),
            *scene.directional_lights,
        ],
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class View:
    """One panel as the whole wall, an eye before it, and the event that looks at a scene through it."""

    wall: Wall
    eye: Float64
    event: Event

    @property
    def panel(self) -> Panel:
        """The wall's only panel."""
        return self.wall.panels[0]


def flat_wall(columns: int, rows: int, pixels: tuple[int, int], *, bezel: float = 0.0) -> Wall:
    """Square pixels, each panel 1 m high."""
    grid = GridConfig(columns=columns, rows=rows, pixels=pixels, size=(pixels[0] / pixels[1], 1.0), bezel=bezel)
    return expand(WallConfig(grid=grid))


def view(
    position: Triple, target: Triple, *, pixels: tuple[int, int], fov: float = 45.0, up: Triple = (0.0, 1.0, 0.0)
) -> View:
    """`fov` is the vertical angle in degrees."""
    wall = flat_wall(1, 1, pixels)
    event = Event(
        view=0, camera_event=0, scene_event=0, scene_time=0.0, input_time=100.0, camera=look_at(position, target, up)
    )
    return View(wall=wall, eye=default_eye(wall, fov), event=event)


def directions(seen: View) -> Float64:
    """(h, w, 3) float64 unit directions through the pixel centres, by the pinhole formula: a second derivation."""
    (w, h), distance = seen.panel.pixels, float(np.linalg.norm(seen.eye))
    x, y = (np.arange(w) + 0.5) / h - w / h / 2, 0.5 - (np.arange(h) + 0.5) / h
    rays = np.stack([*np.meshgrid(x, y), np.full((h, w), -distance)], axis=-1) @ seen.event.camera.rotation().T
    rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
    return np.asarray(rays, np.float64)


@dataclass(frozen=True, slots=True, kw_only=True)
class TracedImage:
    """An image of one sample a pixel, and what it cost."""

    radiance: Float32  # (h, w, 3); NaN where a sample was dropped
    depth: Float32  # (h, w)
    objects: NDArray[np.uint32]  # (h, w)
    cost: Traced


def traced_image(scene: Scene | TracerScene, seen: View, *, coherent: bool = True) -> TracedImage:
    """One sample in the middle of every pixel."""
    tracer_scene = make_tracer_scene(scene) if isinstance(scene, Scene) else scene
    tracer = Tracer(tracer_scene, seen.panel, seen.eye, coherent=coherent)
    tracer.set_event(seen.event)
    return image_of(tracer, seen)


def image_of(tracer: Tracer, seen: View) -> TracedImage:
    """One sample in the middle of every pixel, under the tracer's event."""
    width, height = seen.panel.pixels
    pixels = block_order(Rect(x=0, y=0, width=width, height=height), worker=0, workers=1)
    samples, cost = tracer.trace((pixels + 0.5).astype(np.float32))
    return raster(samples, seen.panel.pixels, cost)


def traced_with_every_feature(scene: Scene, seen: View) -> TracedImage:
    """The image by a tracer that many tests share; see with_every_feature."""
    return traced_image(with_every_feature(scene), seen)


def raster(samples: Samples, size: tuple[int, int], cost: Traced) -> TracedImage:
    """The image of `size` (width, height) that has these samples, at most one a pixel."""
    width, height = size
    radiance = np.full((height, width, 3), np.nan, np.float32)
    depth, objects = np.full((height, width), np.nan, np.float32), np.zeros((height, width), np.uint32)
    x, y = samples["xy"].astype(int).T
    radiance[y, x], depth[y, x], objects[y, x] = samples["radiance"], samples["depth"], samples["object_id"]
    return TracedImage(radiance=radiance, depth=depth, objects=objects, cost=cost)


def tiny_scene() -> Scene:
    """A floor, a ball and a smaller one beside it, a directional and a point light: 3 objects, 1,442 triangles."""
    ball = sphere_mesh(1, segments=24)
    return scene_of(
        [quad(8.0, 8.0, material=0), ball],
        [
            instance(0, turn=("x", -90.0)),
            instance(1, at=(-0.6, 1.0, 0.0)),
            instance(1, at=(1.1, 0.4, 0.7), scale=0.4),
        ],
        materials=[material(0.8, 0.7, 0.5), material(0.3, 0.5, 0.9)],
        lights=[
            DirectionalLight(direction=(0.48, 0.64, 0.6), irradiance=(2.0, 1.9, 1.7)),
            PointLight(position=(-2.0, 2.5, 2.0), intensity=(3.0, 3.0, 4.0)),
        ],
    )
