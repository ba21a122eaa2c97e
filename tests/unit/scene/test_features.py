"""Features in words: what is in, the scene without it, and the scene with one more at a time."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from small_scenes import instance, keyframes, material, quad, scene_of, with_every_feature

from wall.geometry.lens import Lens
from wall.scene.animation import Moving
from wall.scene.build import Scene, assemble
from wall.scene.features import added_one_by_one, features
from wall.scene.model import PointLight, Source, SpotLight

OF_OTHERS = {"sky", "instancing", "relighting", "change detection"}  # which none can be without
OF_TEXTURES = {
    "normal maps", "roughness textures", "emission textures", "texture edges", "several texture coordinates",
}  # fmt: skip
ON_PATHS = {"roughness textures", "glass", "metals and coats", "sun discs", "lens"}


def everything(path_depth: int | None = 4) -> Scene:
    scene = scene_of(
        [quad(1.0, 1.0)], [instance(0), instance(0, at=(2.0, 0.0, 0.0))], materials=[material(0.5, 0.5, 0.5)]
    )
    whole = with_every_feature(replace(scene, path_depth=path_depth))
    lens = None if path_depth is None else Lens(radius=0.1, focus=2.0)
    alpha = replace(whole.materials[-1], alpha_mode="blend", alpha=0.5)
    return replace(whole, lens=lens, materials=(*whole.materials[:-1], alpha))


def used(scene: Scene) -> set[str]:
    return {feature.name for feature in features(scene) if feature.used}


@pytest.mark.parametrize("path_depth", [None, 4])
def test_without_a_feature_a_scene_has_all_others(path_depth: int | None) -> None:
    """Roughness, emission and normals are textures too, and what only paths know goes with them."""
    scene = everything(path_depth)
    goes_with = {
        "points": {"colours of points"},
        "paths": ON_PATHS,
        "textures": OF_TEXTURES,
        "normal maps": {"several texture coordinates"},  # which only that one is looked up by
        "surfaces that shine": {"emission textures"},
        "directional lights": {"sun discs"},
    }
    before = used(scene)
    assert {"textures", "alpha", "vertex colours", "mirrors", "spot lights", "cuts", "instancing"} <= before
    assert (before >= ON_PATHS) == (path_depth is not None)
    for feature in features(scene):
        if feature.used and feature.without is not None:
            gone = {feature.name, *goes_with.get(feature.name, set())} & before
            assert used(feature.without()) - OF_OTHERS == before - gone - OF_OTHERS, feature.name


@pytest.mark.parametrize("path_depth", [None, 4])
def test_each_row_has_one_feature_more_and_the_last_is_the_scene(path_depth: int | None) -> None:
    scene = everything(path_depth)
    rows = added_one_by_one(scene)
    assert used(rows[0][1]) <= OF_OTHERS
    assert rows[-1][1] is scene
    assert [name for name, _ in rows[1:]] == [f.name for f in features(scene) if f.name in dict(rows)]
    for (_, before), (name, after) in pairwise(rows):
        assert name in used(after) - used(before)


def test_lights_that_stay_move_as_before_when_others_are_left_out() -> None:
    """Two points, of which the second moves, and a spot that moves; two objects, of which the second moves."""
    point = PointLight(position=(0.0, 1.0, 0.0), intensity=(1.0, 1.0, 1.0))
    spot = SpotLight(
        position=(1.0, 1.0, 1.0), direction=(0.0, -1.0, 0.0), intensity=(1.0, 1.0, 1.0), inner_angle=10.0,
        outer_angle=20.0,
    )  # fmt: skip
    move = [keyframes((k, 0.0, 0.0), (k, 5.0, 0.0), light=k) for k in range(4)]
    source = Source(
        meshes=(quad(1.0, 1.0),), materials=(material(0.5, 0.5, 0.5),),
        instances=(instance(0), instance(0, at=(2.0, 0.0, 0.0))),
        lights=(point, replace(point, position=(3.0, 0.0, 0.0)), spot), animation=(move[1], move[2]),
        motions=(Moving(body=1, motion=keyframes((9.0, 0.0, 0.0), (9.0, 7.0, 0.0)), center=(2.0, 0.0, 0.0)),),
    )  # fmt: skip
    scene = assemble(source)
    without = {feature.name: feature.without for feature in features(scene)}
    assert without["point lights"] is not None
    assert without["spot lights"] is not None
    whole, spots, points = scene.at(0.6), without["point lights"]().at(0.6), without["spot lights"]().at(0.6)
    assert len(spots.point_positions) == len(points.spot_positions) == 0
    np.testing.assert_array_equal(spots.spot_positions, whole.spot_positions)
    np.testing.assert_array_equal(points.point_positions, whole.point_positions)
    np.testing.assert_array_equal(spots.world_from_object, whole.world_from_object)
    assert whole.spot_positions[0, 1] == pytest.approx(3.0)
    assert scene.tracks.bodies.tolist() == [1, 3, 4]  # an object, a point, the spot
    assert without["point lights"]().tracks.bodies.tolist() == [1, 2]
