"""Foresight comes true where motion is steady, keeps its bound where it is not, and rests when its input rests."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from wall.core.data import Camera, Event
from wall.geometry.cameras import look_at
from wall.geometry.prediction import GONE_S, JUMP, LONGEST_S, SPACING_S, Predictor

UP, TARGET, DISTANCE = (0, 1, 0), np.array([0.0, 0.6, -0.3]), 7.0
TICK_S, REFRESH_S = 1 / 120, 1 / 60
Angle = Callable[[float], float]  # of the camera about its target, radians, by seconds


def orbiting(radians: float) -> Camera:
    return look_at(TARGET + DISTANCE * np.array([math.sin(radians), 0.3, math.cos(radians)]), TARGET, UP)


def sliding(x: float) -> Camera:
    return look_at((x, 0, 0), (x, 0, -1), UP)


def event(number: int, time: float, camera: Camera, **changes: object) -> Event:
    plain = Event(
        view=0, camera_event=number, scene_event=0, scene_time=0.0, input_time=time, camera=camera, sampler="adaptive"
    )
    return replace(plain, **changes)  # type: ignore[arg-type]


def heard(camera_at: Callable[[float], Camera], times: list[float], *, delay: float) -> Predictor:
    """A predictor that heard a path at some times, and was asked at every refresh in between."""
    predictor, asked = Predictor(delay), 0.0
    for number, time in enumerate(times):
        predictor.take(event(number, time, camera_at(time)))
        if time >= asked:
            predictor.at(time)
            asked = time + REFRESH_S
    return predictor


def ticks(until: float, *, every: float = TICK_S) -> list[float]:
    return [k * every for k in range(round(until / every) + 1)]


def angle_between(a: Camera, b: Camera) -> float:
    return math.acos(min(1.0, (float(np.trace(a.rotation().T @ b.rotation())) - 1.0) / 2.0))


@pytest.mark.parametrize("delay", [0.0, REFRESH_S, 2 * REFRESH_S])
def test_steady_orbit_comes_true(delay: float) -> None:
    predictor = heard(lambda t: orbiting(1.2 * t), ticks(0.5), delay=delay)

    found = predictor.at(0.505).camera

    wanted = orbiting(1.2 * (0.505 + delay))
    assert_allclose(found.origin(), wanted.origin(), atol=1e-9)
    assert_allclose(found.rotation(), wanted.rotation(), atol=1e-9)


@pytest.mark.parametrize("later", [0.0, 0.02, 0.06])
def test_steady_orbit_comes_true_for_images_that_are_seen_later(later: float) -> None:
    """What is foreseen for a moment is judged when that moment has come, however often others are asked for before."""
    predictor = Predictor(REFRESH_S)
    for number, time in enumerate(ticks(0.5)):
        predictor.take(event(number, time, orbiting(1.2 * time)))
        predictor.at(time, later)

    found, wanted = predictor.at(0.505, later).camera, orbiting(1.2 * (0.505 + later + REFRESH_S))

    assert_allclose(found.origin(), wanted.origin(), atol=1e-9)
    assert_allclose(found.rotation(), wanted.rotation(), atol=1e-9)


def test_rays_are_foreseen_for_the_refresh_after_this_one_and_images_do_not_notice() -> None:
    """Farther ahead than images are; on a path that trembles, where trust is learnt, it stays what it would have been.
    Where nothing moves rays are for the newest event itself."""
    for path in (lambda t: 1.2 * t, lambda t: 1.2 * t + 0.002 * math.sin(90.0 * t)):
        images, rays = Predictor(LONGEST_S - 0.01), Predictor(LONGEST_S - 0.01)
        for number, time in enumerate(ticks(0.5)):
            for predictor in (images, rays):
                predictor.take(event(number, time, orbiting(path(time)), scene_event=number, scene_time=time))
            for_rays, seen, alone = rays.at(time, next_in=REFRESH_S), rays.at(time), images.at(time)
            assert seen == alone
        assert for_rays.number == (number, number), "that of the newest event"
        assert for_rays.scene_time == pytest.approx(time + LONGEST_S - 0.01 + REFRESH_S)
        steady = orbiting(1.2 * (time + LONGEST_S - 0.01 + REFRESH_S))
        assert angle_between(for_rays.camera, steady) < 0.02
    assert angle_between(seen.camera, for_rays.camera) > 0.01
    far, farthest = (rays.at(time, next_in=wait) for wait in (LONGEST_S, 10.0))
    assert farthest.camera == far.camera, "where refreshes take seconds, rays stay near what is known"
    still = event(number + 1, time + 1.0, orbiting(path(time)), scene_event=number, scene_time=time)
    rays.take(still)
    assert rays.at(time + 1.5, next_in=REFRESH_S) is still


@pytest.mark.parametrize("delay", [REFRESH_S, 2 * REFRESH_S])
@pytest.mark.parametrize("acceleration", [5.0, 20.0, 40.0])  # radians / s^2; a flick reaches 5 rad/s in an eighth
def test_growing_speed_is_off_by_just_the_bound(acceleration: float, delay: float) -> None:
    angle: Angle = lambda t: 3.0 * t + acceleration * t * t / 2  # noqa: E731
    times = ticks(0.1)
    predictor = heard(lambda t: orbiting(angle(t)), times, delay=delay)

    off = angle_between(predictor.at(times[-1]).camera, orbiting(angle(times[-1] + delay)))

    bound = acceleration * delay * (delay + TICK_S) / 2
    assert off == pytest.approx(bound, rel=1e-6), "constant acceleration is the worst that |dv/dt| <= a allows"


@pytest.mark.parametrize("delay", [REFRESH_S, 2 * REFRESH_S])
@pytest.mark.parametrize("acceleration", [-5.0, -20.0, -40.0])  # the last one reverses
def test_falling_speed_is_no_farther_off_than_the_bound_or_than_no_foresight(acceleration: float, delay: float) -> None:
    angle: Angle = lambda t: 3.0 * t + acceleration * t * t / 2  # noqa: E731
    times = ticks(0.16)
    predictor = heard(lambda t: orbiting(angle(t)), times, delay=delay)
    for now in (times[-1], times[-1] + 0.004):
        true = orbiting(angle(now + delay))
        unforeseen = angle_between(orbiting(angle(times[-1])), true)
        h = now + delay - times[-1]
        bound = abs(acceleration) * h * (h + TICK_S) / 2

        off = angle_between(predictor.at(now).camera, true)

        assert off <= max(bound, unforeseen) * (1 + 1e-6)


def test_hand_that_lets_go_is_foreseen_to_rest_exactly() -> None:
    predictor = heard(lambda t: orbiting(1.2 * t), ticks(0.5), delay=REFRESH_S)
    newest = event(60, 0.5, orbiting(0.6))

    usual = [angle_between(predictor.at(0.5 + late).camera, newest.camera) for late in (0.004, 0.012)]
    silent = [angle_between(predictor.at(0.5 + late).camera, newest.camera) for late in (0.02, 0.024, 0.028, 0.032)]

    assert usual == sorted(usual), "as far ahead as the moment is"
    assert silent == sorted(silent, reverse=True)
    assert predictor.at(0.5 + 4 * TICK_S + 1e-9) == newest, "the event itself, its own number too"


def test_silence_ends_every_motion_in_time() -> None:
    slow = heard(lambda t: orbiting(1.2 * t), ticks(0.6, every=0.06), delay=REFRESH_S)

    assert slow.at(0.62).number < (0, 0), "inputs every 60 ms are still a motion"
    assert slow.at(0.6 + GONE_S + 1e-9).number == (10, 0)


def test_trembling_hand_is_not_amplified() -> None:
    """About 10 Hz, two refreshes ahead: whoever believes in the newest velocity is farther off than who does not."""
    tremble: Angle = lambda t: 0.002 * (math.sin(60 * t) + math.sin(67 * t + 1))  # noqa: E731
    delay, predictor = 2 * REFRESH_S, Predictor(2 * REFRESH_S)
    foreseen, unforeseen = [], []
    for number, time in enumerate(ticks(2.0)):
        predictor.take(event(number, time, orbiting(tremble(time))))
        if number % 2 == 0:
            true = orbiting(tremble(time + delay))
            foreseen.append(angle_between(predictor.at(time).camera, true) ** 2)
            unforeseen.append(angle_between(orbiting(tremble(time)), true) ** 2)

    assert sum(foreseen) < sum(unforeseen)


def test_alternating_inputs_are_never_overshot_by_more_than_their_own_step() -> None:
    """Worst case: left, right, left, ... exactly one refresh apart. Foresight would double the error; trust dies."""
    step, predictor, off = 0.1, Predictor(REFRESH_S), []
    for k in range(60):
        newest = event(k, k * REFRESH_S, sliding(step * (k % 2)))
        predictor.take(newest)
        off.append(abs(predictor.at(k * REFRESH_S).camera.position[0] - newest.camera.position[0]))

    assert max(off) <= step * (1 + 1e-9)
    assert predictor.at(59 * REFRESH_S) is newest, "no trust is left, so there is nothing to move"


def test_cut_is_not_foreseen_to_go_on() -> None:
    predictor = heard(lambda t: sliding(0.5 * t), ticks(0.2), delay=REFRESH_S)
    there = sliding(40.0)
    predictor.take(event(25, 0.2 + TICK_S, there))

    assert predictor.at(0.2 + TICK_S) == event(25, 0.2 + TICK_S, there)


def test_cut_after_a_rest_is_not_foreseen_to_go_on() -> None:
    predictor = heard(lambda t: sliding(0.5 * t), ticks(0.2), delay=REFRESH_S)
    predictor.take(event(25, 0.9, sliding(1.0)))
    assert predictor.at(0.9).camera == sliding(1.0)

    predictor.take(event(26, 0.9 + TICK_S, sliding(1.01)))
    assert predictor.at(0.9 + TICK_S).camera == sliding(1.01), "two places are no motion yet"


def test_motion_after_a_cut_is_foreseen_again() -> None:
    path: Callable[[float], Camera] = lambda t: sliding(0.5 * t + 40.0 * (t > 0.2))  # noqa: E731
    predictor = heard(path, ticks(0.4), delay=REFRESH_S)

    assert predictor.at(ticks(0.4)[-1]).camera.position[0] == pytest.approx(40.2 + 0.5 * REFRESH_S, abs=1e-4)


def test_growth_just_below_a_cut_is_a_motion() -> None:
    times = ticks(3 * TICK_S)
    places = [0.0, 1e-3, 2e-3, 2e-3 + 0.99 * JUMP * 1e-3]
    predictor = Predictor(REFRESH_S)
    for k, (time, x) in enumerate(zip(times, places, strict=True)):
        predictor.take(event(k, time, sliding(x)))

    assert predictor.at(times[-1]).camera.position[0] > places[-1]


def test_scene_runs_on_exactly_while_events_move_it() -> None:
    predictor = Predictor(REFRESH_S)
    for k in range(3):
        predictor.take(event(0, k * TICK_S, sliding(0.0), scene_event=k, scene_time=5.0 + k * TICK_S))
    now = 2 * TICK_S + 0.003

    found = predictor.at(now)

    assert found.scene_time == pytest.approx(5.0 + now + REFRESH_S, abs=1e-12)
    assert found.camera == sliding(0.0)
    assert predictor.at(99.0).scene_time == pytest.approx(5.0 + 2 * TICK_S + LONGEST_S), "not for ever"


def test_pause_gives_the_very_event_at_once_and_the_end_of_it_starts_anew() -> None:
    predictor = Predictor(REFRESH_S)
    moving = [event(k, k * TICK_S, orbiting(k * 0.01), scene_event=k, scene_time=k * TICK_S) for k in range(20)]
    for one in moving:
        predictor.take(one)
    assert predictor.at(19 * TICK_S).number < (0, 0)

    paused = replace(moving[-1], paused=True)
    predictor.take(paused)
    assert predictor.at(19 * TICK_S) is paused

    resumed = replace(moving[-1], camera_event=21, scene_event=21, input_time=9.0)
    predictor.take(resumed)
    assert predictor.at(9.0) is resumed


def test_hand_is_foreseen_while_the_scene_is_paused() -> None:
    predictor = Predictor(REFRESH_S)
    for k in range(10):
        predictor.take(event(k, k * TICK_S, sliding(0.01 * k), paused=True, scene_time=3.0))

    found = predictor.at(9 * TICK_S)

    assert found.camera.position[0] == pytest.approx(0.09 + 0.02, abs=1e-9)
    assert found.scene_time == 3.0


def test_events_that_are_said_again_change_nothing() -> None:
    once = heard(lambda t: orbiting(1.2 * t), ticks(0.1), delay=REFRESH_S)
    twice = heard(lambda t: orbiting(1.2 * t), ticks(0.1), delay=REFRESH_S)
    twice.take(event(12, ticks(0.1)[-1], orbiting(1.2 * ticks(0.1)[-1])))

    assert twice.at(0.101).camera == once.at(0.101).camera


def test_inputs_at_one_instant_count_as_their_last() -> None:
    predictor = heard(lambda t: sliding(0.5 * t), ticks(0.2), delay=REFRESH_S)
    for k in range(5):
        predictor.take(event(30 + k, 0.2 + TICK_S, sliding(0.5 * (0.2 + TICK_S) + 1e-4 * (k - 4))))

    found = predictor.at(0.2 + TICK_S).camera.position[0]

    assert found == pytest.approx(0.5 * (0.2 + TICK_S + REFRESH_S), abs=1e-4)


def test_many_inputs_a_second_are_as_good_as_few() -> None:
    often = heard(lambda t: sliding(0.5 * t), ticks(0.2, every=SPACING_S / 8), delay=REFRESH_S)

    assert often.at(0.2).camera.position[0] == pytest.approx(0.5 * (0.2 + REFRESH_S), abs=1e-9)


@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_camera_that_is_no_place_is_passed_on_and_spoils_nothing(bad: float) -> None:
    predictor = heard(lambda t: sliding(0.5 * t), ticks(0.2), delay=REFRESH_S)
    lost = event(30, 0.21, replace(sliding(0.0), position=(bad, 0.0, 0.0)))
    predictor.take(lost)
    assert predictor.at(0.21) is lost

    for k in range(4):
        predictor.take(event(31 + k, 0.22 + k * TICK_S, sliding(0.1 * k)))
    assert predictor.at(0.22 + 3 * TICK_S).camera.position[0] == pytest.approx(0.3 + 0.2)


@pytest.mark.parametrize("now", [math.nan, math.inf, -math.inf])
def test_time_that_is_none_foresees_nothing(now: float) -> None:
    predictor = heard(lambda t: sliding(0.5 * t), ticks(0.2), delay=REFRESH_S)

    assert predictor.at(now).number == (24, 0)


def test_clock_that_goes_back_starts_anew() -> None:
    predictor = heard(lambda t: sliding(0.5 * t), ticks(0.2), delay=REFRESH_S)
    earlier = event(30, 0.1, sliding(3.0))
    predictor.take(earlier)

    assert predictor.at(0.1) is earlier


def test_images_that_differ_have_numbers_that_differ() -> None:
    predictor = heard(lambda t: orbiting(1.2 * t), ticks(0.5), delay=REFRESH_S)

    first, second, again = predictor.at(0.502), predictor.at(0.505), predictor.at(0.505)

    assert first.camera != second.camera
    assert first.number != second.number
    assert (again.camera == second.camera) == (again.number == second.number)
    assert max(first.number, second.number) < (0, 0), "no real event has such a number"


def test_without_prediction_the_newest_event_is_shown() -> None:
    predictor = Predictor(REFRESH_S, on=False)
    newest = event(0, 0.0, sliding(0.0))
    for k in range(10):
        newest = event(k, k * TICK_S, sliding(0.01 * k), scene_event=k, scene_time=k * TICK_S)
        predictor.take(newest)

    assert predictor.at(10 * TICK_S) is newest


def test_nothing_can_be_foreseen_from_nothing() -> None:
    with pytest.raises(ValueError, match="no event was taken yet"):
        Predictor(REFRESH_S).at(0.0)
