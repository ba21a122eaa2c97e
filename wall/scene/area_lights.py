"""Lights with an area that no model brings: rectangles and discs, as emitting meshes of the scene."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from wall.config.scene import DiscLightConfig, RectangleLightConfig
from wall.core.data import Float64
from wall.scene.model import AreaLight, Instance, Light, Material, Mesh

DISC_SIDES = 64  # of the polygon that a disc is: middles 0.07 % nearer than the disc's radius, ends 0.08 % farther


def area_light(config: RectangleLightConfig | DiscLightConfig) -> AreaLight:
    """The light that a configuration describes, its corners about its centre; the front sees them counterclockwise."""
    corners = _rectangle(config) if isinstance(config, RectangleLightConfig) else _disc(config)
    return AreaLight(
        position=config.center, corners=corners, radiance=config.radiance, both_sides=config.sides == "both"
    )


def _rectangle(config: RectangleLightConfig) -> Float64:
    a, b = (np.array(edge) / 2.0 for edge in config.edges)
    return np.stack([-a - b, a - b, a + b, b - a])


def _disc(config: DiscLightConfig) -> Float64:
    """A regular polygon of the disc's area."""
    normal = np.array(config.normal) / np.linalg.norm(config.normal)
    across = np.cross(normal, np.eye(3)[np.argmin(np.abs(normal))])
    across /= np.linalg.norm(across)
    step = 2.0 * math.pi / DISC_SIDES
    radius = config.radius * math.sqrt(step / math.sin(step))
    turn = (np.arange(DISC_SIDES) * step)[:, None]
    return np.asarray(radius * (np.cos(turn) * across + np.sin(turn) * np.cross(normal, across)), np.float64)


def emitting(
    lights: Sequence[Light], meshes: int, materials: int
) -> tuple[tuple[Mesh, ...], tuple[Material, ...], tuple[Instance, ...]]:
    """Meshes, materials and instances of the area lights among `lights`, named by their number there.

    meshes, materials : how many the scene has without them
    """
    found = [(f"light {k}", light) for k, light in enumerate(lights) if isinstance(light, AreaLight)]
    return (
        tuple(_mesh(name, light, materials + k) for k, (name, light) in enumerate(found)),
        tuple(_material(name, light) for name, light in found),
        tuple(_instance(name, light, meshes + k) for k, (name, light) in enumerate(found)),
    )


def _mesh(name: str, light: AreaLight, material: int) -> Mesh:
    """A convex polygon as triangles about its centre: all of one size."""
    count = len(light.corners)
    vertices = np.vstack([light.corners, np.zeros((1, 3))]).astype(np.float32)
    first = np.arange(count)
    triangles = np.stack([first, (first + 1) % count, np.full(count, count)], axis=1).astype(np.uint32)
    return Mesh(name=name, vertices=vertices, triangles=triangles, material=material)


def _material(name: str, light: AreaLight) -> Material:
    return Material(name=name, base_color=(0.0, 0.0, 0.0), emission=light.radiance, emits_behind=light.both_sides)


def _instance(name: str, light: AreaLight, mesh: int) -> Instance:
    placed = np.eye(4)
    placed[:3, 3] = light.position
    return Instance(name=name, mesh=mesh, world_from_object=placed)
