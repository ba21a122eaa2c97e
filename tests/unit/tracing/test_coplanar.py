"""Which of several objects in one plane is behind the others."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from small_scenes import BLACK, instance, quad, scene_of, sphere_mesh

from wall.core.data import Float64
from wall.scene.model import Instance, Material, Mesh
from wall.tracing import coplanar
from wall.tracing.coplanar import BEHIND, depth_scales

LAMP = Material(name="lamp", base_color=BLACK, emission=(1.0, 1.0, 1.0))
GREY = Material(name="grey", base_color=(0.5, 0.5, 0.5))
SQUARE, LIT = quad(1.0, 1.0), quad(1.0, 1.0, material=1)
RIGHT, NEAR, AWAY = instance(1, at=(1.0, 0.0, 0.0)), instance(1, at=(0.9, 0.3, 0.0)), instance(1, at=(0.0, 0.0, 0.01))


def box(size: float) -> Mesh:
    """A cube about the origin."""
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], np.float32) * (size / 2)
    sides = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    triangles = [corner for a, b, c, d in sides for corner in ((a, b, c), (a, c, d))]
    return replace(SQUARE, vertices=corners, triangles=np.array(triangles, np.uint32))


@pytest.mark.parametrize(
    ("meshes", "placed", "behind"),
    [
        ([SQUARE, SQUARE, SQUARE], [instance(0), instance(1), instance(2)], [0, 1, 2]),
        ([SQUARE, SQUARE], [instance(0), RIGHT], [0, 0]),
        ([SQUARE, SQUARE], [instance(0), NEAR], [0, 1]),
        ([SQUARE, SQUARE], [instance(0), AWAY], [0, 0]),
        ([SQUARE, SQUARE], [instance(0, turn=("x", 180.0)), instance(1)], [0, 1]),
        ([SQUARE, LIT], [instance(0), instance(1)], [1, 0]),
        ([SQUARE, box(1.0)], [instance(0), instance(1, at=(0.0, 0.0, -0.5))], [0, 1]),
        ([box(1.0), box(2.0)], [instance(0), instance(1, at=(0.5, 0.0, 0.0))], [0, 1]),
        ([box(1.0), box(2.0)], [instance(0), instance(1)], [0, 0]),
        ([SQUARE, sphere_mesh()], [instance(0), instance(1)], [0, 0]),
    ],
    ids=["one on the other", "side by side", "overlapping", "before it", "seen from behind", "a lamp comes first",
         "a side of a box", "sides of boxes", "a box in a box", "round"],
)  # fmt: skip
@pytest.mark.parametrize("turn", [0.0, 33.0])
def test_objects_are_behind_those_whose_plane_and_place_they_share(
    meshes: list[Mesh], placed: list[Instance], behind: list[int], turn: float
) -> None:
    c, s = np.cos(np.radians(turn)), np.sin(np.radians(turn))
    world = np.array([[c, -s, 0.0, 3.0], [s, c, 0.0, -2.0], [0.0, 0.0, 1.0, 0.7], [0.0, 0.0, 0.0, 1.0]])
    turned = [replace(each, world_from_object=world @ each.world_from_object) for each in placed]
    scene = scene_of(meshes, turned, materials=[GREY, LAMP])
    np.testing.assert_array_equal(depth_scales(scene), 1.0 + BEHIND * np.array(behind))


def test_of_many_objects_on_one_ground_few_pairs_are_looked_at(monkeypatch: pytest.MonkeyPatch) -> None:
    """Tops, undersides and sides of 400 boxes on a grid share planes, and lie beside each other there."""
    looked_at, closely = [0], coplanar._overlap

    def counted(ones: Float64, others: Float64) -> NDArray[np.bool_]:
        looked_at[0] += len(ones)
        return closely(ones, others)

    monkeypatch.setattr(coplanar, "_overlap", counted)
    ground, boxes = quad(30.0, 30.0), [box(1.0) for _ in range(400)]
    places = [(1.5 * (k % 20) - 14.0, 1.5 * (k // 20) - 14.0, 0.5) for k in range(400)]
    placed = [instance(0), *(instance(1 + k, at=place) for k, place in enumerate(places))]
    scales = depth_scales(scene_of([ground, *boxes], placed, materials=[GREY]))
    assert looked_at[0] < 400, "of 80,000 pairs of tops alone"
    np.testing.assert_array_equal(scales, 1.0)
