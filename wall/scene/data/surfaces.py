"""Surfaces and isosurfaces of VTK's files as meshes in the colours of their numbers."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from wall.config.scene_data import ArrayColorConfig, IsosurfaceConfig, SurfaceConfig
from wall.core.errors import SceneError
from wall.scene.data.vtk_files import Surface, isosurface, outer_surface, read_data_set
from wall.scene.repair import RawMesh, Repaired, repair


def surface_meshes(
    config: SurfaceConfig | IsosurfaceConfig, path: Path, name: str, where: str
) -> tuple[list[Repaired], tuple[str, ...]]:
    """The triangles of a file, with material 0, a mesh for each value; and notes.

    where : of the entry in the configuration, for errors. Raises SceneError.
    """
    data_set = read_data_set(path)
    array = None if config.color_by is None else config.color_by.array
    if isinstance(config, SurfaceConfig):
        surfaces = [outer_surface(data_set, array, path, f"{where}.color_by.array")]
    else:
        values = config.value if isinstance(config.value, tuple) else (config.value,)
        surfaces = [
            isosurface(data_set, value, array=config.array, color_array=array, path=path, where=where)
            for value in values
        ]
    notes: list[str] = []
    color_by = config.color_by
    if color_by is not None:
        every = np.concatenate([surface.field.values for surface in surfaces if surface.field is not None])
        notes += color_by.color_map.described(every, f"{name}, {color_by.array}")
        color_map = color_by.color_map.over(every)
        color_by = ArrayColorConfig(array=color_by.array, color_map=color_map)
    repaired = [repair(_raw(surface, name, color_by), 0) for surface in surfaces]
    meshes = [each for each in repaired if isinstance(each, Repaired)]
    notes += [note for each in repaired for note in (each.notes if isinstance(each, Repaired) else each)]
    if not meshes:
        raise SceneError(
            f"{where}: {path.name} has no surface that can be drawn" + "".join(f"\n  {note}" for note in notes)
        )
    return meshes, tuple(notes)


def _raw(surface: Surface, name: str, color_by: ArrayColorConfig | None) -> RawMesh:
    """Triangles with colours at their corners; each has corners of its own where the numbers are of triangles."""
    field = surface.field
    raw = RawMesh(name=name, vertices=surface.vertices, triangles=surface.triangles, normals=surface.normals)
    if color_by is None or field is None:
        return raw
    colors = color_by.color_map.colors(field.values)
    if field.of_points:
        return RawMesh(name=name, vertices=raw.vertices, triangles=raw.triangles, normals=raw.normals, colors=colors)
    corners = raw.triangles.reshape(-1)
    own = np.arange(len(corners), dtype=np.int64).reshape(-1, 3)
    apart = raw.taken(corners, own)
    return RawMesh(
        name=name, vertices=apart.vertices, triangles=own, normals=apart.normals, colors=np.repeat(colors, 3, axis=0)
    )
