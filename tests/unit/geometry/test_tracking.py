"""A tracked eye: where it will be when an image becomes light, and what it does where the tracker errs or is silent."""

from __future__ import annotations

import numpy as np
import pytest

from wall.commands.tracker import SWAY_M, SWAY_S, sway
from wall.config.tracking import TrackingConfig
from wall.core.data import Float64
from wall.geometry.tracking import (
    FADED_S,
    FOLLOW_M_S,
    HELD_S,
    JUMP_M,
    NEAREST_M,
    RETAKEN,
    RETURN_M_S,
    STILL_M,
    WINDOW_S,
    Planes,
    TrackedEye,
    tracker_from_wall,
    wall_from_tracker,
)

REST = np.array([0.0, 0.0, 1.2])
FAR = Planes(np.array([[0.0, 0.0, 1.0]]), np.array([NEAREST_M]))
STEP_S, AHEAD_S, DELAY_S = 0.01, 0.025, 0.01  # of a tracker with 100 Hz; of a view with 60 Hz


def eye(*, ahead_s: float | None = AHEAD_S, planes: Planes = FAR) -> TrackedEye:
    return TrackedEye(REST, planes, ahead_s=ahead_s)


def shown(tracked: TrackedEye, now: float) -> Float64:
    return REST + np.array(tracked.at(now))


def errors_of_sway(ahead_s: float | None, noise_m: float = 0.0) -> Float64:
    """(n,) metres, of what is shown at 120 Hz against where the head is when that becomes light."""
    tracked, movement, random, found = eye(ahead_s=ahead_s), sway(REST), np.random.default_rng(1), []
    told = 0
    for k in range(1200):
        now = k / 120.0
        while told * STEP_S <= now:
            position = movement(told * STEP_S - DELAY_S) + noise_m * random.standard_normal(3)
            assert tracked.take(position, told * STEP_S, DELAY_S) == ""
            told += 1
        if k > 60:
            found.append(float(np.linalg.norm(shown(tracked, now) - movement(now + AHEAD_S))))
    return np.array(found)


def test_a_head_that_sways_is_foreseen_within_the_bound_and_far_better_than_not_foreseen() -> None:
    """a = 0.72 m/s^2 at most (its axes' highest at once); h is up to the delay, a step and the time to light."""
    most = float(np.linalg.norm(np.array(SWAY_M) * (2 * np.pi / np.array(SWAY_S)) ** 2))
    ahead = DELAY_S + STEP_S + AHEAD_S
    bound = most / 2 * (ahead**2 + ahead * WINDOW_S + WINDOW_S**2 / 6) + STILL_M

    found = errors_of_sway(AHEAD_S)

    assert bound < 3.5e-3
    assert found.max() < bound
    assert np.sqrt((found**2).mean()) < np.sqrt((errors_of_sway(None) ** 2).mean()) / 8  # measured: 1.1 mm and 12.2 mm


def test_noise_of_a_tracker_is_not_made_large_by_prediction() -> None:
    """The line's value 0.045 s ahead of 7 positions has 1.7 times the standard deviation of one, in each axis."""
    noise = errors_of_sway(AHEAD_S, noise_m=1e-3)

    assert np.sqrt((noise**2).mean()) < 1e-3 * (1.7 * np.sqrt(3) + 1)


def test_a_trembling_head_at_rest_is_one_eye() -> None:
    tracked, random = eye(), np.random.default_rng(2)
    seen = set()
    for k in range(200):
        tracked.take(REST + 0.1 + 2e-5 * random.standard_normal(3), k * STEP_S, DELAY_S)
        seen.add(tracked.at(k * STEP_S))

    assert len(seen) == 1


def test_a_silent_tracker_holds_the_eye_then_it_glides_back() -> None:
    tracked, last, start = eye(), 0.0, REST + np.array((0.3, 0.0, 0.0))
    for k in range(50):
        last = k * STEP_S
        tracked.take(start + np.array((0.2 * last, 0.0, 0.0)), last, DELAY_S)
        tracked.at(last)

    held = [shown(tracked, last + after) for after in (2 * FADED_S, HELD_S / 2, HELD_S)]
    for each in held:
        np.testing.assert_allclose(each, start + np.array((0.2 * last, 0.0, 0.0)), atol=STILL_M)
    later = last + HELD_S + 0.2
    np.testing.assert_allclose(shown(tracked, later), held[-1] - (RETURN_M_S * 0.2, 0.0, 0.0), atol=1e-9)
    assert tracked.at(later + 10.0) == (0.0, 0.0, 0.0)


def test_a_tracker_that_comes_back_makes_no_cut() -> None:
    tracked = eye()
    before = shown(tracked, 1.0)
    tracked.take(REST + np.array((0.5, 0.0, 0.0)), 1.0, 0.0)

    way = [float(np.linalg.norm(shown(tracked, now) - before)) for now in (1.01, 1.05, 1.2)]

    assert way == pytest.approx([FOLLOW_M_S * 0.01, FOLLOW_M_S * 0.05, 0.5])


def test_a_jump_is_left_out_until_the_tracker_insists() -> None:
    tracked = eye(ahead_s=None)
    for k in range(10):
        tracked.take(REST, k * STEP_S, 0.0)
    away = REST + np.array((3 * JUMP_M + 1.0, 0.0, 0.0))

    assert tracked.take(away, 0.1, 0.0) == "tracker_jump"
    assert tracked.take(REST, 0.11, 0.0) == ""
    assert tracked.at(0.11) == (0.0, 0.0, 0.0)
    refused = [tracked.take(away, 0.12 + k * STEP_S, 0.0) for k in range(RETAKEN)]
    assert refused == ["tracker_jump"] * (RETAKEN - 1) + [""]
    np.testing.assert_allclose(shown(tracked, 0.5), away, atol=STILL_M)


def test_numbers_that_are_none_are_left_out() -> None:
    tracked = eye()
    assert tracked.take(np.array([0.0, np.nan, 1.0]), 0.0, 0.0) == "tracker_bad_packet"
    assert tracked.at(0.0) == (0.0, 0.0, 0.0)


@pytest.mark.parametrize("position", [(0.0, 0.0, -1.0), (3.0, 0.0, 0.5), (9.0, 0.0, -9.0), (0.2, 0.1, 0.01)])
def test_the_eye_stays_before_every_panel(position: tuple[float, float, float]) -> None:
    """A corner: a panel in front, and one at the right, x = 0.5, that faces the left."""
    corner = Planes(np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0]]), np.array([NEAREST_M, NEAREST_M - 0.5]))
    tracked = eye(planes=corner)
    tracked.take(np.array(position), 0.0, 0.0)

    x, y, z = shown(tracked, 0.0)

    assert z >= NEAREST_M - 1e-9
    assert x <= 0.5 - NEAREST_M + 1e-9
    assert y == pytest.approx(position[1]), "it is moved no farther than it has to be"


def test_a_tracker_s_units_and_axes_become_the_wall_s() -> None:
    """Millimetres, z up, y away from the viewer, told from the floor 1.4 m beneath the wall's centre."""
    config = TrackingConfig(metres_per_unit=0.001, axes=("x", "z", "-y"), origin=(0.1, -1.4, 0.0))

    position = wall_from_tracker(config, (200.0, -900.0, 1650.0))

    np.testing.assert_allclose(position, [0.3, 0.25, 0.9], atol=1e-12)
    np.testing.assert_allclose(tracker_from_wall(config, position), [200.0, -900.0, 1650.0], atol=1e-9)
