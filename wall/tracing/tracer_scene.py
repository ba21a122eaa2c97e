"""TracerScene, a scene as the tracer reads it: arrays laid out for kernels, meshes built once in Embree.

One copy serves all threads of a rank. Vertices and triangles are shared with Embree, not copied into it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wall.core.colour import LUMINANCE, srgb_decoded
from wall.core.data import Float32, Float64
from wall.scene.build import Scene
from wall.scene.model import Material, Mesh, PointLight, Shading, Sky, SpotLight
from wall.scene.needs import Needs, needs
from wall.scene.of_views import Way, way_of
from wall.scene.sky import sky_irradiance
from wall.tracing.coplanar import depth_scales
from wall.tracing.embree import Device, Handle
from wall.tracing.environment import environment_tables
from wall.tracing.interface import interface_table
from wall.tracing.kernels.values import (
    FIRST_SEGMENT,
    HAS_COLORS,
    HAS_NORMALS,
    HAS_UVS,
    MATERIAL,
    MATERIAL_ROW,
    PLACEMENT_COLUMNS,
    Emitters,
    Environment,
    LightTree,
    Materials,
    Meshes,
    Scattering,
    Surfaces,
    Textures,
)
from wall.tracing.light_trees import emitter_tree, make_tree
from wall.tracing.mesh_trees import WRAPS, extent_of, mesh_tree, round_flags
from wall.tracing.mip_levels import mip_levels
from wall.tracing.steps import Steps

LEAST_EMITTERS = 64  # triangles that a tree chooses from; fewer are chosen by power alone, docs/lab/light.md
LEAST_POINTS, LEAST_SPOTS = 32, 128  # lights that a tree chooses from on paths; fewer are all looked at
DARKEST_MEAN = 1e-3  # of a texture: a dark one is still aimed at where it shines
OF_TEXTURES = {"first_texel", "texture_width", "texture_height", "wrap_u", "wrap_v", "uv_set"}


@dataclass(frozen=True, slots=True, kw_only=True)
class TracerScene:
    """Read-only arrays of a scene; the values that kernels take, and what places them."""

    scene: Scene
    needs: Needs
    device: Device
    trees: bool  # whether trees choose among many lights
    vertices: Float32  # (v + 2, 3) of all triangle meshes, which Embree reads too
    meshes: tuple[Handle, ...]  # Embree scene of each instance's mesh, instance order
    extents: Float64  # (n,) radius of each instance's mesh about its origin
    depth_scales: Float64  # (n,) of each instance about the eye; see coplanar
    surfaces: Surfaces  # whose meshes have no placements or eye_from_object, which are each Tracer's own
    materials: Materials
    emitters: Emitters | None
    point_tree: LightTree | None  # over point lights at rest, and over spots; None: they are few, or light is direct
    spot_tree: LightTree | None
    environment: Environment | None
    sky: Float32  # (3, 3), see Lights
    sky_irradiance: Float32
    steps: Steps | None  # of series; None: there are none
    _others: dict[Way, TracerScene] = field(init=False, repr=False, compare=False, default_factory=dict)

    def under(self, scene: Scene) -> TracerScene:
        """This one, or, for another integrator or lens of the same scene, one of the same meshes, made once.

        Embree's trees, vertices, their attributes and texels are shared; only tables of what emits are its own.
        """
        way = way_of(scene)
        if way == way_of(self.scene):
            return self
        if way not in self._others:
            self._others[way] = _for_integrator(self, scene)
        return self._others[way]

    @property
    def both_sides(self) -> NDArray[np.bool_]:
        """(n,) bool, whether each instance emits from behind as well."""
        material = self.surfaces.meshes.mesh_table[:, MATERIAL_ROW]
        found: NDArray[np.bool_] = self.materials.rows["emits_behind"][material] > 0.0
        return found

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
        lights = self.emitters, self.point_tree, self.spot_tree, self.environment, self.sky, self.sky_irradiance
        return _bytes((self.extents, self.surfaces, self.materials, *lights))


def _bytes(value: Any) -> int:
    """Bytes of the arrays in a tuple, and in tuples in it."""
    if isinstance(value, tuple):
        return sum(map(_bytes, value))
    return value.nbytes if isinstance(value, np.ndarray) else 0


def make_tracer_scene(scene: Scene, *, trees: bool = True) -> TracerScene:
    """Lays a scene out for tracing and builds its Embree meshes; only features that it needs get arrays.

    trees : whether trees choose among many lights; without, as few lights are treated, to compare with
    """
    wanted = needs(scene)
    order = sorted(range(len(scene.meshes)), key=lambda k: _lacks(scene, scene.meshes[k]))
    meshes, row_of = [scene.meshes[k] for k in order], np.argsort(order)
    corners = [mesh.vertices[: _corners(mesh)] for mesh in meshes]
    vertices = np.zeros((sum(map(len, corners)) + 2, 3), np.float32)  # Embree may read 16 bytes past the last vertex
    np.concatenate(corners, out=vertices[:-2])
    triangles = np.ascontiguousarray(np.concatenate([mesh.triangles for mesh in meshes]), np.uint32)
    table = _mesh_table(scene, meshes, wanted)
    device = Device()
    handles = []
    for mesh, row in zip(meshes, table, strict=True):
        first, start = int(row[1]), int(row[0])
        own = vertices[first : first + len(mesh.vertices)], triangles[start : start + len(mesh.triangles)]
        handles.append(mesh_tree(device, scene, mesh, *own))
    radii = [extent_of(mesh) for mesh in meshes]
    of_instance = row_of[[instance.mesh for instance in scene.instances]]
    surfaces = Surfaces(
        meshes=Meshes(
            triangles=triangles,
            mesh_table=table[of_instance],
            placements=np.zeros((0, PLACEMENT_COLUMNS), np.float32),
            eye_from_object=np.zeros((0, 12), np.float32),
        ),
        normals=_attribute([mesh.normals for mesh in meshes], meshes, 3) if wanted.smooth_normals else None,
        colors=_attribute([_vertex_colors(mesh) for mesh in meshes], meshes, 3) if wanted.vertex_colors else None,
        point_colors=_point_colors(meshes) if wanted.point_colors else None,
        segments=_segments(meshes) if wanted.curves and wanted.point_colors else None,
        uvs=_uvs(scene, meshes, wanted) if wanted.textures else None,
        vertices=None,
        relit=None,
    )
    of_any = TracerScene(
        scene=scene,
        needs=wanted,
        device=device,
        trees=trees,
        vertices=vertices,
        meshes=tuple(handles[k] for k in of_instance),
        extents=np.array(radii, np.float64)[of_instance],
        depth_scales=depth_scales(scene),
        surfaces=surfaces,
        materials=_materials(*_material_rows(scene, wanted), wanted),
        emitters=None,
        point_tree=None,
        spot_tree=None,
        environment=None,
        sky=sky_rows(scene.sky),
        sky_irradiance=sky_irradiance(scene.sky),
        steps=Steps() if scene.series else None,
    )
    return _for_integrator(of_any, scene)


def _for_integrator(laid: TracerScene, scene: Scene) -> TracerScene:
    """A laid-out scene with the tables and the features of the integrator that `scene` has; all else is shared."""
    wanted, trees = needs(scene), laid.trees
    surfaces = laid.surfaces._replace(
        vertices=laid.vertices if wanted.textures or wanted.emitters or wanted.smooth_normals else None,
        relit=True if wanted.relighting else None,
    )
    return replace(
        laid,
        scene=scene,
        needs=wanted,
        surfaces=surfaces,
        materials=_materials(laid.materials.rows, laid.materials.textures.texels, wanted),
        emitters=_emitters(scene, surfaces if trees else None) if wanted.emitters else None,
        point_tree=_point_tree(scene, scene.point_lights if trees else (), LEAST_POINTS),
        spot_tree=_point_tree(scene, scene.spot_lights if trees else (), LEAST_SPOTS),
        environment=None
        if scene.environment is None
        else environment_tables(scene.environment, paths=scene.path_depth is not None),
    )


def sky_rows(sky: Sky) -> Float32:
    """(3, 3) float32, see Lights.sky."""
    return np.array([sky.zenith, sky.horizon, sky.ground], np.float32)


def _shows_textures(scene: Scene, mesh: Mesh) -> bool:
    textures = scene.materials[mesh.material].textures
    return mesh.uvs is not None and any(number is not None for number in textures)


def _lacks(scene: Scene, mesh: Mesh) -> tuple[bool, ...]:
    """By what meshes are laid out: those with an attribute come first, so that its array ends with the last of them."""
    return not _shows_textures(scene, mesh), _vertex_colors(mesh) is None, mesh.normals is None


def _corners(mesh: Mesh) -> int:
    """How many of a mesh's vertices are corners of triangles: all, or none of spheres."""
    return len(mesh.vertices) if mesh.spheres is None else 0


def _vertex_colors(mesh: Mesh) -> Float32 | None:
    return mesh.colors if mesh.spheres is None else None


def _point_colors(meshes: Sequence[Mesh]) -> Float32:
    """(s, 3) float32 of all spheres that have colours; not copied where one mesh has them all."""
    found = [mesh.colors for mesh in meshes if mesh.spheres is not None and mesh.colors is not None]
    return np.ascontiguousarray(found[0] if len(found) == 1 else np.concatenate(found), np.float32)


def _segments(meshes: Sequence[Mesh]) -> NDArray[np.uint32]:
    """(c,) of all curves."""
    return np.concatenate([mesh.segments for mesh in meshes if mesh.segments is not None])


def _mesh_table(scene: Scene, meshes: Sequence[Mesh], wanted: Needs) -> NDArray[np.uint32]:
    """(meshes, 4) uint32, a row of Meshes.mesh_table for each mesh."""
    table = np.zeros((len(meshes), 4), np.uint32)
    triangle = vertex = sphere = segment = 0
    for row, mesh in zip(table, meshes, strict=True):
        if mesh.spheres is not None:
            row[:] = triangle, sphere, mesh.material, round_flags(mesh)
            if mesh.segments is not None:
                row[FIRST_SEGMENT], segment = segment, segment + len(mesh.segments)
            sphere += len(mesh.spheres) if mesh.colors is not None else 0
            continue
        flags = HAS_NORMALS * (mesh.normals is not None and wanted.smooth_normals)
        flags += HAS_COLORS * (mesh.colors is not None) + HAS_UVS * _shows_textures(scene, mesh)
        row[:] = triangle, vertex, mesh.material, flags
        triangle += len(mesh.triangles)
        vertex += len(mesh.vertices)
    return table


def _attribute(rows: Sequence[Float32 | None], meshes: Sequence[Mesh], width: int) -> Float32:
    """(v, width) float32 of the vertices of meshes up to the last that has rows; zero where one of them has none."""
    last = max(k for k, own in enumerate(rows) if own is not None)
    parts = [np.zeros((_corners(mesh), width), np.float32) for mesh in meshes[: last + 1]]
    for part, own in zip(parts, rows, strict=False):
        if own is not None:
            part[:, : own.shape[1]] = own[:, :width]
    return np.concatenate(parts)


def _uvs(scene: Scene, meshes: Sequence[Mesh], wanted: Needs) -> Float32:
    """Texture coordinates of the meshes that show textures."""
    rows = [mesh.uvs if _shows_textures(scene, mesh) else None for mesh in meshes]
    return _attribute(rows, meshes, _uv_columns(scene, wanted))


def _uv_columns(scene: Scene, wanted: Needs) -> int:
    """Columns of Surfaces.uvs: a pair of each set that textures are looked up by."""
    return 2 * (1 + max(texture.uv_set for texture in scene.textures)) if wanted.uv_sets else 2


def _material_rows(scene: Scene, wanted: Needs) -> tuple[NDArray[Any], NDArray[np.uint8] | None]:
    """One MATERIAL row for each of the scene's materials, and the texels (p, 3) of all textures one after another."""
    texels = [mip_levels(t.texels, linear=t.linear) for t in scene.textures] if wanted.textures else []
    firsts = np.cumsum([0, *map(len, texels)])
    rows = np.zeros(len(scene.materials), MATERIAL)
    for row, material in zip(rows, scene.materials, strict=True):
        _write(row, material)
        for slot, number in enumerate(material.textures):
            if wanted.textures and number is not None:
                texture = scene.textures[number]
                row["first_texel"][slot] = firsts[number]
                row["texture_height"][slot], row["texture_width"][slot] = texture.texels.shape[:2]
                row["wrap_u"][slot], row["wrap_v"][slot] = (WRAPS[way] for way in texture.wrap)
                row["uv_set"][slot] = texture.uv_set
    return rows, np.concatenate(texels) if wanted.textures else None


def _materials(rows: NDArray[Any], texels: NDArray[np.uint8] | None, wanted: Needs) -> Materials:
    """Rows and texels, with what tells kernels which features to have."""
    return Materials(
        rows=rows,
        textures=Textures(
            texels=texels,
            linear_of_srgb=srgb_decoded(np.arange(256) / 255.0).astype(np.float32),
            value_of_byte=(np.arange(256) / 255.0).astype(np.float32),
            edges=True if wanted.texture_edges else None,
            uv_sets=True if wanted.uv_sets else None,
        ),
        emission_textures=True if wanted.emission_textures else None,
        normal_textures=True if wanted.normal_textures else None,
        emits=True if wanted.emission else None,
        mirrors=True if wanted.mirrors else None,
        absorbs=True if wanted.absorption else None,
        scattering=Scattering(
            metallic_roughness_textures=True if wanted.metallic_roughness_textures else None,
            thin_glass=True if wanted.thin_glass else None,
            solid_glass=True if wanted.solid_glass else None,
            interface=interface_table() if wanted.interfaces else None,
            parts=True if wanted.mirrors or wanted.thin_glass or wanted.solid_glass else None,
            rounded=True if wanted.smooth_normals else None,
        ),
    )


def _write(row: Any, material: Material) -> None:
    """Write a material to its MATERIAL row, but for its textures."""
    for name in set(MATERIAL.fields or ()) - OF_TEXTURES:
        row[name] = getattr(material, name)


def _emitters(scene: Scene, surfaces: Surfaces | None) -> Emitters:
    """Every triangle that emits, by its power at rest, and a tree of them where they are many; None: without it."""
    first, instances, powers, count = np.full(len(scene.instances), -1, np.int64), [], [], 0
    steps = {row for each in scene.series for row in range(each.rows.start, each.rows.stop)}
    for k, instance in enumerate(scene.instances):
        mesh = scene.meshes[instance.mesh]
        emission = np.array(scene.materials[mesh.material].emission)
        if emission.max() <= 0.0 or mesh.spheres is not None or k in steps:  # rays see those, and are not aimed at them
            continue
        corners = (mesh.vertices.astype(np.float64) @ instance.world_from_object[:3, :3].T)[mesh.triangles]
        areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2
        first[k], count = count, count + len(areas)
        instances.append(np.full(len(areas), k, np.uint32))
        powers.append(areas * (emission * _mean_light(scene, mesh) @ LUMINANCE))
    power = np.concatenate(powers)
    chance = (power / power.sum()).astype(np.float32)
    emitters = Emitters(first, np.concatenate(instances), chance, np.cumsum(chance, dtype=np.float64), None, None)
    if surfaces is None or count < LEAST_EMITTERS:
        return emitters
    return emitters._replace(tree=emitter_tree(emitters, surfaces, scene.rest))


def _point_tree(scene: Scene, lights: Sequence[PointLight | SpotLight], least: int) -> LightTree | None:
    """A tree over lights at rest where paths meet at least so many; None elsewhere."""
    if scene.path_depth is None or scene.occlusion is not None or len(lights) < least:
        return None
    return make_tree(np.array([light.position for light in lights], np.float64))


def _mean_light(scene: Scene, mesh: Mesh) -> Float64:
    """(3,) mean of the texture that a mesh's emission is multiplied by, never 0; of all of it, used or not."""
    number = scene.materials[mesh.material].textures.emission
    if number is None or mesh.uvs is None:
        return np.ones(3)
    mean: Float64 = srgb_decoded(scene.textures[number].texels / 255.0).mean(axis=(0, 1))
    return np.maximum(mean, DARKEST_MEAN)
