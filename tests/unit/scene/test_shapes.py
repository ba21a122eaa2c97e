"""Shapes by formula: closed, turned outward, with the volumes that geometry gives."""

from __future__ import annotations

import math

import numpy as np
import pytest

from wall.scene.builtin.shapes import box, join, lathe, moved, placed, sphere, torus, torus_knot
from wall.scene.repair import RawMesh


def volume(shape: RawMesh) -> float:
    """Signed volume by the divergence theorem; positive if triangles face outward."""
    a, b, c = shape.vertices[shape.triangles].transpose(1, 0, 2)
    return float(np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6.0)


@pytest.mark.parametrize(
    ("shape", "expected", "tolerance"),
    [
        (box(1.0, 2.0, 3.0), 6.0, 1e-12),
        (sphere(2.0, segments=128), 4 / 3 * math.pi * 8.0, 2e-3),
        (torus(1.0, 0.25, segments=128, sides=64), 2 * math.pi**2 * 0.25**2, 3e-3),
        (lathe([(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)], 128), math.pi, 1e-3),
    ],
    ids=["box", "sphere", "torus", "cylinder"],
)
def test_volume_is_that_of_the_solid(shape: RawMesh, expected: float, tolerance: float) -> None:
    assert volume(shape) == pytest.approx(expected, rel=tolerance)


@pytest.mark.parametrize(
    "shape",
    [box(1.0, 2.0, 3.0), sphere(), torus(1.0, 0.3), torus_knot(2, 3, radius=1.0, thickness=0.2)],
    ids=["box", "sphere", "torus", "knot"],
)
def test_every_edge_is_shared_by_two_triangles_that_wind_alike(shape: RawMesh) -> None:
    places = {tuple(v): i for i, v in enumerate(np.round(shape.vertices, 9).tolist())}
    same = np.array([places[tuple(v)] for v in np.round(shape.vertices, 9).tolist()])[shape.triangles]
    edges = {(a, b) for t in same.tolist() for a, b in ((t[0], t[1]), (t[1], t[2]), (t[2], t[0]))}
    assert len(edges) == 3 * len(shape.triangles)
    assert all((b, a) in edges for a, b in edges)


def test_knot_is_turned_outward() -> None:
    assert volume(torus_knot(2, 3, radius=1.0, thickness=0.2)) > 0.0


def test_join_and_move_keep_volumes() -> None:
    both = join([box(1.0, 1.0, 1.0), moved(sphere(0.5), placed(9.0, 0.0, -4.0, turn_degrees=30.0, scale=2.0))])
    assert volume(both) == pytest.approx(1.0 + 8.0 * volume(sphere(0.5)), rel=1e-9)
