"""A twist takes one camera to another, and its multiples lie on the way of a camera that moves steadily."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from wall.core.data import STILL, Camera
from wall.geometry.cameras import look_at
from wall.geometry.twist import between, moved

UP, TARGET = (0, 1, 0), np.array([0.5, 0.6, -0.3])
ROUNDING = 1e-12  # relative: a few dozen float64 operations
place = st.tuples(*[st.floats(-50, 50)] * 3)


def orbiting(radians: float, *, distance: float = 7.0) -> Camera:
    level = np.array([math.sin(radians), 0.4, math.cos(radians)])
    return look_at(TARGET + distance * level, TARGET, UP)


@settings(max_examples=200, deadline=None, derandomize=True)
@given(place, place, place, place)
def test_twist_takes_the_start_to_the_end(
    a: tuple[float, ...], at: tuple[float, ...], b: tuple[float, ...], to: tuple[float, ...]
) -> None:
    start, end = look_at(a, at, UP), look_at(b, to, UP)

    twist = between(start, end)
    found = moved(start, twist)

    half = np.trace(start.rotation().T @ end.rotation()) < -1 + 1e-9  # of a circle: its axis is lost to rounding
    assert np.isfinite(twist).all()
    if not half:
        assert_allclose(found.rotation(), end.rotation(), atol=1e-9)
        assert_allclose(found.origin(), end.origin(), atol=1e-7)


@pytest.mark.parametrize("radians", [1e-9, 1e-5, 9.9e-5, 1.01e-4, 1e-3, 0.3])
def test_orbit_is_one_twist_at_constant_speed(radians: float) -> None:
    start, third, end = (orbiting(0.2 + k * radians) for k in (0, 1, 3))

    found = moved(start, 3.0 * between(start, third))

    assert_allclose(found.origin(), end.origin(), atol=30 * ROUNDING)
    assert_allclose(found.rotation(), end.rotation(), atol=30 * ROUNDING)


def test_turn_on_the_spot_leaves_the_place_alone() -> None:
    start, end = look_at((3, 2, 1), (0, 2, 0), UP), look_at((3, 2, 1), (0.5, 2, 0), UP)

    twist = between(start, end)

    assert_allclose(twist[3:], 0.0, atol=ROUNDING)
    assert_allclose(moved(start, 2.5 * twist).origin(), (3, 2, 1), atol=10 * ROUNDING)


def test_twist_is_measured_in_the_cameras_own_frame() -> None:
    start = look_at((0, 0, 0), (5, 0, 0), UP)  # its -z is the world's x
    end = look_at((2, 0, 0), (5, 0, 0), UP)

    assert_allclose(between(start, end), [0, 0, 0, 0, 0, -2], atol=ROUNDING)


def test_turn_about_one_axis_is_its_angle() -> None:
    c, s = math.cos(0.7), math.sin(0.7)
    turned = Camera(position=(0.0, 0.0, 0.0), world_from_wall=(c, 0.0, s, 0.0, 1.0, 0.0, -s, 0.0, c))

    assert_allclose(between(STILL, turned), [0, 0.7, 0, 0, 0, 0], atol=ROUNDING)


def test_half_a_circle_and_no_motion_are_finite() -> None:
    back = Camera(position=(1.0, 2.0, 3.0), world_from_wall=(-1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, -1.0))

    assert np.isfinite(between(STILL, back)).all()
    assert not between(back, back).any()
    assert moved(back, np.zeros(6)) is back


def test_far_from_the_origin_a_step_keeps_its_digits() -> None:
    start, end = look_at((1e6, 0, 0), (1e6 + 1, 0, 0), UP), look_at((1e6 + 1e-3, 0, 0), (1e6 + 1, 0, 0), UP)

    found = moved(start, 2.0 * between(start, end))

    assert found.position[0] - 1e6 == pytest.approx(2e-3, abs=1e-9)  # float64 steps by 1e-10 there
