"""The first surface along a ray: by closed forms, through holes, whatever instances do to it."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from small_scenes import instance, quad, scene_of, sphere_mesh

from wall.scene.build import Scene
from wall.scene.model import Material, Texture, TextureSet
from wall.scene.picking import Picking, alpha_of

AHEAD = np.array([0.0, 0.0, -1.0])


def distance(scene: Scene, *origin: float, direction: np.ndarray = AHEAD) -> float:
    return Picking(scene).distance(scene.at(0.0), np.array(origin), direction)


@settings(deadline=None, derandomize=True)
@given(st.floats(-0.99, 0.99), st.floats(-0.99, 0.99))
def test_the_nearest_of_two_is_met_wherever_it_is_not_missed(x: float, y: float) -> None:
    """The far quad is twice as wide; between both stands one that no longer has any area."""
    assume(abs(max(abs(x), abs(y)) - 0.5) > 1e-6)  # an edge may count as either
    placed = [instance(0), instance(0, at=(0.0, 0.0, -3.0), scale=2.0), instance(0, at=(0.0, 0.0, 1.0), scale=0.0)]
    found = distance(scene_of([quad(1, 1)], placed), x, y, 4.0)
    assert found == pytest.approx(4.0 if max(abs(x), abs(y)) <= 0.5 else 7.0)


def test_distances_are_in_lengths_of_the_direction_and_instances_may_be_turned_and_stretched() -> None:
    scene = scene_of([sphere_mesh()], [instance(0, at=(1e6, 0.0, -10.0), turn=("y", 30.0), scale=(2.0, 3.0, 2.0))])
    assert distance(scene, 1e6, 0.0, 0.0, direction=2 * AHEAD) == pytest.approx(4.0, abs=0.02)  # of 24 segments
    assert distance(scene, 1e6, 2.9, 0.0) < math.inf
    assert distance(scene, 1e6 + 2.1, 0.0, 0.0) == math.inf
    assert distance(scene, 1e6, 0.0, -20.0) == math.inf  # it is behind


def test_a_ray_that_starts_inside_meets_the_back_of_the_surface() -> None:
    assert distance(scene_of([sphere_mesh()]), 0.0, 0.0, 0.0) == pytest.approx(1.0, abs=0.02)


@pytest.mark.parametrize(("mode", "alpha", "wanted"), [("mask", 0.7, 9.0), ("mask", 0.9, 4.0), ("blend", 0.4, 9.0)])
def test_what_is_cut_out_or_mostly_clear_is_passed(mode: str, alpha: float, wanted: float) -> None:
    leaf = Material(name="leaf", alpha_mode=mode, alpha=alpha, alpha_cutoff=0.8)  # type: ignore[arg-type]
    materials = (leaf, Material(name="wall"))
    scene = scene_of(
        [quad(1, 1), quad(9, 9, material=1)], [instance(0), instance(1, at=(0.0, 0.0, -5.0))], materials=materials
    )
    assert distance(scene, 0.1, 0.2, 4.0) == pytest.approx(wanted)


def test_a_hole_is_where_the_texture_has_it() -> None:
    hole = Texture(name="hole", texels=np.zeros((2, 2, 3), np.uint8), alpha=np.uint8([[0, 255], [255, 255]]))
    leaf = Material(name="leaf", alpha_mode="mask", textures=TextureSet(0))
    scene = scene_of([quad(1, 1, uvs=True)], materials=(leaf,), textures=[hole])
    found = [[distance(scene, x, y, 4.0) for x in (-0.2, 0.2)] for y in (0.2, -0.2)]
    assert found == [[math.inf, 4.0], [4.0, 4.0]]
    leaves = quad(1, 1, uvs=True)
    assert leaves.uvs is not None
    sets = replace(leaves, uvs=np.hstack([leaves.uvs + np.float32([0.5, 0.0]), leaves.uvs]))
    for uv_set, x in ((0, 0.2), (1, -0.2)):  # the hole is where the texture's own coordinates have it
        scene = scene_of([sets], materials=(leaf,), textures=[replace(hole, uv_set=uv_set)])
        assert [distance(scene, side, 0.2, 4.0) for side in (x, -x)] == [math.inf, 4.0]
    for wrap, wanted in (("repeat", 0.0), ("clamp", 1.0), ("mirror", 1.0)):
        assert alpha_of(replace(hole, wrap=(wrap, "repeat")), np.array([1.2, 0.9])) == wanted
