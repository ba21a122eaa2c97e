"""Rays of panel pixels are exact off-axis perspectives, and adjacent panels are one image."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from wall.config.screens import CornersConfig, GridConfig, PanelConfig, WallConfig
from wall.core.data import Float64
from wall.geometry.cameras import look_at
from wall.geometry.expanding import expand
from wall.geometry.frusta import cone_inside, distance_before, project, ray_frame
from wall.geometry.panels import Panel

PIXEL = 1e-9  # pixels; float64 leaves 1e-13, divisions by a near-zero depth cost the rest
FAR_PIXEL = 1e-6  # pixels, 1e6 units from the origin: positions there step by 1.2e-10, times 1e3 pixels
STILL = look_at((0, 0, 0), (0, 0, -1), (0, 1, 0))


def a_grid(columns: int, rows: int, pixels: tuple[int, int]) -> tuple[Panel, ...]:
    size = (0.001 * pixels[0], 0.001 * pixels[1])
    return expand(WallConfig(grid=GridConfig(columns=columns, rows=rows, pixels=pixels, size=size))).panels


def direction(frame: Float64, panel: Panel, x: float, y: float) -> Float64:
    """The formula that tracing evaluates."""
    found: Float64 = frame[0] + (panel.screen[0] + x) * frame[1] + (panel.screen[1] + y) * frame[2]
    return found


def test_centred_eye_gives_the_textbook_pinhole() -> None:
    # a wall of 2 x 1 m seen from 1 m: the upper right corner is in direction (1, 0.5, -1)
    (panel,) = expand(WallConfig(grid=GridConfig(columns=1, rows=1, pixels=(200, 100), size=(2.0, 1.0)))).panels

    frame = ray_frame(panel, (0, 0, 1), STILL)

    assert_allclose(direction(frame, panel, 200, 0), [1, 0.5, -1], atol=1e-15)
    assert_allclose(direction(frame, panel, 100, 50), [0, 0, -1], atol=1e-15)


@pytest.mark.parametrize("eye", [(0, 0, 0.5), (0.7, -0.3, 0.2), (-3, 2, 4)])
@pytest.mark.parametrize("offset", [0.0, 1e6])
def test_corners_of_a_quad_behind_the_wall_land_on_pixel_corners(
    eye: tuple[float, float, float], offset: float
) -> None:
    # the point where the eye's ray through a pixel corner meets a parallel plane projects back onto that corner
    (panel,) = a_grid(1, 1, (64, 48))
    camera = look_at((offset + 3, offset - 2, offset), (offset, offset, offset + 9), (0, 1, 0))
    pixels = np.array([[0, 0], [64, 0], [64, 48], [0, 48], [17, 5]], dtype=np.float64)
    through = np.array([panel.plane.point(x, y) for x, y in pixels]) - np.array(eye)
    world = camera.origin() + 7.5 * through @ camera.rotation().T

    xy, depth = project(panel, eye, camera, world)

    assert_allclose(xy, pixels, rtol=0, atol=FAR_PIXEL if offset else PIXEL)
    assert_allclose(depth, 7.5 * np.linalg.norm(through, axis=1), rtol=1e-9)


def test_adjacent_panels_have_the_bits_of_the_whole_wall() -> None:
    parts, (whole,) = a_grid(4, 3, (30, 20)), a_grid(1, 1, (120, 60))
    camera = look_at((1.3, 2.7, 3.1), (-0.2, 0.4, 0.1), (0.1, 1, 0))
    eye = (0.013, -0.02, 0.11)
    frame = ray_frame(whole, eye, camera)

    for panel in parts:
        own = ray_frame(panel, eye, camera)
        assert own.tobytes() == ray_frame(parts[0], eye, camera).tobytes()
        x, y = np.meshgrid(np.arange(30) + 0.5, np.arange(20) + 0.5)
        for column, row in zip(x.ravel(), y.ravel(), strict=True):
            mine = direction(own, panel, column, row)
            theirs = direction(frame, whole, panel.screen[0] + column, panel.screen[1] + row)
            assert mine.tobytes() == theirs.tobytes()


def test_panels_at_an_angle_meet_without_a_bend() -> None:
    # two panels with a common edge: both give that edge the same directions
    first = CornersConfig(lower_left=(-1, 0, 0), lower_right=(0, 0, 0), upper_left=(-1, 1, 0))
    second = CornersConfig(lower_left=(0, 0, 0), lower_right=(0.5, 0, 0.8), upper_left=(0, 1, 0))
    configs = tuple(PanelConfig(id=i, pixels=(50, 60), corners=c) for i, c in (("a", first), ("b", second)))
    a, b = expand(WallConfig(panels=configs)).panels
    eye = (-0.3, 0.6, 1.4)
    frames = ray_frame(a, eye, STILL), ray_frame(b, eye, STILL)

    for y in (0.0, 13.0, 60.0):
        assert_allclose(direction(frames[0], a, 50, y), direction(frames[1], b, 0, y), atol=1e-14)


def test_scene_moved_a_million_units_away_has_the_same_rays() -> None:
    (panel,) = a_grid(1, 1, (64, 48))
    near = look_at((1, 2, 3), (0, 0, 0), (0, 1, 0))
    far = look_at((1e6 + 1, 1e6 + 2, 1e6 + 3), (1e6, 1e6, 1e6), (0, 1, 0))

    assert_allclose(ray_frame(panel, (0, 0, 1), far), ray_frame(panel, (0, 0, 1), near), rtol=0, atol=1e-15)


@settings(max_examples=100, deadline=None, derandomize=True)
@given(
    st.tuples(*[st.floats(-2, 2)] * 2, st.floats(0.05, 5)),
    st.tuples(*[st.floats(-100, 100)] * 3),
    st.tuples(st.floats(-50, 100), st.floats(-50, 100), st.floats(0.1, 1e4)),
)
def test_projection_undoes_the_ray(eye: tuple[float, ...], position: tuple[float, ...], hit: tuple[float, ...]) -> None:
    (panel,) = a_grid(1, 1, (64, 48))
    camera = look_at(position, (7.0, -3.0, 200.0), (0, 1, 0))
    x, y, along = hit
    ray = direction(ray_frame(panel, eye, camera), panel, x, y)

    xy, depth = project(panel, eye, camera, [camera.origin() + along * ray])

    assert_allclose(xy[0], [x, y], rtol=1e-6, atol=1e-6)
    assert_allclose(depth[0], along * np.linalg.norm(ray), rtol=1e-9)


def test_point_behind_the_eye_has_no_pixel() -> None:
    (panel,) = a_grid(1, 1, (64, 48))

    xy, depth = project(panel, (0, 0, 1), STILL, [[0, 0, 5], [0, 0, -5], [0, 0, 0]])

    assert np.isnan(xy[0]).all()
    assert_allclose(xy[1], [32, 24])
    assert np.isnan(xy[2]).all()
    assert_allclose(depth, [5, 5, 0])


def test_no_points_give_no_pixels() -> None:
    (panel,) = a_grid(1, 1, (64, 48))

    xy, depth = project(panel, (0, 0, 1), STILL, np.zeros((0, 3)))

    assert xy.shape == (0, 2)
    assert depth.shape == (0,)


def test_distance_before_a_panel_is_signed() -> None:
    (panel,) = a_grid(1, 1, (64, 48))

    assert distance_before(panel, (9, 9, 2)) == pytest.approx(2)
    assert distance_before(panel, (0, 0, -0.5)) == pytest.approx(-0.5)


def test_widest_cone_in_a_square_window_is_half_its_angle() -> None:
    # a square of 2 x 2 seen from 1 before its middle spans 90 degrees each way
    square = np.array([[-1.0, -1, 0], [1, -1, 0], [-1, 1, 0]])

    assert cone_inside([square], (0, 0, 1), np.array([0.0, 0, -1])) == pytest.approx(np.pi / 4)
    assert cone_inside([square], (0, 0, 1), np.array([1.0, 0, 0])) < 0
