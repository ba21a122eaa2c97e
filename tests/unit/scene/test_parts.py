"""Parts of a scene for sort-last: shares that follow each other hold every object once."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from small_scenes import instance, material, quad, scene_of, sphere_mesh

from wall.scene.build import Scene

CUTS = st.lists(st.floats(0.0, 1.0, exclude_min=True, exclude_max=True), max_size=6, unique=True)


def row_of(*meshes: int) -> Scene:
    """Objects side by side: 0 has two triangles, 1 has many."""
    placed = [instance(mesh, at=(float(k), 0.0, 0.0)) for k, mesh in enumerate(meshes)]
    return scene_of([quad(1.0, 1.0), sphere_mesh(0, segments=8)], placed, materials=[material(0.5, 0.5, 0.5)])


SCENE = row_of(0, 1, 0, 0, 1, 1, 0)


@given(cuts=CUTS)
def test_shares_that_follow_each_other_hold_every_object_once(cuts: list[float]) -> None:
    ends = [0.0, *sorted(cuts), 1.0]
    held = [SCENE.objects_in((a, b)) for a, b in pairwise(ends)]
    np.testing.assert_array_equal(np.sum(held, axis=0), np.ones(len(SCENE.instances)))


def test_objects_are_counted_by_their_triangles_in_the_scene_s_order() -> None:
    quads = row_of(0, 0, 0, 0)
    assert quads.objects_in((0.0, 0.5)).tolist() == [True, True, False, False]
    assert quads.objects_in((0.5, 0.75)).tolist() == [False, False, True, False]
    uneven = row_of(1, 0, 0, 0)
    assert uneven.objects_in((0.0, 0.9)).tolist() == [True, False, False, False], "the ball outweighs three quads"


def test_an_object_is_never_cut() -> None:
    one = row_of(1)
    assert [one.objects_in((k / 4, (k + 1) / 4)).tolist() for k in range(4)] == [[False], [False], [True], [False]]
