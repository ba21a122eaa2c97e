"""Cuts of a scene: planes relative to a point, their parameters, keyframes, and what is refused."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from small_scenes import quad, scene_of

from wall.config.scene import ParameterConfig
from wall.core.data import Edits
from wall.core.errors import EditError
from wall.scene.cuts import SLACK, piece_left, planes_of
from wall.scene.model import Cut
from wall.scene.needs import needs
from wall.scene.parameter_tracks import tracks_of
from wall.scene.parameters import parameters_of, with_checked_tracks

CUT = Cut(position=(1.0, 2.0, 3.0), normal=(0.0, 0.0, 2.0))
OFF = replace(CUT, enabled=False)
SCENE = replace(scene_of([quad(1, 1)]), cuts=(CUT, OFF))


def test_planes_are_unit_normals_and_distances_and_cut_nothing_where_they_are_off_or_turn_over() -> None:
    planes = planes_of([CUT, OFF, replace(CUT, normal=(0.0, 0.0, 0.0))], np.array([0.0, 0.0, 1.0]))
    np.testing.assert_array_equal(planes, [[0, 0, 1, 2], [0, 0, 0, 1], [0, 0, 0, 1]])


@pytest.mark.parametrize(
    ("origin", "direction", "piece"),
    [
        ((0.0, 0.0, 1.0), (0.0, 0.0, 0.5), (0.0, 4.0)),  # in lengths of the direction
        ((0.0, 0.0, 4.0), (3.0, 0.0, -1.0), (1.0, math.inf)),
        ((0.0, 0.0, 4.0), (0.0, 0.0, 1.0), (0.0, -1.0)),  # nothing
        ((0.0, 0.0, 2.0), (1.0, 1.0, 0.0), (0.0, math.inf)),  # along the plane, within
        ((0.0, 0.0, 4.0), (0.0, 0.0, 0.0), (0.0, -math.inf)),
    ],
)
def test_of_a_ray_one_piece_is_left(
    origin: tuple[float, ...], direction: tuple[float, ...], piece: tuple[float, float]
) -> None:
    planes = planes_of([CUT, OFF], np.array(origin))
    assert piece_left(planes, np.array(direction)) == pytest.approx(piece, rel=10 * SLACK)
    assert piece_left(planes[1:], np.array(direction)) == (0.0, math.inf)
    assert piece_left(planes[:0], np.array(direction)) == (0.0, math.inf)


def test_place_way_and_whether_it_cuts_are_parameters() -> None:
    parameters = parameters_of(SCENE)
    assert parameters["cuts.0.position"].default == (1.0, 2.0, 3.0)
    assert parameters["cuts.1.normal"].default == (0.0, 0.0, 2.0)
    assert [parameters[f"cuts.{k}.enabled"].default for k in (0, 1)] == [(1.0,), (0.0,)]
    assert not any(name.startswith("cuts") for name in parameters_of(replace(SCENE, cuts=())))
    values = (("cuts.0.enabled", (0.0,)), ("cuts.1.enabled", (1.0,)), ("cuts.1.position", (0.0, 0.0, 0.0)))
    assert SCENE.shading(0.0, Edits(1, values)).cuts == (
        replace(CUT, enabled=False), replace(CUT, position=(0.0, 0.0, 0.0))
    )  # fmt: skip
    assert SCENE.shading(0.0, Edits(2, (("exposure", (1.0,)),))).cuts is SCENE.cuts


@pytest.mark.parametrize(
    ("name", "value", "said"),
    [
        ("cuts.0.normal", (0.0, 0.0, 0.0), r"cuts.0.normal = \(0.0, 0.0, 0.0\): want three numbers, not all zero"),
        ("cuts.0.enabled", 0.5, "want true, false, 1 or 0"),
        ("cuts.0.position", (1.0, 2.0), "want three numbers, from -1e"),
    ],
)
def test_what_is_no_plane_is_refused(name: str, value: object, said: str) -> None:
    with pytest.raises(EditError, match=said):
        parameters_of(SCENE)[name].checked(value)


@pytest.mark.parametrize(("value", "number"), [(True, 1.0), (False, 0.0), ("true", 1.0), ("false", 0.0), (1, 1.0)])
def test_a_plane_is_switched_by_words_too(value: object, number: float) -> None:
    assert parameters_of(SCENE)["cuts.0.enabled"].checked(value) == (number,)


def test_keyframes_move_a_plane_and_between_opposite_normals_it_cuts_nothing() -> None:
    def track(name: str, *values: object) -> ParameterConfig:
        keys = [{"time": float(k), "value": value} for k, value in enumerate(values)]
        return ParameterConfig.model_validate({"type": "parameter", "name": name, "keyframes": keys, "loop": False})

    moving = track("cuts.0.position", (0.0, 0.0, 0.0), (0.0, 0.0, 4.0))
    turning = track("cuts.0.normal", (0.0, 0.0, 1.0), (0.0, 0.0, -1.0))
    moved = replace(SCENE, parameter_tracks=tracks_of([moving, turning]))
    scene = with_checked_tracks(moved, parameters_of(moved))
    assert scene.shading(0.25).cuts[0] == Cut(position=(0.0, 0.0, 1.0), normal=(0.0, 0.0, 0.5))
    assert not planes_of(scene.shading(0.5).cuts, np.zeros(3))[0, :3].any()
    assert needs(scene).cuts
    assert not needs(replace(scene, cuts=())).cuts
