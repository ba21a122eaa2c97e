"""Repairs: what is dropped is counted aloud, what is kept keeps its precision."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from wall.scene.repair import RawMesh, Repaired, repair

BALL = trimesh.creation.icosphere(subdivisions=2)


def mended(vertices: np.ndarray, triangles: np.ndarray, **more: np.ndarray) -> Repaired:
    result = repair(RawMesh(name="m", vertices=vertices, triangles=np.asarray(triangles, np.int64), **more), 0)
    assert isinstance(result, Repaired), result
    return result


def restored(result: Repaired) -> np.ndarray:
    """(t, 3, 3) corners in the file's own coordinates, float64."""
    mesh = result.mesh
    return ((mesh.vertices.astype(np.float64) + mesh.origin) * result.unit)[mesh.triangles]


def test_a_sound_mesh_passes_without_a_word() -> None:
    result = mended(BALL.vertices, BALL.faces)
    assert result.notes == ()
    np.testing.assert_allclose(restored(result), BALL.vertices[BALL.faces], atol=1e-7)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf, 1e200])
def test_triangles_at_a_bad_vertex_are_dropped_and_counted(bad: float) -> None:
    vertices = BALL.vertices.copy()
    vertices[7, 1] = bad
    touched = int((BALL.faces == 7).any(axis=1).sum())
    result = mended(vertices, BALL.faces)
    assert len(result.mesh.triangles) == len(BALL.faces) - touched
    assert any("1 vertices are NaN" in note and f"{touched} triangles" in note for note in result.notes)


@pytest.mark.parametrize("index", [-1, 999_999, 2**40])
def test_indices_out_of_range_are_dropped_and_counted(index: int) -> None:
    faces = BALL.faces.astype(np.int64).copy()
    faces[[3, 9], 1] = index
    result = mended(BALL.vertices, faces)
    assert len(result.mesh.triangles) == len(faces) - 2
    assert any("2 triangles name a vertex that is not there" in note for note in result.notes)


def test_triangles_without_area_are_dropped_and_counted() -> None:
    vertices = np.concatenate([BALL.vertices, [[0.0, 0.0, 0.25 * k] for k in range(3)]])
    faces = np.concatenate([BALL.faces, [[len(BALL.vertices) + k for k in range(3)]]])
    result = mended(vertices, faces)
    assert len(result.mesh.triangles) == len(BALL.faces)
    assert any("1 triangles without area" in note for note in result.notes)


def test_triangles_of_two_points_as_at_a_spheres_poles_are_dropped_without_a_word() -> None:
    result = mended(BALL.vertices, np.concatenate([BALL.faces, [[0, 0, 1], [5, 5, 5]]]))
    assert len(result.mesh.triangles) == len(BALL.faces)
    assert not any("without area" in note for note in result.notes)


def test_nothing_left_gives_the_reasons_instead_of_a_mesh() -> None:
    notes = repair(RawMesh(name="m", vertices=np.full((3, 3), np.nan), triangles=np.array([[0, 1, 2]])), 0)
    assert isinstance(notes, tuple)
    assert "no triangle that could be drawn" in notes[-1]


@pytest.mark.parametrize("scale", [1e-30, 1e-12, 1e12, 1e30])
def test_extreme_scale_keeps_shape_and_float32_stays_comfortable(scale: float) -> None:
    result = mended(BALL.vertices * scale, BALL.faces)
    assert 0.1 < np.abs(result.mesh.vertices).max() < 10.0
    np.testing.assert_allclose(restored(result) / scale, BALL.vertices[BALL.faces], atol=2e-7)
    assert result.mesh.normals is not None
    np.testing.assert_allclose(np.linalg.norm(result.mesh.normals, axis=1), 1.0, atol=1e-6)


def test_far_from_the_origin_keeps_float32_precision_of_its_size() -> None:
    away = np.array([1e6, -1e6, 5e5])
    result = mended(BALL.vertices + away, BALL.faces)
    error = np.abs(restored(result) - (BALL.vertices + away)[BALL.faces]).max()
    assert error < 2e-7  # half a float32 step at 1 is 6e-8, float64's at 1e6 is 1e-10; plain float32: 0.06
    assert any("from the origin" in note for note in result.notes)


def test_normals_that_are_no_directions_are_computed_anew() -> None:
    normals = BALL.vertices.copy()
    normals[4] = 0.0
    normals[5] = np.nan
    result = mended(BALL.vertices, BALL.faces, normals=normals)
    assert any("2 of its normals" in note for note in result.notes)
    assert result.mesh.normals is not None
    cosines = np.einsum("ij,ij->i", result.mesh.normals, result.mesh.vertices)
    assert cosines.min() > 0.99


def test_texture_coordinates_that_are_not_finite_become_zero() -> None:
    uvs = np.full((len(BALL.vertices), 2), 0.25)
    uvs[3] = np.inf
    result = mended(BALL.vertices, BALL.faces, uvs=uvs)
    assert result.mesh.uvs is not None
    assert set(np.unique(result.mesh.uvs)) == {0.0, 0.25}


def test_vertices_that_no_triangle_uses_are_not_kept() -> None:
    result = mended(np.concatenate([BALL.vertices, np.full((50, 3), 1e9)]), BALL.faces)
    assert len(result.mesh.vertices) == len(BALL.vertices)
    assert np.abs(result.mesh.vertices).max() < 1.1
