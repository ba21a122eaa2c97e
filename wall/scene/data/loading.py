"""From an entry of `scene.data` to an object of the scene."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from wall.config.scene_data import DataConfig, PointsConfig
from wall.scene.data.points import points_mesh
from wall.scene.model import Instance, Material, Source
from wall.scene.up import Y_FROM

PLAIN = (0.8, 0.8, 0.8)  # linear RGB where nothing says a colour


def load_data(config: DataConfig, base_folder: Path, where: str) -> Source:
    """The objects of an entry, of its name and with one material: one, but for isosurfaces of several values.

    Its file is relative to `base_folder`.

    where : of the entry in the configuration, for errors. Raises SceneError.
    """
    path = base_folder / config.file
    name = config.name or path.stem
    if isinstance(config, PointsConfig):
        mesh, unit, notes = points_mesh(config, path, name, where)
        units = [(mesh, unit)]
    else:
        from wall.scene.data.surfaces import surface_meshes

        repaired, notes = surface_meshes(config, path, name, where)
        units = [(each.mesh, each.unit) for each in repaired]
    colored = units[0][0].colors is not None
    material = Material(name=name, base_color=(1.0, 1.0, 1.0) if colored else config.color or PLAIN)
    instances = []
    for k, (_, unit) in enumerate(units):
        matrix = np.eye(4)
        matrix[:3, :3] = config.scale * unit * np.array(Y_FROM[config.up], np.float64)
        matrix[:3, 3] = config.position
        instances.append(Instance(name=name, mesh=k, world_from_object=matrix))
    return Source(
        meshes=tuple(mesh for mesh, _ in units), materials=(material,), instances=tuple(instances), notes=notes
    )
