"""Each panel is seen from its own eye: stereo has the parallax of two windows into one world."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from wall.config.loading import Loaded, loads
from wall.core.data import Event, Float64
from wall.core.errors import ConfigError
from wall.geometry.cameras import PanelView, View, resolve_view, seen_from
from wall.geometry.checks import check_wall
from wall.geometry.expanding import expand
from wall.geometry.frusta import project, ray_frame
from wall.geometry.panels import Panel, Wall

PIXEL = 1e-9  # pixels; see test_frusta
STEREO = "grid: {columns: 1, rows: 1, pixels: [200, 100], size: [2, 1], stereo: side_by_side}"
LOOKING = "eye: [0, 0, 2], eye_separation: 0.06, camera: {position: [1, 2, 3], target: [1, 2, -7]}"
MONO = STEREO.replace(", stereo: side_by_side", "")


def configured(view: str, wall: str) -> tuple[Loaded, Wall]:
    loaded = loads(f"version: 1\nscene: {{source: x}}\nwall:\n  {wall}\nviews: [{{{view}}}]\n", name="a.yaml")
    return loaded, expand(loaded.config.wall)


def resolved(view: str = LOOKING, wall: str = STEREO) -> tuple[View, Wall]:
    loaded, expanded = configured(view, wall)
    return resolve_view(loaded, expanded, (0, 0, 0), 1.0), expanded


def event_of(view: View, time: float = 0.0) -> Event:
    return Event(view=0, camera_event=3, scene_event=4, scene_time=time, input_time=0.0, camera=view.camera_at(time))


def pixel(view: View, panel: Panel, point: tuple[float, float, float], *, time: float = 0.0) -> Float64:
    """(2,) where a world point is seen on a panel."""
    event = seen_from(event_of(view, time), view.offset(panel))
    return project(panel, view.eye_of(panel), event.camera, [point])[0][0]


def test_scale_puts_the_target_in_the_plane_of_the_wall() -> None:
    view, _ = resolved()

    assert view.scale == pytest.approx(5.0)  # 10 world units to the target, 2 m to the wall
    assert resolved(LOOKING + ", scale: 3")[0].scale == 3.0


def test_scale_of_an_eye_beside_the_middle_puts_the_target_in_the_plane_too() -> None:
    view, wall = resolved(LOOKING.replace("[0, 0, 2]", "[0.7, -0.2, 2]"))
    left, right = wall.panels

    assert_allclose(pixel(view, left, (1, 2, -7)), pixel(view, right, (1, 2, -7)), atol=PIXEL)


def test_point_in_the_plane_of_the_wall_has_no_parallax() -> None:
    view, wall = resolved()
    left, right = wall.panels

    for point in ((1, 2, -7), (3.3, 0.4, -7), (-2, 3.9, -7)):
        assert_allclose(pixel(view, left, point), pixel(view, right, point), rtol=0, atol=PIXEL)


def test_point_at_infinity_has_the_parallax_of_the_eyes() -> None:
    # its rays are parallel, so they cross the wall as far apart as the eyes: 0.06 m, 3 pixels of 0.02 m
    view, wall = resolved()
    left, right = wall.panels

    away = pixel(view, right, (1e9 + 1, 2, -1e10 - 7)) - pixel(view, left, (1e9 + 1, 2, -1e10 - 7))

    assert_allclose(away, [3.0, 0.0], atol=1e-6)


def test_known_point_is_where_similar_triangles_have_it() -> None:
    # 0.5 m right of the middle and 2 m behind the wall, in metres of the wall: 2.5 and 10 world units
    # an eye at x = -+0.03 m and 2 m before the wall sees it at the mean of its own x and the point's: 0.235 and 0.265 m
    view, wall = resolved()
    left, right = wall.panels
    point = (1 + 2.5, 2.0, -7 - 10.0)

    assert_allclose(pixel(view, left, point), [(1 + 0.235) / 0.02, 50.0], atol=PIXEL)
    assert_allclose(pixel(view, right, point), [(1 + 0.265) / 0.02, 50.0], atol=PIXEL)


def test_point_before_the_wall_has_crossed_parallax() -> None:
    # half way between eye and wall: its shadow on the wall is as far beyond the middle as the eye is on the other side
    view, wall = resolved()
    left, right = wall.panels

    away = pixel(view, right, (1, 2, -2)) - pixel(view, left, (1, 2, -2))

    assert_allclose(away, [-3.0, 0.0], atol=PIXEL)


@settings(max_examples=50, deadline=None, derandomize=True)
@given(st.floats(0, 40), st.floats(-1, 1), st.floats(-0.5, 0.5))
def test_wall_s_plane_has_no_parallax_wherever_the_camera_goes(time: float, x: float, y: float) -> None:
    view, wall = resolved(LOOKING.replace("-7", "-6.5") + ", path: {type: orbit, period_s: 40}")
    left, right = wall.panels
    camera = view.camera_at(time)
    on_wall = (np.array([x, y, 0.0]) - view.eye) * view.scale
    point = tuple(float(v) for v in camera.origin() + camera.rotation() @ on_wall)

    for panel in (left, right):
        assert_allclose(pixel(view, panel, point, time=time), [(1 + x) / 0.02, (0.5 - y) / 0.01], atol=1e-6)


def test_panel_with_its_own_eye_is_a_window_at_its_place() -> None:
    # seen from 1 m to the right, a point 2 m behind the wall is where the line from there crosses it
    panel = (
        "panels: [{id: a, pixels: [200, 100], eye: [1, 0, 2], "
        "corners: {lower_left: [-1, -0.5, 0], lower_right: [1, -0.5, 0], upper_left: [-1, 0.5, 0]}}]"
    )
    view, wall = resolved(wall=panel)
    (only,) = wall.panels

    assert_allclose(view.eye_of(only), [1, 0, 2])
    assert_allclose(view.offset(only), [5, 0, 0])
    assert_allclose(pixel(view, only, (1.0, 2.0, -17.0)), [(1 + 0.5) / 0.01, 50.0], atol=PIXEL)


def test_ordinary_panel_is_seen_by_the_view_s_eye_and_its_events_are_the_same_objects() -> None:
    view, wall = resolved(wall=MONO)
    event, (only,) = event_of(view), wall.panels

    assert view.eye_of(only) is view.eye
    assert not view.offset(only).any()
    assert seen_from(event, view.offset(only)) is event
    assert PanelView(view, only)(event) is event


def test_event_seen_from_elsewhere_differs_in_nothing_but_its_place() -> None:
    view, wall = resolved()
    event = event_of(view)

    moved = seen_from(event, view.offset(wall.panels[1]))

    assert_allclose(np.subtract(moved.camera.position, event.camera.position), [0.15, 0, 0], atol=1e-15)
    assert replace(moved, camera=event.camera) == event
    assert moved.camera.world_from_wall == event.camera.world_from_wall


def test_same_event_gives_the_same_object_again() -> None:
    view, wall = resolved()
    panel_view, event = PanelView(view, wall.panels[0]), event_of(view)

    assert panel_view(event) is panel_view(event)
    assert panel_view(replace(event, camera_event=9)).camera_event == 9


def test_both_eyes_share_the_bits_of_a_mono_wall_s_directions_when_they_coincide() -> None:
    view, wall = resolved(LOOKING.replace("0.06", "0"))
    mono_view, mono = resolved(LOOKING, MONO.replace("[200, 100]", "[100, 100]"))
    event = event_of(view)

    expected = ray_frame(mono.panels[0], mono_view.eye, event.camera)

    assert ray_frame(wall.panels[0], view.eye_of(wall.panels[0]), event.camera).tobytes() == expected.tobytes()


PANEL = "{id: a, pixels: [4, 3], corners: {lower_left: [0, 0, 0], lower_right: [4, 0, 0], upper_left: [0, 3, 0]}"


@pytest.mark.parametrize(
    ("view", "wall", "expected"),
    [
        ("eye: [0, 0, -1]", f"panels: [{PANEL}}}]", "a.yaml:5:15: views[0].eye = [0, 0, -1]: is 1 m behind panel a"),
        ("eye: [0, 0, 1]", f"panels: [{PANEL}, eye: [0, 0, -2]}}]", "wall.panels[0].eye = [0, 0, -2]: is 2 m behind"),
        ("eye: [0, 0, 0]", f"panels: [{PANEL}}}]", "is in the plane of panel a"),
        (
            "eye: [-0.02, 0, 1], eye_separation: 0.1",
            "panels: [{id: a, pixels: [4, 3], stereo: side_by_side, "
            "corners: {lower_left: [0, 0, 0], lower_right: [0, 0, 4], upper_left: [0, 3, 0]}}]",
            "is 0.03 m behind panel a.right, for the right eye",
        ),
    ],
)
def test_eye_that_cannot_see_its_panel_is_refused(view: str, wall: str, expected: str) -> None:
    loaded, expanded = configured(view, wall)

    with pytest.raises(ConfigError) as caught:
        check_wall(loaded, expanded)

    assert expected in str(caught.value)
