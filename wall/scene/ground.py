"""A ground that a model without one stands on: a round grey plane under its lowest point, as wide as the eye sees."""

from __future__ import annotations

import numpy as np

from wall.core.data import Float64
from wall.scene.model import Instance, Material, Mesh

NAME = "ground plane"
BELOW = 1e-3  # radii of the scene, under its lowest point: a floor of its own is not to flicker
RINGS = (0.0, 1.5, 6.0, 60.0)  # radii of the scene: near the model triangles are small, so that hits are exact
SIDES = 96
GREY = (0.30, 0.30, 0.30)


def ground(low: float, center: Float64, radius: float, *, mesh: int, material: int) -> tuple[Mesh, Material, Instance]:
    """The ground at height `low` around a scene's `center` (3,) and `radius`; its numbers of mesh and material."""
    turn = np.linspace(0.0, 2.0 * np.pi, SIDES, endpoint=False)
    circle = np.stack([np.cos(turn), np.zeros(SIDES), -np.sin(turn)], axis=1)
    vertices = np.concatenate([np.zeros((1, 3)), *(ring * radius * circle for ring in RINGS[1:])])
    k, after = np.arange(SIDES), np.roll(np.arange(SIDES), -1)
    triangles = [np.stack([np.zeros(SIDES, int), 1 + k, 1 + after], axis=1)]
    for ring in range(len(RINGS) - 2):
        inner, outer = 1 + ring * SIDES, 1 + (ring + 1) * SIDES
        triangles.append(np.stack([inner + k, outer + k, outer + after], axis=1))
        triangles.append(np.stack([inner + k, outer + after, inner + after], axis=1))
    placed = np.eye(4)
    placed[:3, 3] = center[0], low - BELOW * radius, center[2]
    return (
        Mesh(
            name=NAME, vertices=vertices.astype(np.float32),
            triangles=np.concatenate(triangles).astype(np.uint32), material=material,
        ),
        Material(name=NAME, base_color=GREY),
        Instance(name=NAME, mesh=mesh, world_from_object=placed),
    )  # fmt: skip
