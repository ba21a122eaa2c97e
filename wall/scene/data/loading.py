"""From an entry of `scene.data` to an object of the scene."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TypeAlias

import numpy as np

from wall.config.scene_data import CurvesConfig, DataConfig, PointsConfig
from wall.core.data import Float32, Float64
from wall.core.errors import SceneError
from wall.scene.data.errors import NoSurfaceError
from wall.scene.data.points import points_mesh
from wall.scene.data.steps import Part, steps_of
from wall.scene.data.vtk_files import READERS
from wall.scene.loader_process import load_apart, load_request
from wall.scene.model import Instance, Material, Mesh, Source
from wall.scene.series import Series, StepMeshes
from wall.scene.up import Y_FROM

Meshes: TypeAlias = tuple[list[tuple[Mesh, float]], tuple[str, ...]]
LOADED_APART = frozenset({*READERS, ".ply"})  # by VTK, and by trimesh
NO_AREA = np.zeros((1, 3), np.uint32)  # a triangle of one corner, where a step has no surface
PLAIN = (0.8, 0.8, 0.8)  # linear RGB where nothing says a colour


def load_data(config: DataConfig, base_folder: Path, where: str) -> Source:
    """The objects of an entry, of its name and with one material: one, but for isosurfaces of several values.

    Its file is relative to `base_folder`.

    where : of the entry in the configuration, for errors. Raises SceneError.
    """
    try:
        return _load(config, base_folder, where)
    except SceneError as error:
        raise error if str(error).startswith(where) else SceneError(f"{where}.file: {error}") from error


def _load(config: DataConfig, base_folder: Path, where: str) -> Source:
    path = base_folder / config.file
    name = config.name or (path.stem.replace("*", "").rstrip("_.-") if "*" in path.stem else path.stem) or "series"
    if config.series is not None:
        return _series(config, path, name, where)
    found, notes = _meshes_apart(config, Part(path=path), name, where)
    instances = [_placed(config, name, k, unit) for k, (_, unit) in enumerate(found)]
    return _source(config, name, [mesh for mesh, _ in found], instances, notes)


def _series(config: DataConfig, path: Path, name: str, where: str) -> Source:
    """The steps of an entry, an instance each; the first is loaded, the others as the scene's time goes on."""
    assert config.series is not None
    steps = steps_of(config, config.series, path, where)
    ((mesh, unit),), notes = _meshes_apart(config, steps.parts[0], name, where)
    instances = [_placed(config, name, 0, unit) for _ in steps.parts]
    load = partial(_step, config, steps.parts, name, where, like=mesh, unit=unit)
    meshes = StepMeshes(load, len(steps.parts), loops=steps.period is not None)
    series = Series(first=0, times=steps.times, period=steps.period, meshes=meshes)
    return replace(_source(config, name, [mesh], instances, notes), series=(series,))


def _step(
    config: DataConfig, parts: tuple[Part, ...], name: str, where: str, step: int, *, like: Mesh, unit: float
) -> Mesh:
    """The mesh of a step, in the frame and the unit of the first one, `like`. Raises SceneError."""
    try:
        ((mesh, own_unit),), _ = meshes_of(config, parts[step], name, where)
    except NoSurfaceError:
        return replace(like, vertices=like.vertices[:3], triangles=NO_AREA, normals=None, colors=None)
    if like.colors is None and mesh.colors is not None:
        told = f"{parts[step].path.name} has colours, which {parts[0].path.name} has not"
        raise SceneError(f"{where}.series: {told}; wanted the same columns in each step")
    mesh = mesh if like.normals is not None else replace(mesh, normals=None)  # those that are flat are alike
    return _in_frame(mesh, own_unit / unit, like)


def _in_frame(mesh: Mesh, scale: float, like: Mesh) -> Mesh:
    """A mesh about another one's origin, made larger by a factor."""
    moved = scale * np.array(mesh.origin) - np.array(like.origin)

    def placed(points: Float32) -> Float32:
        rows: Float64 = scale * points.astype(np.float64)
        rows[:, :3] += moved
        return rows.astype(np.float32)

    if mesh.spheres is None:
        return replace(mesh, vertices=placed(mesh.vertices), origin=like.origin)
    spheres = placed(mesh.spheres)
    return replace(mesh, spheres=spheres, vertices=spheres[:, :3], origin=like.origin)


def _meshes_apart(config: DataConfig, part: Part, name: str, where: str) -> Meshes:
    """What meshes_of gives; files that others' code reads are read by a process of their own."""
    if part.path.suffix.lower() not in LOADED_APART:
        return meshes_of(config, part, name, where)
    meshes: Meshes = load_apart([load_request(part.path, (__name__, "meshes_of"), config, part, name, where)])[0]
    return meshes


def meshes_of(config: DataConfig, part: Part, name: str, where: str) -> Meshes:
    """Meshes, each with the unit that it is in, and notes."""
    if isinstance(config, PointsConfig | CurvesConfig):
        mesh, unit, notes = points_mesh(config, part.path, name, where, part.row)
        return [(mesh, unit)], notes
    from wall.scene.data.surfaces import surface_meshes

    repaired, notes = surface_meshes(config, part.path, name, where)
    return [(each.mesh, each.unit) for each in repaired], notes


def _placed(config: DataConfig, name: str, mesh: int, unit: float) -> Instance:
    matrix = np.eye(4)
    matrix[:3, :3] = config.scale * unit * np.array(Y_FROM[config.up], np.float64)
    matrix[:3, 3] = config.position
    return Instance(name=name, mesh=mesh, world_from_object=matrix)


def _source(
    config: DataConfig, name: str, meshes: list[Mesh], instances: list[Instance], notes: tuple[str, ...]
) -> Source:
    colored = meshes[0].colors is not None
    material = Material(name=name, base_color=(1.0, 1.0, 1.0) if colored else config.color or PLAIN)
    return Source(meshes=tuple(meshes), materials=(material,), instances=tuple(instances), notes=notes)
