"""Meshes by formula, for the project's own scenes: everything is a sheet of points that is bent into shape.

Y is up; triangles wind counter-clockwise seen from outside. Normals come from the crease rule in normals.py.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from wall.core.data import Float64
from wall.scene.normals import face_normals
from wall.scene.repair import RawMesh

Profile = Sequence[tuple[float, float]]


def painted(shape: RawMesh, colors: Float64) -> RawMesh:
    """The same shape with a colour for each vertex, (v, 3) or (3,) linear RGB."""
    return replace(shape, colors=np.broadcast_to(colors, shape.vertices.shape).astype(np.float32))


def moved(shape: RawMesh, matrix: Float64) -> RawMesh:
    """The same shape under an affine map (4, 4)."""
    return replace(shape, vertices=shape.vertices @ matrix[:3, :3].T + matrix[:3, 3])


def sheet(points: Float64) -> RawMesh:
    """A grid of points (a, b, 3) as triangles; u runs with b, v with a. Triangles without area are left out."""
    a, b = points.shape[:2]
    vertices = points.reshape(-1, 3)
    corner = (np.arange(a - 1)[:, None] * b + np.arange(b - 1)).reshape(-1)
    quads = np.stack([corner, corner + 1, corner + b + 1, corner, corner + b + 1, corner + b], 1)
    triangles = quads.reshape(-1, 3).astype(np.uint32)
    v, u = np.meshgrid(np.linspace(0, 1, a), np.linspace(0, 1, b), indexing="ij")
    flat = (face_normals(vertices, triangles) == 0.0).all(axis=1)
    return RawMesh(vertices=vertices, triangles=triangles[~flat], uvs=np.stack([u, v], -1).reshape(-1, 2))


def lathe(profile: Profile, segments: int, *, flutes: int = 0, depth: float = 0.0) -> RawMesh:
    """Turn a profile of (radius, height), listed from the bottom up on the outside, about the y axis.

    `flutes` grooves of relative `depth` run up it, as in a column.
    """
    radius, height = np.array(profile, np.float64).T
    angle = np.linspace(0.0, 2.0 * np.pi, segments + 1)
    angle[-1] = 0.0  # the seam closes bitwise
    groove = 1.0 - depth * (0.5 + 0.5 * np.cos(flutes * angle)) if flutes else np.ones_like(angle)
    ring = np.stack([np.sin(angle) * groove, np.zeros_like(angle), np.cos(angle) * groove], 1)
    points = radius[:, None, None] * ring[None] + height[:, None, None] * np.array([0.0, 1.0, 0.0])
    return sheet(points)


def sphere(radius: float = 1.0, *, segments: int = 32) -> RawMesh:
    """About the origin."""
    angle = np.linspace(-np.pi / 2, np.pi / 2, segments // 2 + 1)
    across = np.cos(angle)
    across[[0, -1]] = 0.0
    return lathe([(radius * c, radius * s) for c, s in zip(across, np.sin(angle), strict=True)], segments)


def box(width: float, height: float, depth: float) -> RawMesh:
    """Standing on y = 0, centred in x and z."""
    x, z = width / 2, depth / 2
    low = np.array([[-x, 0, z], [x, 0, z], [x, 0, -z], [-x, 0, -z]])
    high = low + np.array([0.0, height, 0.0])
    sides = [np.stack([[low[k], low[(k + 1) % 4]], [high[k], high[(k + 1) % 4]]]) for k in range(4)]
    top, bottom = np.stack([high[[0, 1]], high[[3, 2]]]), np.stack([low[[3, 2]], low[[0, 1]]])
    return join([sheet(side) for side in (*sides, top, bottom)])


def tube(path: Float64, radius: float, *, sides: int = 20) -> RawMesh:
    """A closed curve (n, 3), last point not repeated, as a round tube; frames follow the curve without twist."""
    count = len(path)
    tangent = np.roll(path, -1, axis=0) - np.roll(path, 1, axis=0)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    side = np.empty_like(path)
    side[0] = np.cross(tangent[0], [0.3, 1.0, 0.2])
    for k in range(count):  # parallel transport
        previous = side[max(k - 1, 0)]
        side[k] = previous - tangent[k] * (previous @ tangent[k])
        side[k] /= np.linalg.norm(side[k])
    closing = np.arctan2(side[0] @ np.cross(tangent[0], side[-1]), side[0] @ side[-1])
    twist = -closing * np.arange(count) / count  # spread what is left at the seam
    angle = np.linspace(0.0, 2.0 * np.pi, sides + 1)
    angle[-1] = 0.0
    turned = angle[None, :] + twist[:, None]
    turned[:, -1] = turned[:, 0]
    other = np.cross(tangent, side)
    rings = np.cos(turned)[..., None] * side[:, None] + np.sin(turned)[..., None] * other[:, None]
    points = path[:, None] + radius * rings
    shift = int(np.argmin(np.linalg.norm(points[0, :-1] - points[-1, 0], axis=1)))
    seam = np.concatenate([np.roll(points[0, :-1], -shift, axis=0), points[0, [shift]]])
    return sheet(np.concatenate([points, seam[None]]).transpose(1, 0, 2)[::-1])


def torus_knot(p: int, q: int, *, radius: float, thickness: float, steps: int = 400, sides: int = 20) -> RawMesh:
    """The (p, q) knot on a torus about the y axis: p times round the axis, q times through the hole."""
    t = np.linspace(0.0, 2.0 * np.pi, steps, endpoint=False)
    reach = radius * (1.0 + 0.45 * np.cos(q * t))
    path = np.stack([reach * np.cos(p * t), 0.45 * radius * np.sin(q * t) * 1.2, reach * np.sin(p * t)], 1)
    return tube(path, thickness, sides=sides)


def torus(radius: float, thickness: float, *, segments: int = 48, sides: int = 20) -> RawMesh:
    """A ring about the y axis."""
    angle = np.linspace(0.0, 2.0 * np.pi, sides + 1)
    angle[-1] = 0.0
    return lathe([(radius + thickness * float(np.cos(a)), thickness * float(np.sin(a))) for a in angle], segments)


def join(shapes: Sequence[RawMesh]) -> RawMesh:
    """Several shapes as one; texture coordinates and colours are kept if every part has them."""
    starts = np.cumsum([0, *(len(shape.vertices) for shape in shapes)])
    kept: dict[str, Any] = {}
    for name in ("uvs", "colors"):
        rows = [getattr(shape, name) for shape in shapes]
        kept[name] = None if any(row is None for row in rows) else np.concatenate(rows)
    triangles = np.concatenate([s.triangles + np.uint32(k) for s, k in zip(shapes, starts[:-1], strict=True)])
    return RawMesh(vertices=np.concatenate([shape.vertices for shape in shapes]), triangles=triangles, **kept)


def placed(x: float, y: float, z: float, *, turn_degrees: float = 0.0, scale: float = 1.0) -> Float64:
    """(4, 4): scale, turn about y, then move."""
    angle = np.radians(turn_degrees)
    c, s = scale * np.cos(angle), scale * np.sin(angle)
    return np.array([[c, 0, s, x], [0, scale, 0, y], [-s, 0, c, z], [0, 0, 0, 1.0]])
