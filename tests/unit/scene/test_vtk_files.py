"""VTK's files become the surfaces that they hold, or that their fields have, in the colours of their numbers."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from wall.config.scene import SceneConfig
from wall.core.color_maps import ColorMap
from wall.core.data import Float64
from wall.core.errors import SceneError
from wall.scene.build import Scene, build

POINTS = 9  # of the field, along each axis
TWO_TETRAHEDRA = """\
<VTKFile type="UnstructuredGrid" version="1.0"><UnstructuredGrid><Piece NumberOfPoints="5" NumberOfCells="2">
<PointData><DataArray type="Float32" Name="flow" NumberOfComponents="3" format="ascii">
3 4 0  0 0 1  0 2 0  0 0 0  6 8 0</DataArray></PointData>
<CellData><DataArray type="Float64" Name="stress" format="ascii">1 3</DataArray></CellData>
<Points><DataArray type="Float32" NumberOfComponents="3" format="ascii">
0 0 0  1 0 0  0 1 0  0 0 1  1 1 1</DataArray></Points>
<Cells><DataArray type="Int32" Name="connectivity" format="ascii">0 1 2 3 1 2 3 4</DataArray>
<DataArray type="Int32" Name="offsets" format="ascii">4 8</DataArray>
<DataArray type="UInt8" Name="types" format="ascii">10 10</DataArray></Cells>
</Piece></UnstructuredGrid></VTKFile>
"""


SHEET = """\
# vtk DataFile Version 3.0
a triangle with numbers
ASCII
DATASET POLYDATA
POINTS 3 float
0 0 0 1 0 0 0 1 0
POLYGONS 1 4
3 0 1 2
POINT_DATA 3
SCALARS heat float 1
LOOKUP_TABLE default
0 0.7 1
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Two tetrahedra that share a face, and the distance from the middle of a grid from -1 to 1."""
    (tmp_path / "two.vtu").write_text(TWO_TETRAHEDRA)
    axis = np.linspace(-1.0, 1.0, POINTS)
    z, y, x = np.meshgrid(axis, axis, axis, indexing="ij")
    distance = np.sqrt(x * x + y * y + z * z)
    arrays = (("distance", distance), ("height", z))
    text = "".join(
        f"SCALARS {name} float 1\nLOOKUP_TABLE default\n{' '.join(f'{value:.7g}' for value in values.ravel())}\n"
        for name, values in arrays
    )
    head = "# vtk DataFile Version 3.0\na ball\nASCII\nDATASET STRUCTURED_POINTS\n"
    where = f"DIMENSIONS {POINTS} {POINTS} {POINTS}\nORIGIN -1 -1 -1\nSPACING 0.25 0.25 0.25\nPOINT_DATA {POINTS**3}\n"
    (tmp_path / "ball.vtk").write_text(head + where + text)
    return tmp_path


def scene_with(folder: Path, **keys: Any) -> Scene:
    return build(SceneConfig.model_validate({"data": [keys]}), folder)


def corners_of(scene: Scene, k: int = 0) -> Float64:
    """(t, 3, 3) world, of the mesh of instance k."""
    instance = scene.instances[k]
    mesh, matrix = scene.meshes[instance.mesh], instance.world_from_object
    return (mesh.vertices @ matrix[:3, :3].T + matrix[:3, 3])[mesh.triangles]


def test_the_outer_faces_of_cells_are_drawn_in_the_colours_of_their_numbers(folder: Path) -> None:
    """Six faces, since the shared one is inside; faces of the first cell, which has 1, meet the origin."""
    scene = scene_with(
        folder, type="surface", file="two.vtu", color_by={"array": "stress", "color_map": {"range": [1.0, 3.0]}}
    )
    corners, (mesh,) = corners_of(scene), scene.meshes
    assert corners.shape == (6, 3, 3)
    assert mesh.colors is not None
    of_first = (np.abs(corners) < 1e-6).all(axis=2).any(axis=1)
    assert of_first.sum() == 3
    low, high = ColorMap(range=(1.0, 3.0)).colors(np.array([1.0, 3.0]))
    expected = np.where(of_first[:, None, None], low, high)
    np.testing.assert_allclose(mesh.colors[mesh.triangles], np.broadcast_to(expected, (6, 3, 3)))


def test_colours_of_points_are_those_of_lengths_of_vectors(folder: Path) -> None:
    scene = scene_with(folder, type="surface", file="two.vtu", color_by={"array": "flow"}, scale=2.0)
    corners, (mesh,) = corners_of(scene), scene.meshes
    assert mesh.colors is not None
    far = (np.abs(corners - 2.0) < 1e-6).all(axis=2)
    np.testing.assert_allclose(mesh.colors[mesh.triangles[far]], ColorMap(range=(0.0, 1.0)).colors(np.ones(3)))
    assert "two, flow: colours from 0 to 10" in scene.notes


def test_isosurfaces_lie_where_the_field_has_the_values(folder: Path) -> None:
    """Marching cubes blend linearly along edges of the grid: within the sagitta of an edge of 0.25."""
    color_by = {"array": "height", "color_map": {"range": [-1.0, 1.0]}}
    scene = scene_with(
        folder, type="isosurface", file="ball.vtk", array="distance", value=(0.5, 0.75), color_by=color_by, up="z"
    )
    assert [instance.name for instance in scene.instances] == ["ball", "ball"]
    for k, radius in enumerate((0.5, 0.75)):
        corners, mesh = corners_of(scene, k), scene.meshes[scene.instances[k].mesh]
        assert np.linalg.norm(corners, axis=2) == pytest.approx(radius, abs=0.25**2 / (8 * 0.25))
        assert mesh.colors is not None
        height = ColorMap(range=(-1.0, 1.0)).colors(corners.reshape(-1, 3)[:, 1])  # what was z is up
        np.testing.assert_allclose(mesh.colors[mesh.triangles].reshape(-1, 3), height, atol=1e-5)
        assert mesh.normals is not None


def test_an_isosurface_of_vectors_is_where_they_have_that_length(folder: Path) -> None:
    """The bound is that of straight lines between points 0.25 apart, of a length that bends by 1 / radius."""
    axis = np.linspace(-1.0, 1.0, POINTS)
    z, y, x = np.meshgrid(axis, axis, axis, indexing="ij")
    rows = " ".join(f"{value:.7g}" for value in np.stack([x, y, z], -1).ravel())
    text = (folder / "ball.vtk").read_text()
    (folder / "flow.vtk").write_text(f"{text[: text.index('SCALARS')]}VECTORS flow float\n{rows}\n")
    shown = scene_with(folder, type="isosurface", file="flow.vtk", value=0.75, color_by={"array": "flow"})
    radius = np.linalg.norm(corners_of(shown), axis=-1)
    assert np.abs(radius - 0.75).max() < 0.25**2 / 8.0 / 0.5
    assert np.abs(corners_of(shown)).max(axis=(0, 1)) == pytest.approx(0.75, abs=0.02)  # not of one component
    with pytest.raises(SceneError, match=r"'length of flow' of flow.vtk is from 0 to 1.73205, never that"):
        scene_with(folder, type="isosurface", file="flow.vtk", value=2.0)


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        (
            {"type": "surface", "file": "two.vtu", "color_by": {"array": "heat"}},
            "there are flow of points and stress of",
        ),
        ({"type": "isosurface", "file": "ball.vtk", "value": 0.5}, "ball.vtk has 2 arrays, wanted the name of one"),
        (
            {"type": "isosurface", "file": "ball.vtk", "array": "distance", "value": 2.0},
            r"scene.data\[0\].value = 2: 'distance' of ball.vtk is from 0 to 1.73205, never that",
        ),
        (
            {"type": "isosurface", "file": "sheet.vtk", "value": 0.5},
            r"scene.data\[0\]: sheet.vtk holds surfaces, lines or points; wanted: cells in space",
        ),
        ({"type": "surface", "file": "broken.vtu"}, "broken.vtu: VTK cannot read it: Error parsing input file"),
        ({"type": "surface", "file": "none.vtp"}, "none.vtp: there is no such file"),
        ({"type": "surface", "file": "a.stl"}, "no known kind of surface or field"),
    ],
)
def test_what_is_wrong_with_a_file_is_said(folder: Path, keys: dict[str, Any], said: str) -> None:
    (folder / "broken.vtu").write_text(TWO_TETRAHEDRA[:300])
    (folder / "sheet.vtk").write_text(SHEET)
    with pytest.raises(SceneError, match=said):
        scene_with(folder, **keys)


def test_without_vtk_the_error_says_how_to_get_it(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "vtkmodules.vtkCommonCore", None)
    with pytest.raises(SceneError, match=r"two.vtu: needs VTK, .*pip install 'wall\[data\]'"):
        scene_with(folder, type="surface", file="two.vtu")
