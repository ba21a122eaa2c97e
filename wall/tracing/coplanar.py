"""Objects whose flat faces lie in one plane, and overlap: which of them is behind the other.

Their distances along a ray differ by rounding alone, so that which one is seen would change from ray to ray, and with
every movement of the camera. One that is behind others is scaled about the eye by some roundings: no image moves.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from wall.core.data import Float64
from wall.scene.build import Scene
from wall.scene.model import Mesh

Indices = NDArray[np.int64]

BEHIND = 2.0**-20  # of the distance, by which one lies behind the next: 16 roundings of float32
MOST_BEHIND = 64  # objects one behind the other
FEW_TRIANGLES = 64  # of a mesh whose faces are looked at one by one; of larger ones only those that are flat
MOST_FACES = 4096  # of all instances of a mesh: what is placed more often is left as it is
SAME_NORMAL, SAME_PLANE = 1e-4, 1e-5  # steps of a unit normal's components; of an offset, times the scene's radius
PHASE = 0.37  # of a step: axes and planes through the origin lie inside of one
FLAT = 1e-6  # of a mesh's size
TOUCHING = 1e-5  # of a face's size: what overlaps less lies beside it
PAIRS_AT_ONCE = 1 << 14  # that are looked at closely


def depth_scales(scene: Scene) -> Float64:
    """(n,) by how much each instance is to be scaled about the eye: 1, or a little more for one behind others.

    What emits is before what does not, else the order is that of objects. Places are those at rest.
    """
    n = len(scene.instances)
    owners, equations, corners = _placed_faces(scene)
    if len(owners) == 0:
        return np.ones(n)
    steps = np.array([SAME_NORMAL] * 3 + [max(SAME_PLANE * scene.radius, 1e-300)])
    planes = np.unique(np.floor(equations / steps + PHASE), axis=0, return_inverse=True)[1].reshape(-1)
    in_order = sorted(range(n), key=lambda k: (not _emits(scene, k), k))
    rank = np.argsort(in_order)
    over = [np.zeros(0, np.int64)]  # n times the rank of one, and that of one before it in whose plane and place it is
    for one, other in _beside(owners, planes, corners, SAME_PLANE * scene.radius):
        overlap = _overlap(corners[one], corners[other])
        a, b = rank[owners[one[overlap]]], rank[owners[other[overlap]]]
        over.append(np.unique(n * np.maximum(a, b) + np.minimum(a, b)))
    later, before = np.divmod(np.unique(np.concatenate(over)), n)
    behind = np.zeros(n, np.int64)  # by rank
    for k, first, count in zip(*np.unique(later, return_index=True, return_counts=True), strict=True):
        behind[k] = behind[before[first : first + count]].max() + 1
    return np.asarray(1.0 + BEHIND * np.minimum(behind[rank], MOST_BEHIND), np.float64)


def _emits(scene: Scene, k: int) -> bool:
    return any(scene.materials[scene.meshes[scene.instances[k].mesh].material].emission)


def _beside(owners: Indices, planes: Indices, corners: Float64, slack: float) -> Iterator[tuple[Indices, Indices]]:
    """Pairs of faces of different owners in one plane, some at a time, whose bounds there overlap."""
    order = np.argsort(planes, kind="stable")
    for faces in np.split(order, np.flatnonzero(np.diff(planes[order])) + 1):
        if len(faces) < 2:
            continue
        edges = corners[faces[0], [1, 3]] - corners[faces[0], 0]
        along = edges[0] / np.linalg.norm(edges[0])
        across = np.cross(np.cross(edges[0], edges[1]), along)
        axes = along, across / np.linalg.norm(across)
        places = (corners[faces] @ axis for axis in axes)
        (u0, u1), (v0, v1) = ((x.min(axis=1) - slack, x.max(axis=1) + slack) for x in places)
        if np.ptp(v0) > np.ptp(u0):
            u0, u1, v0, v1 = v0, v1, u0, u1
        by_u = np.argsort(u0, kind="stable")
        faces, u0, u1, v0, v1 = faces[by_u], u0[by_u], u1[by_u], v0[by_u], v1[by_u]
        counts = np.searchsorted(u0, u1, side="left") - np.arange(len(faces)) - 1  # of faces that begin inside of each
        for first, last in _chunks(counts):
            one = np.repeat(np.arange(first, last), counts[first:last])
            begins = np.cumsum(counts[first:last]) - counts[first:last]
            other = one + 1 + np.arange(len(one)) - np.repeat(begins, counts[first:last])
            near = (v0[one] < v1[other]) & (v0[other] < v1[one]) & (owners[faces[one]] != owners[faces[other]])
            yield faces[one[near]], faces[other[near]]


def _chunks(counts: Indices) -> Iterator[tuple[int, int]]:
    """Ranges of `counts` whose sums are about PAIRS_AT_ONCE."""
    chunk = np.cumsum(counts) // PAIRS_AT_ONCE
    edges = [0, *(np.flatnonzero(np.diff(chunk)) + 1).tolist(), len(counts)]
    yield from pairwise(edges)


def _overlap(ones: Float64, others: Float64) -> NDArray[np.bool_]:
    """(m,) whether parallelograms (m, 4, 3) and others in their planes overlap: no edge of either parts them."""
    edges = np.concatenate([each[:, [1, 3]] - each[:, :1] for each in (ones, others)], axis=1)
    axes = np.cross(edges, np.cross(edges[:, 0], edges[:, 1])[:, None])  # across them, in the plane
    a, b = (np.einsum("mej,mpj->mep", axes, each) for each in (ones, others))
    return np.asarray(((a.min(axis=2) < b.max(axis=2)) & (b.min(axis=2) < a.max(axis=2))).all(axis=1), np.bool_)


def _placed_faces(scene: Scene) -> tuple[Indices, Float64, Float64]:
    """Flat faces: their instances (f,), planes (f, 4), which are a unit normal and an offset, and corners (f, 4, 3)."""
    of_mesh = np.array([instance.mesh for instance in scene.instances], np.int64)
    faces, counts, flat = _faces(scene.meshes)
    begins = np.cumsum(counts) - counts
    counts = np.where(np.bincount(of_mesh, minlength=len(counts)) * counts <= MOST_FACES, counts, 0)
    each = counts[of_mesh]
    owners = np.repeat(np.arange(len(of_mesh)), each)
    faces = faces[begins[of_mesh[owners]] + np.arange(len(owners)) - np.repeat(np.cumsum(each) - each, each)]
    matrices = scene.rest[owners]
    points = np.einsum("fij,fpj->fpi", matrices[:, :3, :3], faces) + matrices[:, None, :3, 3]
    normals = np.cross(points[:, 1] - points[:, 0], points[:, 3] - points[:, 0])
    areas = np.linalg.norm(normals, axis=1)
    there = areas > 0.0
    owners, points, normals = owners[there], points[there], normals[there] / areas[there, None]
    signs = np.sign(np.take_along_axis(normals, np.abs(normals).argmax(axis=1)[:, None], axis=1))
    normals = np.where(flat[of_mesh[owners], None], normals * signs, normals)  # a flat mesh is seen from both sides
    equations = np.column_stack([normals, (normals * points[:, 0]).sum(axis=1)])
    return owners, equations, points + TOUCHING * (points.mean(axis=1, keepdims=True) - points)


def _faces(meshes: Sequence[Mesh]) -> tuple[Float64, Indices, NDArray[np.bool_]]:
    """Corners (f, 4, 3) of rectangles about the faces of meshes, object space; how many each has, and if it is flat."""
    n = len(meshes)
    looked_at = [mesh.triangles[:FEW_TRIANGLES] if mesh.spheres is None else mesh.triangles[:0] for mesh in meshes]
    of = np.repeat(np.arange(n), [len(each) for each in looked_at])
    triangles = np.zeros((len(of), 3, 3))
    if len(of):
        np.concatenate([m.vertices[each] for m, each in zip(meshes, looked_at, strict=True)], out=triangles)
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    areas = np.linalg.norm(normals, axis=1)
    there = areas > 0.0
    of, triangles, normals = of[there], triangles[there], normals[there] / areas[there, None]
    offsets = (normals * triangles[:, 0]).sum(axis=1)
    sizes = np.array([np.ptp(m.vertices, axis=0).max() if len(m.vertices) else 0.0 for m in meshes], np.float64)
    has, first = np.unique(of, return_index=True)  # meshes that have triangles, and each one's first
    flat, lead = np.zeros(n, np.bool_), np.zeros(n, np.int64)
    lead[has] = first
    away = np.abs(np.einsum("tpj,tj->tp", triangles, normals[lead[of]]) - offsets[lead[of], None]).max(axis=1)
    flat[has] = np.maximum.reduceat(away, first) <= FLAT * sizes[has] if len(has) else False
    large = np.array([len(mesh.triangles) > FEW_TRIANGLES for mesh in meshes], np.bool_)
    for k in np.flatnonzero(flat & large).tolist():
        flat[k] = np.abs(meshes[k].vertices @ normals[lead[k]] - offsets[lead[k]]).max() <= FLAT * sizes[k]
    keys = np.floor(np.column_stack([normals, offsets / np.maximum(sizes[of], 1e-300)]) / SAME_NORMAL + PHASE)
    keys[flat[of]] = 0.0  # all of it is one face
    kept = np.flatnonzero(flat[of] | ~large[of])
    rows = np.column_stack([of, keys])[kept]
    _, start, plane = np.unique(rows, axis=0, return_index=True, return_inverse=True)
    plane, start = plane.reshape(-1), kept[start]
    points, of_point = triangles[kept].reshape(-1, 3), np.repeat(plane, 3)
    own = [(k, np.searchsorted(of[start], k)) for k in np.flatnonzero(flat & large).tolist()]
    points = np.concatenate([points, *(meshes[k].vertices for k, _ in own)])
    of_point = np.concatenate([of_point, *(np.full(len(meshes[k].vertices), p) for k, p in own)])
    faces, counts = _rectangles(points, of_point, triangles[start], normals[start]), np.bincount(of[start], minlength=n)
    return faces, counts, flat


def _rectangles(points: Float64, of_point: Indices, triangles: Float64, normals: Float64) -> Float64:
    """(f, 4, 3) corners, counter-clockwise about the normals (f, 3), of the smallest rectangles about points of planes.

    Each lies along an edge of one of its triangles (f, 3, 3); of_point : (n,) whose each of the points (n, 3) is.
    """
    order = np.argsort(of_point, kind="stable")
    points, of_point = points[order], of_point[order]
    begins = np.searchsorted(of_point, np.arange(len(normals)))
    found, smallest = np.zeros((len(normals), 4, 3)), np.full(len(normals), np.inf)
    for edge in range(3):
        along = triangles[:, edge] - triangles[:, edge - 1]
        along /= np.linalg.norm(along, axis=1, keepdims=True)
        across = np.cross(normals, along)
        u, v = ((points * each[of_point]).sum(axis=1) for each in (along, across))
        (u0, v0), (u1, v1) = ([bound.reduceat(x, begins) for x in (u, v)] for bound in (np.minimum, np.maximum))
        corners = [a[:, None] * along + b[:, None] * across for a, b in ((u0, v0), (u1, v0), (u1, v1), (u0, v1))]
        better = (u1 - u0) * (v1 - v0) < smallest
        smallest = np.minimum(smallest, (u1 - u0) * (v1 - v0))
        found = np.where(better[:, None, None], np.stack(corners, axis=1), found)
    heights = (triangles[:, 0] * normals).sum(axis=1)
    return np.asarray(found + (heights[:, None] * normals)[:, None], np.float64)
