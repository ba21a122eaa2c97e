"""The crease rule: smooth where a surface bends gently, crisp where it folds."""

from __future__ import annotations

import math

import numpy as np
import pytest
import trimesh

from wall.scene.builtin.shapes import box, lathe, sphere
from wall.scene.normals import CREASE_DEGREES, crease_normals, face_normals


def brute_force(vertices: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """The rule word for word: (t, 3, 3) a normal for each corner, by walking from triangle to triangle."""
    normals = face_normals(vertices, triangles)
    places = {i: tuple(v) for i, v in enumerate(vertices)}
    edges: dict[tuple, list[tuple[int, tuple, tuple]]] = {}
    for t, triangle in enumerate(triangles):
        for k in range(3):
            a, b = places[triangle[k]], places[triangle[(k + 1) % 3]]
            edges.setdefault((min(a, b), max(a, b)), []).append((t, a, b))
    beside: dict[int, list[tuple[int, tuple]]] = {t: [] for t in range(len(triangles))}
    for (a, b), users in edges.items():
        if len(users) == 2 and users[0][1] == users[1][2]:
            (t, *_), (u, *_) = users
            if normals[t] @ normals[u] > math.cos(math.radians(CREASE_DEGREES)):
                for place in (a, b):
                    beside[t].append((u, place))
                    beside[u].append((t, place))
    result = np.zeros((len(triangles), 3, 3))
    for t, triangle in enumerate(triangles):
        for k in range(3):
            place, found, todo = places[triangle[k]], {t}, [t]
            while todo:
                for u, where in beside[todo.pop()]:
                    if where == place and u not in found:
                        found.add(u)
                        todo.append(u)
            total = np.zeros(3)
            for u in found:
                corner = next(c for c in range(3) if places[triangles[u][c]] == place)
                p, q, r = (vertices[triangles[u][(corner + s) % 3]] for s in range(3))
                x, y = (q - p) / np.linalg.norm(q - p), (r - p) / np.linalg.norm(r - p)
                total += math.acos(np.clip(x @ y, -1, 1)) * normals[u]
            result[t, k] = total / np.linalg.norm(total)
    return result


def test_equals_the_rule_walked_by_hand_on_a_crumpled_ball() -> None:
    ball = trimesh.creation.icosphere(subdivisions=2)
    vertices = ball.vertices * np.random.default_rng(2).uniform(0.85, 1.1, (len(ball.vertices), 1))
    smoothed = crease_normals(vertices, ball.faces)
    assert smoothed is not None
    assert len(vertices) < len(smoothed.source) < 3 * len(ball.faces)  # some vertices split, not all
    np.testing.assert_allclose(smoothed.normals[smoothed.triangles], brute_force(vertices, ball.faces), atol=1e-9)
    np.testing.assert_array_equal(vertices[smoothed.source][smoothed.triangles], vertices[ball.faces])


@pytest.mark.parametrize("shape", [box(1.0, 2.0, 3.0), lathe([(1.0, 0.0), (1.0, 2.0)], 8)], ids=["box", "prism of 8"])
def test_creases_alone_stay_flat(shape: object) -> None:
    assert crease_normals(shape.vertices, shape.triangles) is None  # type: ignore[attr-defined]


def test_icosahedron_stays_crisp() -> None:
    solid = trimesh.creation.icosahedron()
    assert crease_normals(solid.vertices, solid.faces) is None


def test_sphere_normals_point_away_from_its_middle() -> None:
    ball = sphere(2.0, segments=64)
    smoothed = crease_normals(ball.vertices, ball.triangles)
    assert smoothed is not None
    outward = ball.vertices[smoothed.source] / 2.0
    assert np.einsum("ij,ij->i", smoothed.normals, outward).min() > math.cos(math.radians(2.0))


def test_a_can_is_round_at_the_side_and_sharp_at_the_rim() -> None:
    can = lathe([(0.0, 0.0), (1.0, 0.0), (1.0, 2.0), (0.0, 2.0)], 48)
    smoothed = crease_normals(can.vertices, can.triangles)
    assert smoothed is not None
    upright = np.abs(smoothed.normals[:, 1])
    assert set(np.round(upright, 6)) == {0.0, 1.0}


def test_triangles_that_share_no_vertices_are_smoothed_by_position() -> None:
    ball = trimesh.creation.icosphere(subdivisions=3)
    soup = ball.vertices[ball.faces].reshape(-1, 3)
    smoothed = crease_normals(soup, np.arange(len(soup)).reshape(-1, 3))
    assert smoothed is not None
    assert np.einsum("ij,ij->i", smoothed.normals, soup[smoothed.source]).min() > 0.999


def test_opposite_windings_are_not_blended() -> None:
    vertices = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0.05]])
    assert crease_normals(vertices, np.array([[0, 1, 2], [1, 2, 3]])) is None
    assert crease_normals(vertices, np.array([[0, 1, 2], [3, 2, 1]])) is not None
