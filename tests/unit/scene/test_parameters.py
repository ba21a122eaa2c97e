"""What can be changed of a scene while it is shown, what is refused, and what a change leaves as it was."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from small_scenes import quad, scene_of

from wall.config.scene import ParameterConfig
from wall.core.data import Edits
from wall.core.errors import EditError, SceneError
from wall.geometry.lens import Lens
from wall.scene.build import Scene
from wall.scene.model import AmbientOcclusion, DirectionalLight, Material, PointLight
from wall.scene.parameter_tracks import tracks_of
from wall.scene.parameters import named, parameters_of, parameters_of_views, with_checked_tracks
from wall.scene.shading import material_names

SUN = DirectionalLight(direction=(0.0, 0.6, 0.8), irradiance=(1.0, 2.0, 3.0))
LAMP = PointLight(position=(1.0, 2.0, 3.0), intensity=(4.0, 5.0, 6.0))
GREY, COAT = Material(name="grey"), Material(name="grey", specular=1.0)


def scene(*, depth: int | None = None, materials: tuple[Material, ...] = (GREY,)) -> Scene:
    """Two lights, the sun first, and a quad of each material."""
    meshes = [quad(1, 1, material=k) for k in range(len(materials))]
    return replace(scene_of(meshes, materials=materials, lights=(SUN, LAMP)), path_depth=depth)


def edited(**values: tuple[float, ...]) -> Edits:
    return Edits(1, tuple(sorted((name.replace("__", "."), value) for name, value in values.items())))


def test_only_what_the_scene_has_is_offered() -> None:
    names = set(parameters_of(scene()))
    assert names == {
        "exposure", "tone_mapping", "lights.0.direction", "lights.0.irradiance", "lights.1.position",
        "lights.1.intensity",
        "sky.strength", "sky.zenith", "sky.horizon", "sky.ground", "materials.grey.color",
        "objects.object0.offset", "objects.object0.rotation", "objects.object0.scale", "objects.object0.visible",
    }  # fmt: skip


def test_paths_offer_depth_and_what_interfaces_read_and_equal_names_are_told_apart() -> None:
    names = set(parameters_of(scene(depth=5, materials=(GREY, COAT)))) - set(parameters_of(scene()))
    names = {name for name in names if not name.startswith("objects.")}
    both = {f"materials.{name}.{field}" for name in ("grey", "grey #2") for field in ("roughness", "ior", "metallic")}
    assert names == both | {"integrator.depth", "materials.grey #2.color"}
    assert parameters_of(scene(depth=5))["integrator.depth"].default == (5.0,)


def test_views_offer_what_any_has_but_hide_only_what_all_can() -> None:
    """A surface that shines is a light on paths, and can neither be hidden nor scaled there."""
    lamp = Material(name="grey", emission=(1.0, 1.0, 1.0))
    direct, paths = (scene(depth=depth, materials=(lamp,)) for depth in (None, 4))
    shape = replace(direct, path_depth=1, occlusion=AmbientOcclusion(distance=3.0))
    assert "objects.object0.visible" in parameters_of_views([direct, direct])
    found = parameters_of_views([direct, shape, paths])
    assert set(found) == {*parameters_of(direct), *parameters_of(shape), *parameters_of(paths)} - {
        "objects.object0.visible", "objects.object0.scale",
    }  # fmt: skip
    assert found["integrator.depth"].default == (4.0,)
    assert found["integrator.distance"].default == (3.0,)


def test_glass_that_absorbs_offers_what_and_how_far() -> None:
    glass = Material(name="grey", transmission=1.0, attenuation_color=(0.5, 1.0, 1.0), attenuation_distance=2.0)
    before = scene(depth=5, materials=(glass, replace(glass, attenuation_distance=math.inf)))
    offered = [name for name in parameters_of(before) if "attenuation" in name]
    assert offered == ["materials.grey.attenuation_color", "materials.grey.attenuation_distance"]
    assert parameters_of(before)["materials.grey.attenuation_distance"].checked(0.0) == (0.0,)
    values = {"materials__grey__attenuation_color": (1.0, 0.25, 1.0), "materials__grey__attenuation_distance": (4.0,)}
    assert_allclose(before.shading(0.0, edited(**values)).materials[0].absorption, [0.0, math.log(4.0) / 4.0, 0.0])


def test_a_lens_is_offered_and_edited_where_there_is_one_and_may_be_closed() -> None:
    seen = replace(scene(depth=5), lens=Lens(radius=0.1, focus=3.0))
    found = parameters_of(seen)
    assert set(found) - set(parameters_of(scene(depth=5))) == {"lens.aperture", "lens.focus"}
    assert (found["lens.aperture"].default, found["lens.focus"].default) == ((0.2,), (3.0,))
    assert found["lens.aperture"].checked(0) == (0.0,)
    assert seen.shading(0.0, edited(lens__aperture=(0.0,))).lens == Lens(radius=0.0, focus=3.0)
    with pytest.raises(EditError, match=r"lens\.focus = 0: want a number from 1e-06 to 1e\+12 world units"):
        found["lens.focus"].checked(0)
    assert scene(depth=5).shading(0.0, edited(lens__focus=(4.0,))).lens is None


@pytest.mark.parametrize(
    ("name", "value", "text"),
    [
        ("lights.0.irradiance", (1, 2), "(1, 2)"),
        ("lights.0.irradiance", -1, "from 0"),
        ("lights.0.irradiance", [1, 2, float("nan")], "three numbers"),
        ("lights.0.irradiance", [1, 2, 10**400], "three numbers"),
        ("lights.0.irradiance", "red", "red"),
        ("lights.0.irradiance", [True, 1, 1], "three numbers"),
        ("lights.0.direction", [0, 0, 0], "not all zero"),
        ("materials.grey.color", [0.5, 0.5, 1.5], "from 0 to 1"),
        ("exposure", [1, 2], "a number from -20 to 20 stops"),
        ("integrator.depth", 2.5, "a whole number from 1 to 64"),
        ("integrator.depth", 0, "a whole number from 1 to 64"),
        ("exposure", None, "None"),
        ("tone_mapping", "acse", "one of none, reinhard, aces, khronos_neutral"),
        ("tone_mapping", 1.5, "one of none, reinhard"),
        ("exposure", "aces", "a number from -20 to 20 stops"),
        ("exposure", [[]], "a number"),
    ],
)
def test_a_value_that_is_not_accepted_is_refused_with_what_is(name: str, value: object, text: str) -> None:
    with pytest.raises(EditError, match="want") as refusal:
        named(parameters_of(scene(depth=5)), name).checked(value)
    assert str(refusal.value).startswith(name)
    assert text in str(refusal.value)


def test_a_name_that_is_not_known_is_refused_with_the_nearest() -> None:
    with pytest.raises(EditError, match=r"did you mean lights\.0\.irradiance\? there are lights\.0\.direction"):
        named(parameters_of(scene()), "lights.0.iradiance")


@given(st.recursive(st.none() | st.booleans() | st.integers() | st.floats() | st.text(), st.lists, max_leaves=6))
def test_any_value_gives_numbers_in_range_or_a_refusal(value: object) -> None:
    for parameter in parameters_of(scene(depth=5)).values():
        try:
            numbers = parameter.checked(value)
        except EditError:
            continue
        assert all(isinstance(x, float) and parameter.low <= x <= parameter.high for x in numbers)
        assert len(numbers) == len(parameter.default)


def test_one_number_is_meant_for_all_of_a_colour() -> None:
    assert parameters_of(scene())["materials.grey.color"].checked(0.25) == (0.25, 0.25, 0.25)


def test_an_edit_replaces_its_own_value_and_leaves_all_else_the_same_object() -> None:
    before = scene()
    shading = before.shading(0.0, edited(lights__1__intensity=(7.0, 8.0, 9.0)))
    assert shading.point_lights == (replace(LAMP, intensity=(7.0, 8.0, 9.0)),)
    assert shading.directional_lights is before.directional_lights
    assert shading.sky is before.sky
    assert shading.materials is before.materials


def test_light_goes_where_it_is_put_and_strength_scales_the_whole_sky() -> None:
    before = scene()
    moment = before.at(0.0, edited(lights__0__direction=(0.0, 0.0, 2.0), sky__strength=(3.0,)))
    assert_allclose(moment.directions, [[0.0, 0.0, 1.0]])
    assert_allclose(moment.point_positions, [LAMP.position])
    assert_allclose(moment.shading.sky.horizon, 3 * np.array(before.sky.horizon))
    assert_allclose(before.at(0.0).directions, [SUN.direction])


def test_names_that_the_scene_does_not_have_change_nothing() -> None:
    before = scene()
    strange = edited(lights__9__intensity=(1.0,), materials__x__color=(1.0, 1.0, 1.0), sky__x=(1.0,), materials=(1.0,))
    shading, base = before.shading(0.0, strange), before.shading(0.0)
    assert shading == base


def keyframed(name: str, *keys: tuple[float, object], loop: bool = False, **fields: Any) -> Scene:
    frames = [{"time": time, "value": value} for time, value in keys]
    config = ParameterConfig.model_validate({"type": "parameter", "name": name, "keyframes": frames, "loop": loop})
    return replace(scene(), parameter_tracks=tracks_of([config]), **fields)


def checked(scene: Scene) -> Scene:
    return with_checked_tracks(scene, parameters_of(scene))


def test_keyframes_are_joined_by_straight_lines_and_the_last_stays() -> None:
    moving = keyframed("lights.1.intensity", (1.0, (0.0, 2.0, 4.0)), (3.0, (4.0, 2.0, 0.0)))
    for time, wanted in ((0.0, (0, 2, 4)), (1.0, (0, 2, 4)), (1.5, (1, 2, 3)), (3.0, (4, 2, 0)), (9.0, (4, 2, 0))):
        assert_allclose(moving.at(time).shading.point_lights[0].intensity, wanted)
    assert moving.animated


def test_one_number_of_a_keyframe_counts_for_all() -> None:
    fading = keyframed("lights.1.intensity", (0.0, (8.0, 4.0, 2.0)), (2.0, 0.0), (4.0, (6.0, 6.0, 6.0)))
    for time, wanted in ((1.0, (4, 2, 1)), (2.0, (0, 0, 0)), (3.0, (3, 3, 3))):
        assert_allclose(fading.at(time).shading.point_lights[0].intensity, wanted)
    with pytest.raises(ValueError, match=r"has 2 numbers, another keyframe 3"):
        keyframed("lights.1.intensity", (0.0, (8.0, 4.0)), (2.0, (1.0, 2.0, 3.0)))


@pytest.mark.parametrize(
    ("time", "wanted"), [(0.0, 1.0), (1.0, 2.0), (1.75, 2.75), (2.0, 1.0), (2.5, 1.5), (101.0, 2.0)]
)
def test_keyframes_that_loop_begin_again(time: float, wanted: float) -> None:
    moving = keyframed("sky.strength", (0.0, 1.0), (2.0, 3.0), loop=True)
    assert_allclose(moving.at(time).shading.sky.zenith, wanted * np.array(moving.sky.zenith))


def test_keyframes_pull_focus() -> None:
    lens = Lens(radius=0.1, focus=3.0)
    pulled = checked(keyframed("lens.focus", (0.0, 3.0), (2.0, 7.0), path_depth=5, lens=lens))
    assert pulled.at(1.0).shading.lens == Lens(radius=0.1, focus=5.0)


def test_an_edit_hides_keyframes() -> None:
    moving = keyframed("sky.strength", (0.0, 1.0), (2.0, 3.0))
    assert moving.values(1.0, edited(sky__strength=(9.0,))) == {"sky.strength": (9.0,)}


def test_keyframes_of_what_there_is_not_or_cannot_be_are_refused() -> None:
    with pytest.raises(SceneError, match=r"lights\.7\.intensity.*no such parameter"):
        checked(keyframed("lights.7.intensity", (0.0, 1.0)))
    with pytest.raises(SceneError, match=r"sky\.strength = .*want a number from 0"):
        checked(keyframed("sky.strength", (0.0, -1.0)))
    with pytest.raises(SceneError, match=r"tone_mapping: nothing lies between its values; wanted: no keyframes"):
        checked(keyframed("tone_mapping", (0.0, 1.0)))


def test_one_number_in_a_keyframe_is_meant_for_all_of_a_colour() -> None:
    shown = checked(keyframed("lights.1.intensity", (0.0, 1.0), (2.0, 3.0)))
    assert shown.at(1.0).shading.point_lights[0].intensity == (2.0, 2.0, 2.0)


def test_no_two_materials_have_one_name_whatever_they_are_called() -> None:
    named_so = ["a", "a", "a #2", "", "material", "a"]
    names = material_names([Material(name=name) for name in named_so])
    assert names == ["a", "a #2", "a #2 #2", "material", "material #2", "a #3"]


def test_between_opposite_directions_light_goes_out_and_nothing_else() -> None:
    moving = keyframed("lights.0.direction", (0.0, (0.0, 0.0, 1.0)), (2.0, (0.0, 0.0, -1.0)))
    assert_allclose(moving.at(1.0).directions, [[0.0, 0.0, 0.0]])
    assert_allclose(moving.at(0.5).directions, [[0.0, 0.0, 1.0]])
