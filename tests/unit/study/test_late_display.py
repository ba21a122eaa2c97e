"""A late display shows what a prompt one showed; made for the moment when it is seen, it is nearly prompt."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from wall.core.data import STILL, Camera, Event, Float32
from wall.study.quality.method import Setup
from wall.study.quality.methods import make_method
from wall.study.quality.methods_adaptive import Late, LateDisplay
from wall.study.quality.metrics import display_values
from wall.study.quality.reference import Reference
from wall.study.quality.trial import Trial, setup_of

REFRESH_HZ, REFRESHES = 60.0, 16
SCENE = """\
version: 1
scene: {source: gallery}
wall: {grid: {columns: 1, rows: 1, pixels: [64, 64], size: [0.3, 0.3]}}
views: [{camera: {position: [2.6, 3, 7.1], target: [0, 0.6, -0.3], fov: 45}, path: {type: orbit, period_s: 5}}]
"""


@pytest.fixture(scope="module")
def orbit(tmp_path_factory: pytest.TempPathFactory) -> Setup:
    path = tmp_path_factory.mktemp("late") / "orbit.yaml"
    path.write_text(SCENE)
    return setup_of(Trial(config=path, method="adaptive", rate=6e4, size=(64, 64), seed=1, refresh_hz=REFRESH_HZ))


def shown(setup: Setup, name: str) -> list[Float32]:
    method, images = make_method(name, setup), []
    for refresh in range(1, REFRESHES + 1):
        method.advance(refresh / REFRESH_HZ)
        images.append(method.show(refresh / REFRESH_HZ).copy())
    return images


@pytest.mark.parametrize(("name", "late"), [("adaptive:delayed", 1), ("adaptive:delayed_2", 2)])
def test_delayed_display_shows_the_same_bits_later(orbit: Setup, compiled_only: None, name: str, late: int) -> None:
    prompt, delayed = shown(orbit, "adaptive"), shown(orbit, name)

    assert not np.array_equal(prompt[-1], prompt[-2])
    for refresh in range(late, REFRESHES):
        assert np.array_equal(delayed[refresh], prompt[refresh - late])


def test_prediction_takes_most_of_the_delays_error_off_a_steady_orbit(
    orbit: Setup, compiled_only: None, tmp_path: Path
) -> None:
    """72 degrees a second; two refreshes are three pixels. What is left is under a third of what the delay costs."""
    reference = Reference(orbit.plan, orbit.tracer_scene, [0.0, REFRESHES / REFRESH_HZ], spp=16, cache=tmp_path)
    reference.make([1])
    reference = display_values(reference.image(1))

    names = ("adaptive", "adaptive:delayed_2", "adaptive:predicted_2")
    prompt, delayed, predicted = (
        float(((display_values(shown(orbit, name)[-1]) - reference) ** 2).mean()) for name in names
    )

    assert predicted - prompt < (delayed - prompt) / 3


def place(x: float) -> Camera:
    return replace(STILL, position=(x, 0.0, 0.0))


def moving(time: float) -> Event:
    return Event(
        view=0, camera_event=round(time * 1e4), scene_event=0, scene_time=0.0, input_time=time, camera=place(time)
    )


def test_rays_and_images_are_for_the_moment_of_display_and_rays_keep_their_number() -> None:
    display = LateDisplay(REFRESH_HZ, Late(refreshes=2, predicted=True, ahead=True))
    for k in range(201):
        traced = display.traced(moving(k / 2000), k / 2000)
    made = display.made(moving(0.1), 0.1)

    assert made.camera.position[0] == pytest.approx(0.1 + 2 / REFRESH_HZ)
    assert made.number < (0, 0)
    assert traced.camera.position[0] == pytest.approx(0.1 + 2 / REFRESH_HZ, abs=0.5 / REFRESH_HZ)
    assert moving(0.09).number <= traced.number <= moving(0.1).number


@pytest.mark.parametrize(("predicted", "ahead"), [(False, True), (True, False)])
def test_without_looking_ahead_rays_are_traced_under_the_newest_inputs(predicted: bool, ahead: bool) -> None:
    display = LateDisplay(REFRESH_HZ, Late(refreshes=1, predicted=predicted, ahead=ahead))
    for k in range(201):
        event = moving(k / 2000)
        assert display.traced(event, k / 2000) is event


def test_prompt_display_foresees_nothing_and_hands_on_what_it_gets() -> None:
    display = LateDisplay(REFRESH_HZ, Late(refreshes=0, predicted=False, ahead=False))
    made = np.full((2, 2, 3), math.pi, np.float32)

    assert display.seen(made) is made
    assert display.made(moving(0.1), 0.1).camera == place(0.1)
