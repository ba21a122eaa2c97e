"""Bounding boxes of placed meshes, and the sphere that frames them all."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import product

import numpy as np

from wall.core.data import Float32, Float64
from wall.scene.model import Instance, Mesh

EXACT_VERTICES = 4_000_000  # placed vertices that are bounded one by one (0.1 s); beyond it boxes are placed
CELLS = 32  # along each axis of a box about spheres; those that hold some are bounded in place of the spheres


def world_boxes(meshes: Sequence[Mesh], instances: Sequence[Instance]) -> Float64:
    """(instances, 2, 3) low and high corner of every instance at rest, world."""
    return np.array([(points.min(axis=0), points.max(axis=0)) for points in _outlines(meshes, instances)])


def framing_sphere(meshes: Sequence[Mesh], instances: Sequence[Instance]) -> tuple[Float64, float]:
    """Middle of the whole bounding box (3,) and the largest distance of a point from it, world."""
    center = middle(world_boxes(meshes, instances))
    distances = (np.linalg.norm(points - center, axis=1).max() for points in _outlines(meshes, instances))
    return center, float(max(distances))


def middle(boxes: Float64) -> Float64:
    """(3,) middle of the box about boxes (n, 2, 3)."""
    return np.asarray((boxes[:, 0].min(axis=0) + boxes[:, 1].max(axis=0)) / 2.0, np.float64)


def local_box(mesh: Mesh) -> tuple[Float32, Float32]:
    """Low and high corner (3,) of the box about a mesh's vertices, or spheres, without its origin, object space."""
    if mesh.spheres is None:
        return mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    radii = mesh.spheres[:, 3:]
    return (mesh.vertices - radii).min(axis=0), (mesh.vertices + radii).max(axis=0)


def _outlines(meshes: Sequence[Mesh], instances: Sequence[Instance]) -> Iterator[Float64]:
    """(k, 3) world points for each instance: its vertices, or its box's corners in a scene of very many.

    Spheres lie within the points that stand for them.
    """
    placed = sum(_outline_size(meshes[instance.mesh]) for instance in instances)
    local: dict[int, Float64] = {}
    for instance in instances:
        if instance.mesh not in local:
            mesh = meshes[instance.mesh]
            points = _about_spheres(mesh.spheres) if mesh.spheres is not None else mesh.vertices.astype(np.float64)
            if placed > EXACT_VERTICES:
                points = _corners(points.min(axis=0)[None], points.max(axis=0)[None])
            local[instance.mesh] = points + np.asarray(mesh.origin)
        matrix = instance.world_from_object
        yield local[instance.mesh] @ matrix[:3, :3].T + matrix[:3, 3]


def _outline_size(mesh: Mesh) -> int:
    return len(mesh.vertices) if mesh.spheres is None else 8 * min(len(mesh.spheres), CELLS**3)


def _about_spheres(spheres: Float32) -> Float64:
    """(k, 3) points about spheres (n, 4): the corners of their boxes, or, of very many, of the cells of a grid that
    they are in, each made larger by the largest radius.
    """
    if len(spheres) <= CELLS**3:
        centres, radii = spheres[:, :3].astype(np.float64), spheres[:, 3:].astype(np.float64)
        return _corners(centres - radii, centres + radii)
    radius = float(spheres[:, 3].max())
    low = spheres[:, :3].min(axis=0).astype(np.float64)
    high = spheres[:, :3].max(axis=0).astype(np.float64)
    size = np.maximum(high - low, np.finfo(np.float32).tiny) / CELLS
    filled = np.zeros((CELLS, CELLS, CELLS), np.bool_)
    x, y, z = (np.clip((spheres[:, k] - low[k]) / size[k], 0, CELLS - 1).astype(np.intp) for k in range(3))
    filled[x, y, z] = True
    cells = np.argwhere(filled)
    return _corners(low + cells * size - radius, np.minimum(low + (cells + 1) * size, high) + radius)


def _corners(low: Float64, high: Float64) -> Float64:
    """(8 n, 3) corners of boxes (n, 3) from low to high."""
    ends = np.stack([low, high])
    return np.stack([ends[choice, :, [0, 1, 2]].T for choice in product((0, 1), repeat=3)], 1).reshape(-1, 3)
