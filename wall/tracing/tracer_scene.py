"""TracerScene, a scene as the tracer reads it: arrays laid out for kernels, meshes built once in Embree.

One copy serves all threads of a rank. Vertices and triangles are shared with Embree, not copied into it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wall.core.colour import srgb_decoded
from wall.core.data import Float32, Float64
from wall.scene.build import Scene
from wall.scene.model import Mesh
from wall.scene.needs import Needs, needs
from wall.scene.sky import sky_irradiance
from wall.tracing.embree import Device, Handle

HAS_NORMALS, HAS_COLORS, HAS_UVS = 1, 2, 4


@dataclass(frozen=True, slots=True, kw_only=True)
class TracerScene:
    """Read-only arrays of a scene; see kernels.Surfaces and kernels.trace for shapes and units."""

    scene: Scene
    needs: Needs
    device: Device
    meshes: tuple[Handle, ...]  # Embree scene of each instance's mesh, instance order
    extents: Float64  # (n,) radius of each instance's mesh about its origin
    triangles: NDArray[np.uint32]
    mesh_table: NDArray[np.uint32]
    materials: Float32
    sky: Float32
    irradiance: Float32
    normals: Float32 | None
    colors: Float32 | None
    uvs: Float32 | None
    texels: NDArray[np.uint8] | None
    textures: NDArray[np.int32] | None
    to_linear: Float32
    emission: Float32 | None
    mirrors: Float32 | None

    @property
    def bytes(self) -> int:
        """Memory of the arrays kept here (Embree's own trees come on top)."""
        arrays = [getattr(self, name) for name in self.__slots__]
        return sum(a.nbytes for a in arrays if isinstance(a, np.ndarray))


def make_tracer_scene(scene: Scene) -> TracerScene:
    """Lays a scene out for tracing and builds its Embree meshes; only features that it needs get arrays."""
    wanted = needs(scene)
    vertex_counts = [len(mesh.vertices) for mesh in scene.meshes]
    vertices = np.zeros((sum(vertex_counts) + 2, 3), np.float32)  # Embree may read 16 bytes past the last vertex
    np.concatenate([mesh.vertices for mesh in scene.meshes], out=vertices[:-2])
    triangles = np.ascontiguousarray(np.concatenate([mesh.triangles for mesh in scene.meshes]), np.uint32)
    table = _mesh_table(scene.meshes, wanted)
    texels, textures = _texels(scene) if wanted.textures else (None, None)
    device = Device()
    handles = []
    for mesh, row in zip(scene.meshes, table, strict=True):
        first, start = int(row[1]), int(row[0])
        handles.append(
            device.mesh(vertices[first : first + len(mesh.vertices)], triangles[start : start + len(mesh.triangles)])
        )
    radii = [float(np.sqrt((mesh.vertices.astype(np.float64) ** 2).sum(1).max())) for mesh in scene.meshes]
    of_instance = np.array([instance.mesh for instance in scene.instances], np.uint32)
    return TracerScene(
        scene=scene,
        needs=wanted,
        device=device,
        meshes=tuple(handles[k] for k in of_instance),
        extents=np.array(radii, np.float64)[of_instance],
        triangles=triangles,
        mesh_table=table[of_instance],
        materials=_materials(scene),
        sky=np.array([scene.sky.zenith, scene.sky.horizon, scene.sky.ground], np.float32),
        irradiance=sky_irradiance(scene.sky),
        normals=_attribute(scene.meshes, "normals", 3) if wanted.smooth_normals else None,
        colors=_attribute(scene.meshes, "colors", 3) if wanted.vertex_colors else None,
        uvs=_attribute(scene.meshes, "uvs", 2) if wanted.textures else None,
        texels=texels,
        textures=textures,
        to_linear=srgb_decoded(np.arange(256) / 255.0).astype(np.float32),
        emission=np.ones(1, np.float32) if wanted.emission else None,
        mirrors=np.ones(1, np.float32) if wanted.mirrors else None,
    )


def _mesh_table(meshes: tuple[Mesh, ...], wanted: Needs) -> NDArray[np.uint32]:
    table = np.zeros((len(meshes), 4), np.uint32)
    triangle = vertex = 0
    for row, mesh in zip(table, meshes, strict=True):
        flags = HAS_NORMALS * (mesh.normals is not None and wanted.smooth_normals)
        flags += HAS_COLORS * (mesh.colors is not None) + HAS_UVS * (mesh.uvs is not None)
        row[:] = triangle, vertex, mesh.material, flags
        triangle += len(mesh.triangles)
        vertex += len(mesh.vertices)
    return table


def _attribute(meshes: tuple[Mesh, ...], name: str, width: int) -> Float32:
    parts = [getattr(mesh, name) for mesh in meshes]
    blank = [np.zeros((len(mesh.vertices), width), np.float32) for mesh in meshes]
    return np.concatenate([b if p is None else p for p, b in zip(parts, blank, strict=True)]).astype(np.float32)


def _materials(scene: Scene) -> Float32:
    rows = np.zeros((len(scene.materials), 8), np.float32)
    for row, material in zip(rows, scene.materials, strict=True):
        row[:7] = *material.base_color, material.mirror, *material.emission
    return rows


def _texels(scene: Scene) -> tuple[NDArray[np.uint8], NDArray[np.int32]]:
    firsts = np.cumsum([0, *(t.texels.shape[0] * t.texels.shape[1] for t in scene.textures)])
    table = np.zeros((len(scene.materials), 3), np.int32)
    for row, material in zip(table, scene.materials, strict=True):
        if material.texture is not None:
            height, width = scene.textures[material.texture].texels.shape[:2]
            row[:] = firsts[material.texture], width, height
    return np.concatenate([t.texels.reshape(-1, 3) for t in scene.textures]), table
