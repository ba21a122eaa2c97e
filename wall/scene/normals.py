"""Shading normals for meshes that bring none: smooth where the surface bends gently, crisp at creases.

Rule: two triangles that share an edge (by position, so that texture seams do not show) belong together if their
normals differ by less than CREASE_DEGREES and they wind the same way. Around a vertex, triangles that hang together
through such edges share one normal: the mean of theirs, weighted by the angle each has at the vertex (Thuermer and
Wuethrich 1998). Where the surface creases, the vertex is split. Edges of three or more triangles are creases.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wall.core.data import Float64

CREASE_DEGREES = 40.0  # an icosahedron's 41.8 stays crisp, a 10-sided prism (36) looks round
ALREADY_FLAT = 1.0 - 1e-9  # cosine; only coplanar triangles hang together, as on a box


@dataclass(frozen=True, slots=True, kw_only=True)
class Smoothed:
    """A mesh whose vertices were split at creases."""

    source: NDArray[np.intp]  # (v,) which old vertex each new one copies
    triangles: NDArray[np.uint32]  # (t, 3)
    normals: Float64  # (v, 3) unit


def face_normals(vertices: Float64, triangles: NDArray[np.integer]) -> Float64:
    """(t, 3) unit normals; zero for a triangle without area."""
    corners = vertices[triangles]
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(cross, axis=1, keepdims=True)
    return np.asarray(cross / np.where(length > 0.0, length, 1.0), np.float64)


def crease_normals(vertices: Float64, triangles: NDArray[np.integer]) -> Smoothed | None:
    """Smooth normals by the rule above; None where every edge is a crease, so flat shading says the same.

    Parameters
    ----------
    vertices : (v, 3) finite; scaled so that squares neither overflow nor vanish
    triangles : (t, 3) indices, none without area
    """
    normals = face_normals(vertices, triangles)
    position = same_position(vertices)[triangles]
    links = _smooth_corners(position, normals)
    if len(links) == 0:
        return None
    count = 3 * len(triangles)
    group = least_linked(count, links)
    summed = np.zeros((count, 3))
    weighted = (_corner_angles(vertices, triangles)[:, :, None] * normals[:, None, :]).reshape(-1, 3)
    for axis in range(3):
        summed[:, axis] = np.bincount(group, weights=weighted[:, axis], minlength=len(summed))
    old = triangles.astype(np.int64).reshape(-1)
    keys, first, corner = np.unique(old * len(summed) + group, return_index=True, return_inverse=True)
    smooth = summed[group[first]]
    length = np.linalg.norm(smooth, axis=1, keepdims=True)
    smooth = np.where(length > 1e-6, smooth / np.where(length > 0.0, length, 1.0), normals[first // 3])
    if np.einsum("ij,ij->i", smooth[corner], np.repeat(normals, 3, axis=0)).min() > ALREADY_FLAT:
        return None
    return Smoothed(
        source=(keys // len(summed)).astype(np.intp),
        triangles=corner.reshape(-1, 3).astype(np.uint32),
        normals=smooth,
    )


def least_linked(count: int, links: NDArray[np.int64]) -> NDArray[np.int64]:
    """(count,) of each number the least one that links (n, 2) lead to, over others too; itself without any.

    NumPy alone: scipy.sparse.csgraph finds the same groups and takes 0.2 s and 20 MB to import.
    """
    least = np.arange(count)
    while len(links):
        ends = least[links]
        np.minimum.at(least, ends.max(axis=1), ends.min(axis=1))
        while (further := least[least]).tobytes() != least.tobytes():
            least = further
        links = links[least[links[:, 0]] != least[links[:, 1]]]
    return least


def same_position(vertices: Float64) -> NDArray[np.int64]:
    """(v,) equal numbers for bitwise equal positions."""
    order = np.lexsort(vertices.T)
    ordered = vertices[order]
    fresh = np.concatenate([[0], np.cumsum((ordered[1:] != ordered[:-1]).any(axis=1))])
    numbers = np.empty(len(vertices), np.int64)
    numbers[order] = fresh
    return numbers


def _smooth_corners(position: NDArray[np.int64], normals: Float64) -> NDArray[np.int64]:
    """(n, 2) pairs of corners (3 t + k) that share one normal across a smooth edge."""
    start, end = position.reshape(-1), np.roll(position, -1, axis=1).reshape(-1)
    corner = np.arange(len(start))
    following = corner - corner % 3 + (corner + 1) % 3
    key = np.minimum(start, end) * (position.max() + 1) + np.maximum(start, end)
    order = np.argsort(key, kind="stable")
    key = key[order]
    same = np.concatenate([[False], key[1:] == key[:-1], [False]])
    pair = np.flatnonzero(same[1:-1] & ~same[:-2] & ~same[2:])  # runs of exactly two
    a, b = order[pair], order[pair + 1]
    bend = np.einsum("ij,ij->i", normals[a // 3], normals[b // 3])
    smooth = (bend > math.cos(math.radians(CREASE_DEGREES))) & (start[a] == end[b])
    a, b = a[smooth], b[smooth]
    return np.concatenate([np.stack([a, following[b]], 1), np.stack([following[a], b], 1)])


def _corner_angles(vertices: Float64, triangles: NDArray[np.integer]) -> Float64:
    """(t, 3) interior angles, rad."""
    corners = vertices[triangles]
    ahead = np.roll(corners, -1, axis=1) - corners
    ahead /= np.maximum(np.linalg.norm(ahead, axis=2, keepdims=True), np.finfo(np.float64).tiny)
    angles: Float64 = np.arccos(np.clip(-(ahead * np.roll(ahead, 1, axis=1)).sum(axis=2), -1.0, 1.0))
    return angles
