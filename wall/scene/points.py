"""Spheres as a scene's mesh: points of a file, or of code, made fit to trace."""

from __future__ import annotations

import numpy as np

from wall.core.data import Float32, Float64
from wall.scene.model import Mesh

FARTHEST = 1e100  # of coordinates, as of triangle meshes
NO_TRIANGLES = np.zeros((0, 3), np.uint32)


def sphere_points(
    spheres: Float64, *, material: int, name: str = "points", colors: Float64 | Float32 | None = None
) -> Mesh:
    """A mesh of spheres, stored about the middle of their centres.

    spheres : (n, 4) centres and radii, object space, finite, radii above 0; n at least 1
    colors : (n, 3) linear RGB
    """
    low, high = spheres[:, :3].min(axis=0), spheres[:, :3].max(axis=0)
    origin = low / 2.0 + high / 2.0
    rows = np.empty(spheres.shape, np.float32)
    rows[:, :3] = spheres[:, :3] - origin
    rows[:, 3] = spheres[:, 3]
    x, y, z = origin.tolist()
    return Mesh(
        name=name,
        vertices=rows[:, :3],
        triangles=NO_TRIANGLES,
        material=material,
        origin=(x, y, z),
        colors=None if colors is None else np.ascontiguousarray(colors, np.float32),
        spheres=rows,
    )
