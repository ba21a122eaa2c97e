"""Steering takes a camera over without a jump and never flips; commands are exactly commands."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from wall.config.loading import loads
from wall.config.screens import GridConfig, WallConfig
from wall.core.errors import RemoteProtocolError
from wall.geometry.cameras import look_at, resolve_view
from wall.geometry.expanding import expand
from wall.geometry.frusta import project
from wall.geometry.steering import EVERY_VIEW, STEEPEST, ZOOM_RANGE, Command, Steering, parse

START = look_at((3, 2, 6), (0, 1, 0), (0, 1, 0))


def held() -> Steering:
    return Steering.from_camera(START, (0, 1, 0))


@settings(max_examples=200, deadline=None, derandomize=True)
@given(st.tuples(*[st.floats(-50, 50)] * 3), st.sampled_from([(0, 1, 0), (0, 0, 1), (0.3, 0.9, -0.2)]))
def test_taking_over_does_not_move_the_camera(position: tuple[float, ...], up: tuple[float, ...]) -> None:
    camera = look_at(position, (100.0, 1.0, 7.0), up)
    tilt = abs(math.asin(float(np.clip(camera.rotation()[:, 2] @ np.array(up) / np.linalg.norm(up), -1, 1))))

    taken = Steering.from_camera(camera, (100, 1, 7), up=up).camera()

    if tilt < STEEPEST:
        assert_allclose(taken.position, camera.position, atol=1e-9)
        assert_allclose(taken.rotation(), camera.rotation(), atol=1e-9)


def test_camera_that_looks_past_its_target_keeps_its_direction() -> None:
    steering = Steering.from_camera(START, (5, 5, 5))

    assert_allclose(steering.camera().rotation(), START.rotation(), atol=1e-12)
    assert_allclose(steering.camera().position, START.position, atol=1e-12)


def test_view_is_taken_over_with_its_own_up_and_spread() -> None:
    text = "version: 1\nscene: {source: x}\nwall: {grid: {columns: 1, rows: 1, pixels: [9, 9], size: [1, 1]}}\n"
    loaded = loads(text + "views: [{camera: {position: [5, 0, 0], target: [0, 0, 0], up: [0, 0, 2], fov: 90}}]\n")
    view = resolve_view(loaded, expand(loaded.config.wall), (0, 0, 0), 1.0)

    steering = Steering.from_view(view, 0.0)

    assert steering.up == (0, 0, 1)
    assert steering.spread == pytest.approx(2.0)
    assert_allclose(steering.camera().rotation(), view.camera_at(0.0).rotation(), atol=1e-12)


@pytest.mark.parametrize("height", [-8.0, 8.0])
def test_camera_that_looks_straight_along_up_is_taken_over_nearly_as_it_was(height: float) -> None:
    camera = look_at((0, height, 0), (0, 0, 0), (0, 1, 0))

    taken = Steering.from_camera(camera, (0, 0, 0)).camera()

    assert_allclose(taken.rotation(), camera.rotation(), atol=2 * math.sin(math.pi / 2 - STEEPEST))


def test_dragging_right_turns_the_scene_right() -> None:
    # what was in the middle of the near side moves right on the screen: the camera goes left
    camera = held().orbit(0.1, 0.0).camera()

    moved = START.rotation().T @ (camera.origin() - START.origin())

    assert moved[0] < -0.1


def test_dragging_down_shows_the_scene_from_above() -> None:
    assert held().orbit(0.0, 0.1).camera().position[1] > START.position[1]


@pytest.mark.parametrize("drag", [5.0, -5.0])
def test_orbit_stops_before_the_pole_and_never_flips(drag: float) -> None:
    steering = held()
    right = START.rotation()[:, 0]

    for _ in range(50):
        steering = steering.orbit(0.0, drag / 50)
        assert steering.camera().rotation()[:, 0] @ right > 0.999
        assert steering.camera().rotation()[1, 1] > 0

    assert abs(steering.elevation) == pytest.approx(STEEPEST)


def test_drags_add_up() -> None:
    once, twice = held().orbit(0.2, 0.1), held().orbit(0.1, 0.05).orbit(0.1, 0.05)

    assert_allclose(once.camera().position, twice.camera().position, atol=1e-12)


def test_whole_turn_comes_back() -> None:
    assert_allclose(held().orbit(2.0, 0.0).camera().position, START.position, atol=1e-12)


def test_panned_target_follows_the_pointer_pixel_for_pixel() -> None:
    wall = expand(WallConfig(grid=GridConfig(columns=1, rows=1, pixels=(200, 100), size=(2.0, 1.0))))
    eye, spread = (0, 0, 1.25), 1.0 / 1.25
    steering = Steering.from_camera(START, (0, 1, 0), spread=spread).pan(0.25, -0.1)

    xy, _ = project(wall.panels[0], eye, steering.camera(), [[0, 1, 0]])

    assert_allclose(xy[0], [100 + 25, 50 - 10], atol=1e-9)  # fractions of the height, 100 pixels


def test_zoom_comes_nearer_by_its_factor_within_bounds() -> None:
    steering = held()

    assert steering.zoom(2.0).distance == pytest.approx(steering.distance / 2)
    for factor, bound in ((10.0, 1 / ZOOM_RANGE), (0.1, ZOOM_RANGE)):
        far = steering
        for _ in range(10):
            far = far.zoom(factor)
        assert far.distance == pytest.approx(steering.distance * bound)


def test_steering_a_million_units_away_is_the_same() -> None:
    there = look_at((1e6 + 3, 2, 6), (1e6, 1, 0), (0, 1, 0))

    far = Steering.from_camera(there, (1e6, 1, 0)).orbit(0.3, 0.1).zoom(1.5).camera()

    near = held().orbit(0.3, 0.1).zoom(1.5).camera()
    assert_allclose(far.origin() - [1e6, 0, 0], near.position, atol=1e-8)
    assert_allclose(far.rotation(), near.rotation(), atol=1e-9)


def test_command_does_what_its_verb_does() -> None:
    steering = held()

    assert steering.apply(Command(kind="orbit", x=0.1, y=0.2)) == steering.orbit(0.1, 0.2)
    assert steering.apply(Command(kind="pan", x=0.1, y=0.2)) == steering.pan(0.1, 0.2)
    assert steering.apply(Command(kind="zoom", x=1.1)) == steering.zoom(1.1)
    assert steering.apply(Command(kind="pause")) == steering


@pytest.mark.parametrize(
    ("message", "expected"),
    [
        ({"kind": "orbit", "x": 0.1, "y": -1}, Command(kind="orbit", x=0.1, y=-1.0)),
        ({"kind": "pan", "x": 0, "y": 0}, Command(kind="pan")),
        ({"kind": "zoom", "x": 1.25}, Command(kind="zoom", x=1.25)),
        ({"kind": "pause"}, Command(kind="pause", view=EVERY_VIEW)),
        ({"kind": "pause", "paused": True, "view": 2}, Command(kind="pause", value="on", view=2)),
        ({"kind": "seek", "x": -1.5, "view": 0}, Command(kind="seek", x=-1.5, view=0)),
        ({"kind": "reset"}, Command(kind="reset")),
        ({"kind": "sampler", "value": "hilbert"}, Command(kind="sampler", value="hilbert")),
    ],
)
def test_command_is_understood(message: dict[str, Any], expected: Command) -> None:
    assert parse(message) == expected


@pytest.mark.parametrize(
    ("message", "expected"),
    [
        ({}, "command kind None: want one of orbit, pan, zoom, pause, sampler, reset"),
        ({"kind": "fly"}, "command kind 'fly'"),
        ({"kind": ["orbit"]}, "command kind list"),
        ({"kind": "orbit", "x": 1}, "command orbit came with 'x': want x, y"),
        ({"kind": "pause", "x": 1}, "command pause came with 'x': want nothing"),
        ({"kind": "orbit", "x": math.nan, "y": 0}, "command orbit: x = nan: want a number from -10 to 10"),
        ({"kind": "orbit", "x": 1e9, "y": 0}, "want a number from -10 to 10"),
        ({"kind": "orbit", "x": True, "y": 0}, "command orbit: x = True"),
        ({"kind": "orbit", "x": 10**400, "y": 0}, "want a number"),
        ({"kind": "zoom", "x": 0}, "command zoom: x = 0: want a number from 0.015625 to 64"),
        ({"kind": "zoom", "x": "2"}, "command zoom: x = '2'"),
        ({"kind": "compare", "value": "adaptive"}, "want one of nothing, framed, frameless, hilbert"),
        ({"kind": "statistics", "value": "off"}, "command statistics 'off': want one of nothing, on"),
        ({"kind": "statistics", "value": []}, "command statistics list"),
        ({"kind": "sampler", "value": "x" * 1000}, "want one of adaptive, framed, frameless, hilbert"),
        ({"kind": "sampler", "value": {}}, "command sampler dict"),
    ],
)
def test_what_is_not_exactly_a_command_is_refused(message: dict[str, Any], expected: str) -> None:
    with pytest.raises(RemoteProtocolError) as caught:
        parse(message)
    assert expected in str(caught.value)
    assert len(str(caught.value)) < 200


json = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner, max_size=3),
)


@settings(max_examples=300, deadline=None, derandomize=True)
@given(
    json
    | st.fixed_dictionaries(
        {"kind": st.sampled_from(["orbit", "zoom", "sampler", "pause"])}, optional={"x": json, "y": json, "value": json}
    )
)
def test_any_json_is_a_command_or_refused(message: Any) -> None:
    command = None
    try:
        command = parse(message)
    except RemoteProtocolError:
        return
    assert all(math.isfinite(v) for v in held().apply(command).camera().position)
