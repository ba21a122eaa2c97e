"""Spheres as a scene's mesh: points of a file, or of code, made fit to trace."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wall.core.data import Float32, Float64
from wall.scene.model import Mesh

FARTHEST = 1e100  # of coordinates, as of triangle meshes
LEAST_ORDERED = 4096  # spheres; fewer fit in a processor's caches in any order
CURVE_BITS = 21  # of each coordinate along the curve
SPREADS = (  # by how much halves, quarters, ... of the bits go up, and where they are then
    (32, 0x001F00000000FFFF),
    (16, 0x001F0000FF0000FF),
    (8, 0x100F00F00F00F00F),
    (4, 0x10C30C30C30C30C3),
    (2, 0x1249249249249249),
)
NO_TRIANGLES = np.zeros((0, 3), np.uint32)


def sphere_points(
    spheres: Float64, *, material: int, name: str = "points", colors: Float64 | Float32 | None = None
) -> Mesh:
    """A mesh of spheres, stored about the middle of their centres, neighbours near each other in memory.

    spheres : (n, 4) centres and radii, object space, finite, radii above 0; n at least 1
    colors : (n, 3) linear RGB
    """
    low, high = spheres[:, :3].min(axis=0), spheres[:, :3].max(axis=0)
    origin = low / 2.0 + high / 2.0
    rows: Float32 = np.empty(spheres.shape, np.float32)
    rows[:, :3] = spheres[:, :3] - origin
    rows[:, 3] = spheres[:, 3]
    if len(rows) >= LEAST_ORDERED:
        order = _along_curve(rows[:, :3])
        rows, colors = rows[order], None if colors is None else colors[order]
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


def _along_curve(centres: Float32) -> NDArray[np.intp]:
    """(n,) the order of points (n, 3) along Morton's curve through the box about them.

    Rays that are near each other then read spheres that are.
    """
    low = centres.min(axis=0)
    size = max(float((centres.max(axis=0) - low).max()), float(np.finfo(np.float32).tiny))
    keys = np.zeros(len(centres), np.uint64)
    for axis in range(3):
        steps = ((centres[:, axis] - low[axis]) * (((1 << CURVE_BITS) - 1) / size)).astype(np.uint64)
        keys |= _spread(steps) << np.uint64(axis)
    return np.argsort(keys, kind="stable")


def _spread(steps: NDArray[np.uint64]) -> NDArray[np.uint64]:
    """Two zero bits before each of 21 bits."""
    for shift, mask in SPREADS:
        steps = (steps | (steps << np.uint64(shift))) & np.uint64(mask)
    return steps
