"""Cameras look where they should, frame what they should, and move smoothly."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from wall.config.loading import Loaded, loads
from wall.core.errors import ConfigError
from wall.geometry.cameras import View, default_eye, look_at, resolve_view
from wall.geometry.curves import catmull_rom, wrapped
from wall.geometry.expanding import expand
from wall.geometry.frusta import project
from wall.geometry.panels import Wall
from wall.geometry.twist import rotation_by

GRID = "grid: {columns: 2, rows: 2, pixels: [160, 90], size: [0.16, 0.09], bezel: 0.004}"
CORNER = """\
panels:
    - {id: a, pixels: [40, 30], corners: {lower_left: [-0.4, 0, 0], lower_right: [0, 0, 0], upper_left: [-0.4, 0.3, 0]}}
    - {id: b, pixels: [40, 30], corners: {lower_left: [0, 0, 0], lower_right: [0, 0, 0.4], upper_left: [0, 0.3, 0]}}
"""
SEAM = """\
panels:
    - id: a
      pixels: [160, 120]
      corners: {lower_left: [-1.15, -0.45, -0.3], lower_right: [0, -0.45, -0.6], upper_left: [-1.15, 0.45, -0.3]}
    - id: b
      pixels: [160, 120]
      corners: {lower_left: [0, -0.45, -0.6], lower_right: [1.15, -0.45, -0.3], upper_left: [0, 0.45, -0.6]}
"""


def configured(view: str, wall: str = GRID) -> tuple[Loaded, Wall]:
    loaded = loads(f"version: 1\nscene: {{source: x}}\nwall:\n  {wall}\nviews: [{{{view}}}]\n", name="a.yaml")
    return loaded, expand(loaded.config.wall)


def resolved(view: str, wall: str = GRID, *, center: tuple[float, ...] = (0, 0, 0), radius: float = 1.0) -> View:
    return resolve_view(*configured(view, wall), center, radius)


def test_look_at_turns_minus_z_to_the_target_and_y_up() -> None:
    camera = look_at((1, 2, 3), (1, 2, -7), (0, 1, 0))

    assert camera.position == (1, 2, 3)
    assert_allclose(camera.rotation(), np.eye(3), atol=1e-15)


vectors = st.tuples(*[st.floats(-1e3, 1e3)] * 3)


@settings(max_examples=200, deadline=None, derandomize=True)
@given(vectors, vectors, vectors)
def test_look_at_always_gives_a_rotation(
    position: tuple[float, ...], target: tuple[float, ...], up: tuple[float, ...]
) -> None:
    rotation = look_at(position, target, up).rotation()

    assert_allclose(rotation.T @ rotation, np.eye(3), atol=1e-9)
    assert np.linalg.det(rotation) == pytest.approx(1)


@pytest.mark.parametrize("target", [(0, -5, 0), (0, 5, 0)])
def test_look_at_along_up_still_looks_at_the_target(target: tuple[float, float, float]) -> None:
    assert_allclose(-look_at((0, 0, 0), target, (0, 1, 0)).rotation()[:, 2], np.array(target) / 5, atol=1e-15)


def test_default_eye_spans_the_field_of_view_over_the_whole_wall() -> None:
    _, wall = configured("camera: auto")

    eye = default_eye(wall, 60.0)

    half = wall.height / 2 * 0.001
    assert_allclose(eye, [0, 0, half / math.tan(math.radians(30))], atol=1e-12)


def test_default_eye_of_a_tilted_wall_is_before_its_middle() -> None:
    tilted = (
        "panels: [{id: a, pixels: [40, 30], corners: {lower_left: [0, 0, 0], lower_right: [4, 0, 0], "
        "upper_left: [0, 0, -3]}}]"
    )
    _, wall = configured("camera: auto", tilted)

    assert_allclose(default_eye(wall, 90.0), [2, 1.5, -1.5], atol=1e-12)


def test_camera_at_a_place_looks_at_its_target_in_the_middle_of_the_wall() -> None:
    loaded, wall = configured("camera: {position: [3, 4, 5], target: [1, 1, 1], fov: 30}")
    view = resolve_view(loaded, wall, (9, 9, 9), 1.0)

    xy, _ = project(wall.panels[0], view.eye, view.camera_at(0.0), [[1, 1, 1]])

    assert_allclose(xy[0], [wall.width / 2, wall.height / 2], atol=1e-9)


@pytest.mark.parametrize("camera", ["auto", "{direction: [0, -2, 0], up: [0, 0, -1]}", "{direction: [1, 1, 0]}"])
@pytest.mark.parametrize("eye", ["", "eye: [0.1, -0.05, 0.2], "])
@pytest.mark.parametrize(("radius", "center"), [(1.0, (0, 0, 0)), (1e-6, (3, 4, 5)), (1e7, (1e6, 0, -1e6))])
def test_automatic_camera_sees_the_whole_scene_and_not_much_else(
    camera: str, eye: str, radius: float, center: tuple[float, ...]
) -> None:
    loaded, wall = configured(f"{eye}camera: {camera}")
    view = resolve_view(loaded, wall, center, radius)
    angles = np.linspace(0, 2 * np.pi, 60)
    around = np.array([[np.cos(a) * np.sin(b), np.cos(b), np.sin(a) * np.sin(b)] for a in angles for b in angles])

    xy, _ = project(wall.panels[0], view.eye, view.camera_at(0.0), np.array(center) + radius * around)

    # a sphere fits exactly if it touches the nearer pair of edges and stays within the others
    assert np.isfinite(xy).all()
    assert xy.min() > -0.5
    assert xy[:, 0].max() < wall.width + 0.5
    assert xy[:, 1].max() < wall.height + 0.5
    margins = [xy[:, 0].min(), xy[:, 1].min(), wall.width - xy[:, 0].max(), wall.height - xy[:, 1].max()]
    assert min(margins) < 0.03 * wall.height


def test_an_automatic_camera_looks_along_its_direction() -> None:
    rotation = resolved("camera: {direction: [0, -2, 0], up: [0, 0, -1]}").still.rotation()

    assert_allclose(-rotation[:, 2], (0, -1, 0), atol=1e-12)
    assert_allclose(rotation[:, 1], (0, 0, -1), atol=1e-12)


@pytest.mark.parametrize("radius", [0.0, math.inf, math.nan])
def test_automatic_camera_of_a_scene_without_size_is_finite(radius: float) -> None:
    assert np.isfinite(resolved("camera: auto", radius=radius).camera_at(0.0).position).all()


def test_automatic_camera_before_a_corner_sees_the_scene_in_the_panel_ahead() -> None:
    loaded, wall = configured("eye: [-0.2, 0.1, 0.5], camera: auto", CORNER)
    view = resolve_view(loaded, wall, (1, 2, 3), 2.0)

    xy, _ = project(wall.panels[0], view.eye, view.camera_at(0.0), [[1, 2, 3]])

    assert_allclose(xy[0], [20, 15], atol=1e-9)


@pytest.mark.parametrize("eye", [(0.0, 0.0, 1.0), (0.05, 0.1, 0.9), (-0.02, -0.1, 1.2)])
def test_an_automatic_camera_before_the_seam_of_two_panels_sees_the_scene_whole_across_it(
    eye: tuple[float, float, float],
) -> None:
    loaded, wall = configured(f"eye: {list(eye)}, camera: auto", SEAM)
    view = resolve_view(loaded, wall, (1, 2, 3), 2.0)
    around = np.random.default_rng(1).normal(size=(4000, 3))
    points = np.array([1, 2, 3]) + 2.0 * around / np.linalg.norm(around, axis=1, keepdims=True)
    inside = np.zeros((2, len(points)), bool)
    for each, panel in zip(inside, wall.panels, strict=True):
        xy, _ = project(panel, view.eye, view.camera_at(0.0), points)
        each[:] = ((xy > 0) & (xy < panel.pixels)).all(axis=1)
    assert inside.any(axis=0).all()
    assert inside.sum(axis=1).min() > 1000, "it is not in one of them alone"


def test_wall_that_is_not_flat_needs_an_eye() -> None:
    with pytest.raises(
        ConfigError, match=r"a\.yaml:8:9: views\[0\]: the wall is not flat, so the eye's place is needed"
    ):
        resolved("camera: auto", CORNER)


@pytest.mark.parametrize(
    ("eye", "expected"),
    [("[0.1, 0.1, 0.3]", "is 0.1 m behind panel b"), ("[-0.1, 0.1, 0]", "is in the plane of panel a")],
)
def test_eye_that_does_not_see_a_panel_is_refused(eye: str, expected: str) -> None:
    with pytest.raises(ConfigError, match=rf"a\.yaml:8:15: views\[0\]\.eye = .*: {expected}"):
        resolved(f"eye: {eye}, camera: auto", CORNER)


def test_spread_is_the_height_over_the_distance() -> None:
    assert resolved("camera: {fov: 90}").spread == pytest.approx(2.0)


def test_orbit_comes_back_after_its_period_and_keeps_its_distance() -> None:
    view = resolved("camera: {position: [3, 1, 4], target: [1, 0, 2]}, path: {type: orbit, period_s: 8}")

    assert_allclose(view.camera_at(8.0).position, (3, 1, 4), atol=1e-12)
    assert_allclose(view.camera_at(2.0).position, (3, 1, 0), atol=1e-12)  # a quarter turn, counterclockwise from above
    for time in (0.3, 5.0, 1e6):
        camera = view.camera_at(time)
        assert np.linalg.norm(camera.origin() - [1, 0, 2]) == pytest.approx(3.0)
        assert_allclose(camera.rotation(), look_at(camera.position, (1, 0, 2), (0, 1, 0)).rotation(), atol=1e-12)


def test_keyframes_are_reached_at_their_times_and_repeat() -> None:
    frames = (
        "{time: 1, position: [0, 0, 9], target: [0, 0, 0]}, {time: 3, position: [9, 0, 0], target: [0, 1, 0]}, "
        "{time: 4, position: [0, 0, 9], target: [0, 0, 0]}"
    )
    view = resolved(f"path: {{type: keyframes, keyframes: [{frames}]}}")

    assert_allclose(view.camera_at(3.0).position, (9, 0, 0), atol=1e-12)
    assert_allclose(view.target_at(3.0), (0, 1, 0), atol=1e-12)
    assert view.camera_at(2.2) == view.camera_at(2.2)
    assert_allclose(view.camera_at(2.2 + 300).position, view.camera_at(2.2).position, atol=1e-9)


def test_keyframes_without_loop_hold_at_both_ends() -> None:
    frames = "{time: 1, position: [0, 0, 9], target: [0, 0, 0]}, {time: 3, position: [9, 0, 0], target: [0, 1, 0]}"
    view = resolved(f"path: {{type: keyframes, loop: false, keyframes: [{frames}]}}")

    assert view.camera_at(0.0).position == (0, 0, 9)
    assert view.camera_at(99.0).position == (9, 0, 0)


@pytest.mark.parametrize("loop", ["false", "true"])
def test_a_camera_of_one_keyframe_stays_there(loop: str) -> None:
    frames = "{time: 1, position: [0, 0, 9], target: [0, 1, 0]}"
    view = resolved(f"path: {{type: keyframes, loop: {loop}, keyframes: [{frames}]}}")

    assert [view.camera_at(time).position for time in (0.0, 1.0, 7.5)] == [(0, 0, 9)] * 3


def test_spline_has_no_jump_in_place_or_speed() -> None:
    times, points = [0.0, 1.0, 1.5, 4.0], np.array([[0.0, 0, 0], [3, 1, 0], [2, 2, 2], [0, 0, 0]])
    step = 1e-6

    for knot in (1.0, 1.5, 4.0):  # the last is where a closed loop begins again
        before, at, after = (catmull_rom(times, points, knot + d, loop=True) for d in (-step, 0.0, step))
        assert_allclose((at - before) / step, (after - at) / step, atol=1e-4)


def test_spline_through_points_of_a_line_at_even_times_is_that_line() -> None:
    times, points = [0.0, 1.0, 2.0, 3.0], np.outer([0, 1, 2, 3], [1.0, -2.0])

    for time in np.linspace(0, 3, 13):
        assert_allclose(catmull_rom(times, points, float(time), loop=False), [time, -2 * time], atol=1e-14)


@given(st.floats(-1e9, 1e9), st.floats(-100, 100), st.floats(1e-3, 1e3))
def test_wrapped_time_stays_within_the_keyframes(time: float, first: float, span: float) -> None:
    times = [first, first + span]

    assert times[0] <= wrapped(times, time, loop=True) <= times[1]
    assert times[0] <= wrapped(times, time, loop=False) <= times[1]


def test_rotation_is_counterclockwise_seen_from_the_tip() -> None:
    assert_allclose(rotation_by(np.array([0.0, math.pi / 2, 0])) @ [0, 0, 1], [1, 0, 0], atol=1e-15)
