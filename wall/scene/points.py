"""Spheres, and curves between them, as a scene's mesh: points of a file, or of code, made fit to trace."""

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
LONGEST = 8.0  # of a curve's segment, in its radii: Embree's errors grow with the square of that
MOST_PIECES = 1000  # of a segment
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


def curve_points(
    spheres: Float64, starts: NDArray[np.bool_], *, material: int, name: str = "curves",
    colors: Float64 | Float32 | None = None,
) -> Mesh:  # fmt: skip
    """A mesh of curves: each joins spheres that follow each other, stored about the middle of their centres.

    Spheres at the place of the one before them in their curve are left out, and curves of one sphere. Long segments are
    made of several short ones, which Embree meets more exactly.

    spheres : (n, 4) centres and radii, object space, finite, radii above 0
    starts : (n,) bool, where a curve begins; the first is True
    colors : (n, 3) linear RGB; blended along segments
    """
    low, high = spheres[:, :3].min(axis=0), spheres[:, :3].max(axis=0)
    origin = low / 2.0 + high / 2.0
    rows = np.empty(spheres.shape, np.float32)
    rows[:, :3], rows[:, 3] = spheres[:, :3] - origin, spheres[:, 3]
    apart = np.ones(len(rows), np.bool_)
    apart[1:] = (rows[1:, :3] != rows[:-1, :3]).any(axis=1) | starts[1:]
    shown = None if colors is None else np.asarray(colors[apart], np.float32)
    rows, shown, starts = _in_short_pieces(rows[apart], shown, starts[apart])
    x, y, z = origin.tolist()
    return Mesh(
        name=name,
        vertices=rows[:, :3],
        triangles=NO_TRIANGLES,
        material=material,
        origin=(x, y, z),
        colors=shown,
        spheres=rows,
        segments=np.flatnonzero(~starts[1:]).astype(np.uint32),
    )


def _in_short_pieces(
    rows: Float32, colors: Float32 | None, starts: NDArray[np.bool_]
) -> tuple[Float32, Float32 | None, NDArray[np.bool_]]:
    """Spheres (n, 4) of curves, with others between those that are far apart for their radii."""
    before = np.maximum(np.arange(len(rows)) - ~starts, 0)  # a start is its own
    apart = np.linalg.norm(rows[:, :3].astype(np.float64) - rows[before, :3], axis=1)
    thick = (rows[:, 3].astype(np.float64) + rows[before, 3]) / 2.0
    pieces = np.clip(np.ceil(apart / (LONGEST * thick)), 1, MOST_PIECES).astype(np.intp)
    if (pieces == 1).all():
        return np.ascontiguousarray(rows), colors, starts
    end = np.repeat(np.arange(len(rows)), pieces)
    number = np.arange(len(end)) - np.repeat(np.cumsum(pieces) - pieces, pieces) + 1
    share = (number / pieces[end]).astype(np.float32)[:, None]

    def blended(values: Float32) -> Float32:
        found: Float32 = (np.float32(1.0) - share) * values[before[end]] + share * values[end]
        return found

    return blended(rows), None if colors is None else blended(colors), starts[end]


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
