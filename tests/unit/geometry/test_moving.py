"""A moving event is what prediction gives at later moments too, from wherever its eye stands."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from wall.core.data import Camera, Event
from wall.geometry.cameras import look_at, seen_from
from wall.geometry.moving import MovingEvent, later
from wall.geometry.prediction import GONE_S, Predictor

TICK_S, DELAY_S, RATE = 1 / 120, 1 / 60, 1.2  # radians a second
FIRST = Event(view=0, camera_event=0, scene_event=0, scene_time=0.0, input_time=0.0, camera=look_at((0, 0, 7), (0, 0, 0), (0, 1, 0)))  # fmt: skip  # noqa: E501


def orbiting(time: float) -> Camera:
    angle = RATE * time
    return look_at((7 * math.sin(angle), 1.0, 7 * math.cos(angle)), (0.0, 1.0, 0.0), (0, 1, 0))


def heard(*, ticks: int = 60) -> Predictor:
    predictor = Predictor(DELAY_S, moving=True)
    for k in range(ticks):
        time = k * TICK_S
        predictor.take(
            replace(FIRST, camera_event=k, scene_event=k, input_time=time, scene_time=time, camera=orbiting(time))
        )
        predictor.at(time)
    return predictor


def off(a: Camera, b: Camera) -> float:
    return float(max(np.abs(a.origin() - b.origin()).max(), np.abs(a.rotation() - b.rotation()).max()))


def test_a_steady_orbit_is_followed_through_the_scan() -> None:
    now, scan = 59 * TICK_S, 1 / 60
    expected = heard().at(now)

    assert isinstance(expected, MovingEvent)
    last = expected.after(scan)
    assert off(last.camera, orbiting(now + DELAY_S + scan)) < 1e-6
    assert last.scene_time == pytest.approx(now + DELAY_S + scan)
    assert last.number == expected.number


def test_rest_and_an_event_that_nobody_predicted_stay_what_they_are() -> None:
    predictor = heard()
    newest = replace(
        FIRST,
        camera_event=60,
        scene_event=59,
        input_time=60 * TICK_S,
        scene_time=59 * TICK_S,
        camera=orbiting(59 * TICK_S),
    )
    predictor.take(newest)

    assert predictor.at(60 * TICK_S + 2 * GONE_S) is newest
    assert later(newest, 0.01) is newest


def test_an_eye_beside_the_camera_moves_on_as_that_eye() -> None:
    """The eye is fixed to the turning wall: first moved on and then looked from, or the other way round."""
    expected, offset = heard().at(59 * TICK_S), np.array([0.4, -0.2, 0.7])
    assert isinstance(expected, MovingEvent)

    seen = seen_from(expected, offset)

    assert isinstance(seen, MovingEvent)
    assert off(seen.after(0.01).camera, seen_from(expected.after(0.01), offset).camera) < 1e-12
    assert off(replace(seen, twist=expected.twist).after(0.01).camera, seen.after(0.01).camera) > 1e-4
