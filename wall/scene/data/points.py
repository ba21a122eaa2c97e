"""Points of a file as spheres with radii and colours."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from wall.config.scene_data import CurvesConfig, PointsConfig, RadiusColumnConfig
from wall.core.colour import srgb_decoded
from wall.core.data import Float32, Float64
from wall.core.errors import SceneError
from wall.scene.data.tables import COLORS, Table, read_curves, read_table
from wall.scene.model import Mesh
from wall.scene.points import FARTHEST, curve_points, sphere_points
from wall.scene.repair import unit_of


def points_mesh(
    config: PointsConfig | CurvesConfig, path: Path, name: str, where: str, row: int | None = None
) -> tuple[Mesh, float, tuple[str, ...]]:
    """The spheres or curves of a file, with material 0; their unit, as `repair` has of triangles; and notes.

    row : of a file with several steps, see read_table; where : of the entry in the configuration, for errors

    Raises SceneError.
    """
    table = read_curves(path) if isinstance(config, CurvesConfig) else read_table(path, row)
    spheres = _spheres(config, table, where)
    colors, notes = _colors(config, table, where)
    with np.errstate(invalid="ignore"):
        kept = (np.abs(spheres) <= FARTHEST).all(axis=1) & (spheres[:, 3] > 0.0)
    if not kept.any():
        raise SceneError(
            f"{where}: {path.name} holds {len(spheres)} points, none with finite coordinates and a radius above 0"
        )
    if not kept.all():
        left_out = np.count_nonzero(~kept)
        notes += (f"{name}: {left_out} points have no finite coordinates or no radius above 0, and are left out",)
        spheres, colors = spheres[kept], None if colors is None else colors[kept]
        if table.starts is not None:  # a curve goes on as another one behind what is left out
            starts = (table.starts | np.concatenate([[False], ~kept[:-1]]))[kept]
            table = replace(table, starts=starts)
    extent = float((spheres[:, :3].max(axis=0) / 2.0 - spheres[:, :3].min(axis=0) / 2.0).max() + spheres[:, 3].max())
    unit = unit_of(extent)
    spheres = spheres / unit
    spheres[:, 3] = np.maximum(spheres[:, 3], np.finfo(np.float32).tiny)
    if table.starts is not None:
        mesh = curve_points(spheres, table.starts, material=0, name=name, colors=colors)
        if mesh.primitives == 0:
            raise SceneError(f"{where}: {path.name} holds no curve of two points that lie apart")
        return mesh, unit, notes
    return sphere_points(spheres, material=0, name=name, colors=colors), unit, notes


def _spheres(config: PointsConfig | CurvesConfig, table: Table, where: str) -> Float64:
    """(n, 4) centres and radii, units of the file."""
    columns = config.columns or table.position_columns
    spheres = np.empty((len(table), 4))
    for k, column in enumerate(columns):
        spheres[:, k] = table.column(column, f"{where}.columns")
    if isinstance(config.radius, RadiusColumnConfig):
        spheres[:, 3] = table.column(config.radius.column, f"{where}.radius.column")
        spheres[:, 3] *= config.radius.factor
    else:
        spheres[:, 3] = config.radius
    return spheres


def _colors(config: PointsConfig | CurvesConfig, table: Table, where: str) -> tuple[Float32 | None, tuple[str, ...]]:
    """(n, 3) linear RGB, None where all points have one colour, and notes."""
    color_by = config.color_by
    if color_by is not None and color_by.column is not None:
        values = table.column(color_by.column, f"{where}.color_by.column").astype(np.float64)
        return color_by.color_map.colors(values), color_by.color_map.described(values, str(color_by.column))
    if color_by is not None and color_by.columns is not None:
        parts = [table.column(column, f"{where}.color_by.columns") for column in color_by.columns]
    elif config.color is None and set(COLORS) <= set(table.columns):
        parts = [table.columns[column] for column in COLORS]
    else:
        return None, ()
    whole = any(np.issubdtype(part.dtype, np.integer) or (part > 1.0).any() for part in parts)
    colors = np.stack(parts, axis=1).astype(np.float32) * np.float32(1.0 / 255.0 if whole else 1.0)
    return srgb_decoded(np.clip(np.nan_to_num(colors), 0.0, 1.0)), ()
