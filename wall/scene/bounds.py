"""Bounding boxes of placed meshes, and the sphere that frames them all."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from wall.core.data import Float64
from wall.scene.model import Instance, Mesh

EXACT_VERTICES = 4_000_000  # placed vertices that are bounded one by one (0.1 s); beyond it boxes are placed


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


def _outlines(meshes: Sequence[Mesh], instances: Sequence[Instance]) -> Iterator[Float64]:
    """(k, 3) world points for each instance: its vertices, or its box's corners in a scene of very many."""
    placed = sum(len(meshes[instance.mesh].vertices) for instance in instances)
    local: dict[int, Float64] = {}
    for instance in instances:
        if instance.mesh not in local:
            mesh = meshes[instance.mesh]
            points = mesh.vertices.astype(np.float64)
            if placed > EXACT_VERTICES:
                ends = np.stack([points.min(axis=0), points.max(axis=0)], 1)
                points = np.stack(np.meshgrid(*ends), -1).reshape(-1, 3)
            local[instance.mesh] = points + np.asarray(mesh.origin)
        matrix = instance.world_from_object
        yield local[instance.mesh] @ matrix[:3, :3].T + matrix[:3, 3]
