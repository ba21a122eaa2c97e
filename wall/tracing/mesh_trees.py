"""Embree's trees of a scene's meshes: triangles, spheres or curves, and what of them is not there."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wall.core.data import Float32
from wall.scene.build import Scene
from wall.scene.model import Mesh
from wall.tracing.embree import Device, Handle, Passing
from wall.tracing.kernels.values import CLAMP, HAS_POINT_COLORS, HAS_SEGMENTS, MIRROR, REPEAT

WRAPS = {"repeat": REPEAT, "clamp": CLAMP, "mirror": MIRROR}


def mesh_tree(device: Device, scene: Scene, mesh: Mesh, vertices: Float32, triangles: NDArray[np.uint32]) -> Handle:
    """A tree of one mesh, which shares its arrays.

    vertices, triangles : of triangles, what Device.mesh takes; of spheres not read
    """
    passing = _transparency(scene, mesh, triangles)
    if mesh.spheres is not None and mesh.segments is not None:
        return device.curves(mesh.spheres, mesh.segments, passing)
    if mesh.spheres is not None:
        return device.spheres(mesh.spheres, passing)
    return device.mesh(vertices, triangles, passing)


def round_flags(mesh: Mesh) -> int:
    """MESH_FLAGS of spheres or curves."""
    colored = mesh.colors is not None
    return HAS_POINT_COLORS * colored + HAS_SEGMENTS * (colored and mesh.segments is not None)


def padded(vertices: Float32) -> Float32:
    """(v, 3) vertices behind which 16 bytes can be read."""
    rows = np.zeros((len(vertices) + 2, 3), np.float32)
    rows[:-2] = vertices
    return rows[:-2]


def extent_of(mesh: Mesh) -> float:
    """How far a mesh reaches from its origin, object space."""
    if mesh.spheres is not None:
        x, y, z, radii = mesh.spheres.T
        return float((np.sqrt(x * x + y * y + z * z) + radii).max())
    return float(np.sqrt((mesh.vertices.astype(np.float64) ** 2).sum(1).max()))


def _transparency(scene: Scene, mesh: Mesh, triangles: NDArray[np.uint32]) -> Passing | None:
    """What Device.mesh takes for a mesh that is not there in places; None for all others."""
    material = scene.materials[mesh.material]
    number = material.textures.base_color
    texture = None if number is None or mesh.uvs is None else scene.textures[number]
    texels = None if texture is None or texture.alpha is None else np.ascontiguousarray(texture.alpha)
    if material.alpha_mode == "opaque" or (texels is None and material.alpha_mode == "blend" and material.alpha >= 1.0):
        return None
    from wall.tracing.kernels import alpha

    uvs = None
    numbers = np.zeros(alpha.MESH_NUMBERS, np.int64)
    numbers[alpha.BLENDS] = material.alpha_mode == "blend"
    values = numbers.view(np.float32)
    values[2 * alpha.ALPHA], values[2 * alpha.CUTOFF] = material.alpha, material.alpha_cutoff
    if texture is not None and texels is not None:
        uvs = np.ascontiguousarray(mesh.uvs_of(texture), np.float32)
        numbers[: alpha.WIDTH] = triangles.ctypes.data, uvs.ctypes.data, texels.ctypes.data
        numbers[alpha.WIDTH], numbers[alpha.HEIGHT] = texels.shape[1], texels.shape[0]
        numbers[alpha.WRAP_U], numbers[alpha.WRAP_V] = (WRAPS[way] for way in texture.wrap)
    return alpha.PASS_TRANSPARENT, tuple(array for array in (numbers, triangles, uvs, texels) if array is not None)
