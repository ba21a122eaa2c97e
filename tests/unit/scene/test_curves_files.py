"""Curves of every kind of file become the same tubes; what a file lacks is said."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from wall.config.scene import SceneConfig
from wall.core.color_maps import ColorMap
from wall.core.errors import SceneError
from wall.scene.build import Scene, build

ROWS = np.array(  # x, y, z, heat; two curves of three points
    [[[0.0, 0.0, 0.0, 1.0], [1.0, 0.0, 0.0, 2.0], [1.0, 1.0, 0.0, 3.0]],
     [[0.0, 0.0, 5.0, 4.0], [0.0, 1.0, 5.0, 5.0], [0.0, 2.0, 5.0, 6.0]]]
)  # fmt: skip
CURVE = np.repeat([7, 3], 3)


def _vtk(path: Path) -> None:
    """The last point first, so that lines are more than a count; a vertex before the lines."""
    points, heat = ROWS[:, :, :3].reshape(-1, 3)[::-1], ROWS[:, :, 3].ravel()[::-1]
    path.write_text(
        "# vtk DataFile Version 3.0\nlines\nASCII\nDATASET POLYDATA\nPOINTS 6 float\n"
        + "\n".join(" ".join(map(str, row)) for row in points)
        + "\nVERTICES 1 2\n1 0\nLINES 2 8\n3 5 4 3\n3 2 1 0\nPOINT_DATA 6\nSCALARS heat float 1\nLOOKUP_TABLE default\n"
        + " ".join(map(str, heat))
        + "\nCELL_DATA 3\nSCALARS width float 1\nLOOKUP_TABLE default\n9 0.25 0.25\n"
    )


def _npy(path: Path) -> None:
    np.save(path, np.concatenate([ROWS, np.full((2, 3, 1), 0.25)], axis=2))


def _npz(path: Path) -> None:
    rows = ROWS.reshape(-1, 4)
    np.savez(path, positions=rows[:, :3], heat=rows[:, 3], curve=CURVE, width=np.full(6, 0.25))


def _csv(path: Path) -> None:
    rows = np.column_stack([ROWS.reshape(-1, 4), CURVE, np.full(6, 0.25)])
    np.savetxt(path, rows, delimiter=",", header="x, y, z, heat, curve, width", comments="")


def scene_with(folder: Path, **keys: Any) -> Scene:
    return build(SceneConfig.model_validate({"data": [{"type": "curves", "radius": 0.5, **keys}]}), folder)


@pytest.mark.parametrize(
    ("name", "write", "heat", "width"),
    [
        ("a.vtk", _vtk, "heat", "width"),
        ("a.npy", _npy, 3, 4),
        ("a.npz", _npz, "heat", "width"),
        ("a.csv", _csv, "heat", "width"),
    ],
)
def test_every_kind_of_file_gives_the_same_curves(
    tmp_path: Path, name: str, write: Callable[[Path], None], heat: str | int, width: str | int
) -> None:
    write(tmp_path / name)
    color_by = {"column": heat, "color_map": {"range": [1.0, 6.0]}}
    scene = scene_with(tmp_path, file=name, radius={"column": width, "factor": 2.0}, color_by=color_by)
    (mesh,), matrix = scene.meshes, scene.instances[0].world_from_object
    assert mesh.spheres is not None
    np.testing.assert_allclose(mesh.vertices + matrix[:3, 3], ROWS[:, :, :3].reshape(-1, 3), atol=1e-6)
    np.testing.assert_allclose(mesh.spheres[:, 3], 0.5)
    assert mesh.segments is not None
    assert mesh.segments.tolist() == [0, 1, 3, 4]
    assert mesh.colors is not None
    np.testing.assert_allclose(mesh.colors, ColorMap(range=(1.0, 6.0)).colors(ROWS[:, :, 3].ravel()))


def test_a_curve_ends_where_a_point_is_left_out(tmp_path: Path) -> None:
    rows = ROWS.copy()
    rows[1, 1, 0] = np.nan
    np.save(tmp_path / "a.npy", np.concatenate([rows, rows[:, :2]], axis=1))
    scene = scene_with(tmp_path, file="a.npy")
    (mesh,) = scene.meshes
    assert mesh.segments is not None
    assert mesh.segments.tolist() == [0, 1, 2, 3, 6]
    assert any("2 points have no finite coordinates" in note for note in scene.notes)


@pytest.mark.parametrize(
    ("name", "rows", "said"),
    [
        ("a.npy", ROWS[0], r"a.npy: has the columns 0, 1, 2, 3; wanted coordinates and 'curve'"),
        ("a.npy", ROWS[:, :1], "a.npy holds no curve of two points that lie apart"),
        ("a.vtk", "POINTS 1 float\n0 0 0\nVERTICES 1 2\n1 0\n", "a.vtk: holds no lines"),
    ],
)
def test_what_is_wrong_with_a_file_is_said(tmp_path: Path, name: str, rows: Any, said: str) -> None:
    if isinstance(rows, str):
        (tmp_path / name).write_text(f"# vtk DataFile Version 3.0\nno lines\nASCII\nDATASET POLYDATA\n{rows}")
    else:
        np.save(tmp_path / name, rows)
    with pytest.raises(SceneError, match=said):
        scene_with(tmp_path, file=name)
