"""Objects whose flat faces lie in one plane, and overlap: which of them is behind the other.

Their distances along a ray differ by rounding alone, so that which one is seen would change from ray to ray, and with
every movement of the camera. One that is behind others is scaled about the eye by some roundings: no image moves.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wall.core.data import Float64
from wall.scene.build import Scene
from wall.scene.model import Mesh

BEHIND = 2.0**-20  # of the distance, by which one lies behind the next: 16 roundings of float32
MOST_BEHIND = 64  # objects one behind the other
FEW_TRIANGLES = 64  # of a mesh whose faces are looked at one by one; of larger ones only those that are flat
MOST_FACES = 4096  # of all instances of a mesh: what is placed more often is left as it is
SAME_NORMAL, SAME_PLANE = 1e-4, 1e-5  # steps of a unit normal's components; of an offset, times the scene's radius
PHASE = 0.37  # of a step: axes and planes through the origin lie inside of one
FLAT = 1e-6  # of a mesh's size
TOUCHING = 1e-5  # of a face's size: what overlaps less lies beside it


def depth_scales(scene: Scene) -> Float64:
    """(n,) by how much each instance is to be scaled about the eye: 1, or a little more for one behind others.

    What emits is before what does not, else the order is that of objects. Places are those at rest.
    """
    scales = np.ones(len(scene.instances))
    owners, equations, corners = _placed_faces(scene)
    if len(owners) == 0:
        return scales
    steps = np.array([SAME_NORMAL] * 3 + [max(SAME_PLANE * scene.radius, 1e-300)])
    planes = np.unique(np.floor(equations / steps + PHASE), axis=0, return_inverse=True)[1].reshape(-1)
    shared = np.bincount(planes)[planes] > 1
    owners, planes, corners = owners[shared], planes[shared], corners[shared]
    behind, before = np.zeros(len(scales), np.int64), np.zeros(len(owners), np.bool_)
    for k in sorted(set(owners.tolist()), key=lambda k: (not _emits(scene, k), k)):
        own = owners == k
        for face in np.flatnonzero(own):
            others = np.flatnonzero(before & (planes == planes[face]))
            over = others[_overlap(corners[face], corners[others])]
            behind[k] = max(behind[k], behind[owners[over]].max(initial=-1) + 1)
        before |= own
    return np.asarray(scales + BEHIND * np.minimum(behind, MOST_BEHIND), np.float64)


def _emits(scene: Scene, k: int) -> bool:
    return any(scene.materials[scene.meshes[scene.instances[k].mesh].material].emission)


def _overlap(one: Float64, others: Float64) -> NDArray[np.bool_]:
    """(m,) whether a parallelogram (4, 3) and others (m, 4, 3) in its plane overlap: no edge of theirs parts them."""
    edges = np.broadcast_to(one[[1, 3]] - one[0], (len(others), 2, 3))
    edges = np.concatenate([edges, others[:, [1, 3]] - others[:, :1]], axis=1)
    axes = np.cross(edges, np.cross(one[1] - one[0], one[3] - one[0]))  # across them, in the plane
    a, b = np.einsum("mej,pj->mep", axes, one), np.einsum("mej,mpj->mep", axes, others)
    return np.asarray(((a.min(axis=2) < b.max(axis=2)) & (b.min(axis=2) < a.max(axis=2))).all(axis=1), np.bool_)


def _placed_faces(scene: Scene) -> tuple[NDArray[np.int64], Float64, Float64]:
    """Flat faces: their instances (f,), planes (f, 4), which are a unit normal and an offset, and corners (f, 4, 3)."""
    of_mesh = np.array([instance.mesh for instance in scene.instances], np.int64)
    owners, planes, corners = [np.zeros(0, np.int64)], [np.zeros((0, 4))], [np.zeros((0, 4, 3))]
    for number, mesh in enumerate(scene.meshes):
        placed = np.flatnonzero(of_mesh == number)
        faces, one_plane = _faces(mesh)
        if not 0 < len(placed) * len(faces) <= MOST_FACES:
            continue
        matrices = scene.rest[placed]
        points = np.einsum("mij,fpj->mfpi", matrices[:, :3, :3], faces) + matrices[:, None, None, :3, 3]
        points = points.reshape(-1, 4, 3)
        normals = np.cross(points[:, 1] - points[:, 0], points[:, 3] - points[:, 0])
        areas = np.linalg.norm(normals, axis=1)
        there = areas > 0.0
        points, normals = points[there], normals[there] / areas[there, None]
        if one_plane:  # it is seen from both sides
            normals *= np.sign(np.take_along_axis(normals, np.abs(normals).argmax(axis=1)[:, None], axis=1))
        owners.append(np.repeat(placed, len(faces))[there])
        planes.append(np.column_stack([normals, (normals * points[:, 0]).sum(axis=1)]))
        corners.append(points + TOUCHING * (points.mean(axis=1, keepdims=True) - points))
    return np.concatenate(owners), np.concatenate(planes), np.concatenate(corners)


def _faces(mesh: Mesh) -> tuple[Float64, bool]:
    """(f, 4, 3) corners of rectangles about a mesh's faces, object space; and whether it lies in one plane."""
    none = np.zeros((0, 4, 3))
    if mesh.spheres is not None or len(mesh.triangles) == 0:
        return none, False
    vertices = mesh.vertices
    first = vertices[mesh.triangles[:FEW_TRIANGLES]].astype(np.float64)
    normals = np.cross(first[:, 1] - first[:, 0], first[:, 2] - first[:, 0])
    areas = np.linalg.norm(normals, axis=1)
    size = float(np.ptp(vertices, axis=0).max())
    first, normals = first[areas > 0.0], normals[areas > 0.0] / areas[areas > 0.0, None]
    if len(first) == 0:
        return none, False
    offsets = (normals * first[:, 0]).sum(axis=1)
    if np.abs(first.reshape(-1, 3) @ normals[0] - offsets[0]).max() <= FLAT * size:
        if len(mesh.triangles) > FEW_TRIANGLES and np.abs(vertices @ normals[0] - offsets[0]).max() > FLAT * size:
            return none, False
        return _rectangle(vertices.astype(np.float64), first[0], normals[0])[None], True
    if len(mesh.triangles) > FEW_TRIANGLES:
        return none, False
    keys = np.floor(np.column_stack([normals, offsets / size]) / SAME_NORMAL + PHASE)
    planes = np.unique(keys, axis=0, return_inverse=True)[1].reshape(-1)
    of_planes = [np.flatnonzero(planes == k) for k in range(planes.max() + 1)]
    return np.array([_rectangle(first[t].reshape(-1, 3), first[t[0]], normals[t[0]]) for t in of_planes]), False


def _rectangle(points: Float64, triangle: Float64, normal: Float64) -> Float64:
    """(4, 3) corners, counter-clockwise about the normal, of the smallest rectangle about points (n, 3) of a plane.

    It lies along an edge of one of their triangles (3, 3).
    """
    found, smallest = np.zeros((4, 3)), np.inf
    for along in triangle - np.roll(triangle, 1, axis=0):
        along = along / np.linalg.norm(along)
        across = np.cross(normal, along)
        (u0, u1), (v0, v1) = ((x.min(), x.max()) for x in (points @ along, points @ across))
        if (u1 - u0) * (v1 - v0) < smallest:
            smallest = (u1 - u0) * (v1 - v0)
            corners = [u * along + v * across for u, v in ((u0, v0), (u1, v0), (u1, v1), (u0, v1))]
            found = np.array(corners) + (triangle[0] @ normal) * normal
    return found
