"""TracerScene, a scene as the tracer reads it: arrays laid out for kernels, meshes built once in Embree.

One copy serves all threads of a rank. Vertices and triangles are shared with Embree, not copied into it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wall.core.colour import LUMINANCE, srgb_decoded, srgb_encoded
from wall.core.data import Float32, Float64
from wall.scene.build import Scene
from wall.scene.model import Material, Mesh, Shading, Sky
from wall.scene.needs import Needs, needs
from wall.scene.sky import sky_irradiance
from wall.tracing.embree import Device, Handle
from wall.tracing.interface import interface_table
from wall.tracing.kernels.values import (
    HAS_COLORS,
    HAS_NORMALS,
    HAS_UVS,
    MATERIAL,
    PLACEMENT_COLUMNS,
    Emitters,
    Materials,
    Surfaces,
)

TEXTURE_FIELDS = {"first_texel", "texture_width", "texture_height"}


@dataclass(frozen=True, slots=True, kw_only=True)
class TracerScene:
    """Read-only arrays of a scene; the values that kernels take, and what places them."""

    scene: Scene
    needs: Needs
    device: Device
    meshes: tuple[Handle, ...]  # Embree scene of each instance's mesh, instance order
    extents: Float64  # (n,) radius of each instance's mesh about its origin
    surfaces: Surfaces  # without placements and eye_from_object, which are each Tracer's own
    materials: Materials
    emitters: Emitters | None
    sky: Float32  # (3, 3), see Lights
    sky_irradiance: Float32

    def materials_of(self, shading: Shading) -> Materials:
        """What surfaces look like under a shading of the scene: new rows for materials that were edited."""
        if shading.materials is self.scene.materials:
            return self.materials
        rows = self.materials.rows.copy()
        for row, material, base in zip(rows, shading.materials, self.scene.materials, strict=True):
            if material is not base:
                _write(row, material)
        return self.materials._replace(rows=rows)

    @property
    def bytes(self) -> int:
        """Memory of the arrays kept here (Embree's own trees come on top)."""
        arrays = (
            self.extents, *self.surfaces, *self.materials, *(self.emitters or ()), self.sky, self.sky_irradiance
        )  # fmt: skip
        return sum(a.nbytes for a in arrays if isinstance(a, np.ndarray))


def make_tracer_scene(scene: Scene) -> TracerScene:
    """Lays a scene out for tracing and builds its Embree meshes; only features that it needs get arrays."""
    wanted = needs(scene)
    vertex_counts = [len(mesh.vertices) for mesh in scene.meshes]
    vertices = np.zeros((sum(vertex_counts) + 2, 3), np.float32)  # Embree may read 16 bytes past the last vertex
    np.concatenate([mesh.vertices for mesh in scene.meshes], out=vertices[:-2])
    triangles = np.ascontiguousarray(np.concatenate([mesh.triangles for mesh in scene.meshes]), np.uint32)
    table = _mesh_table(scene.meshes, wanted)
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
        surfaces=Surfaces(
            triangles=triangles,
            mesh_table=table[of_instance],
            placements=np.zeros((0, PLACEMENT_COLUMNS), np.float32),
            normals=_attribute(scene.meshes, "normals", 3) if wanted.smooth_normals else None,
            colors=_attribute(scene.meshes, "colors", 3) if wanted.vertex_colors else None,
            uvs=_attribute(scene.meshes, "uvs", 2) if wanted.textures else None,
            vertices=vertices if wanted.textures or wanted.emitters else None,
            eye_from_object=np.zeros((0, 12), np.float32),
            relit=True if wanted.relighting else None,
        ),
        materials=_materials(scene, wanted),
        emitters=_emitters(scene) if wanted.emitters else None,
        sky=sky_rows(scene.sky),
        sky_irradiance=sky_irradiance(scene.sky),
    )


def sky_rows(sky: Sky) -> Float32:
    """(3, 3) float32, see Lights.sky."""
    return np.array([sky.zenith, sky.horizon, sky.ground], np.float32)


def _mesh_table(meshes: tuple[Mesh, ...], wanted: Needs) -> NDArray[np.uint32]:
    """(meshes, 4) uint32, a row of Surfaces.mesh_table for each mesh."""
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
    """(v, width) float32 of all meshes' vertices, zero where a mesh does not have the attribute."""
    parts = [getattr(mesh, name) for mesh in meshes]
    blank = [np.zeros((len(mesh.vertices), width), np.float32) for mesh in meshes]
    return np.concatenate([b if p is None else p for p, b in zip(parts, blank, strict=True)]).astype(np.float32)


def _materials(scene: Scene, wanted: Needs) -> Materials:
    """One MATERIAL row for each of the scene's materials, and the texels of all textures one after another."""
    texels = [mip_levels(texture.texels) for texture in scene.textures] if wanted.textures else []
    firsts = np.cumsum([0, *map(len, texels)])
    rows = np.zeros(len(scene.materials), MATERIAL)
    for row, material in zip(rows, scene.materials, strict=True):
        _write(row, material)
        if wanted.textures and (texture := material.texture) is not None:
            row["first_texel"] = firsts[texture]
            row["texture_height"], row["texture_width"] = scene.textures[texture].texels.shape[:2]
    return Materials(
        rows=rows,
        texels=np.concatenate(texels) if wanted.textures else None,
        linear_of_srgb=srgb_decoded(np.arange(256) / 255.0).astype(np.float32),
        emits=True if wanted.emission else None,
        mirrors=True if wanted.mirrors else None,
        interface=interface_table() if wanted.interfaces else None,
    )


def _write(row: Any, material: Material) -> None:
    """Write a material to its MATERIAL row, but for its texture."""
    for name in set(MATERIAL.fields or ()) - TEXTURE_FIELDS:
        row[name] = getattr(material, name)


def _emitters(scene: Scene) -> Emitters:
    """Every triangle that emits, by its power at rest."""
    first, instances, powers, count = np.full(len(scene.instances), -1, np.int64), [], [], 0
    for k, instance in enumerate(scene.instances):
        mesh = scene.meshes[instance.mesh]
        emission = np.array(scene.materials[mesh.material].emission)
        if emission.max() <= 0.0:
            continue
        corners = (mesh.vertices.astype(np.float64) @ instance.world_from_object[:3, :3].T)[mesh.triangles]
        areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2
        first[k], count = count, count + len(areas)
        instances.append(np.full(len(areas), k, np.uint32))
        powers.append(areas * (emission @ LUMINANCE))
    power = np.concatenate(powers)
    chance = (power / power.sum()).astype(np.float32)
    return Emitters(first, np.concatenate(instances), chance, np.cumsum(chance, dtype=np.float64))


def mip_levels(texels: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """(p, 3) sRGB texels of (h, w, 3) and of its mip levels, each half as wide and high, rounded down, to one texel.

    A level's texel is the mean of what it covers in the level before, in linear light.
    """
    levels, linear = [texels.reshape(-1, 3)], srgb_decoded(texels / 255.0)
    while linear.shape[:2] != (1, 1):
        linear = _halved(_halved(linear).swapaxes(0, 1)).swapaxes(0, 1)
        levels.append(np.round(srgb_encoded(linear) * 255.0).astype(np.uint8).reshape(-1, 3))
    return np.concatenate(levels)


def _halved(rows: Float64) -> Float64:
    """Means of rows (n, ...), half as many, rounded down, each of the same share of the n."""
    n, half = len(rows), max(1, len(rows) // 2)
    if n == 2 * half:
        return 0.5 * (rows[::2] + rows[1::2])
    edges = np.arange(half + 1) * (n / half)
    whole = np.minimum(edges.astype(np.int64), n - 1)
    sums = np.concatenate([np.zeros_like(rows[:1]), np.cumsum(rows, axis=0)])
    at_edges = sums[whole] + (edges - whole).reshape(-1, *[1] * (rows.ndim - 1)) * rows[whole]
    return np.diff(at_edges, axis=0) * (half / n)
