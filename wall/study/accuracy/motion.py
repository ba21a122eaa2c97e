"""Very many steering increments, very long paths, clocks that jump, very many moving objects."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from wall.config.scene import KeyframeConfig, KeyframesConfig
from wall.config.views import OrbitPathConfig
from wall.core.data import STILL, Camera, Event, Float64
from wall.geometry.cameras import View, look_at
from wall.geometry.prediction import LONGEST_S, Predictor
from wall.geometry.steering import Steering
from wall.scene.animation import Moving, compile_tracks
from wall.study.accuracy.case import Case, Found
from wall.study.accuracy.scenes import (
    directions,
    instance,
    quad,
    scene_of,
    traced_image,
    view,
    with_every_feature,
)

HOUR_S, DAY_S = 3600.0, 86_400.0
ARRIVED_S = 0.625  # of the scene's time; exact in float64
SQUARE = 1.6  # units times columns: the edge of a moving object, where a pixel has 4.2
START = look_at((3.0, 2.0, 5.0), (0.0, 0.5, 0.0), (0.0, 1.0, 0.0))


def orthonormal_error(camera: Camera) -> float:
    """How far a camera's rotation is from one: the largest element of R R^T - 1, and its determinant's error."""
    rotation = camera.rotation()
    return max(float(np.abs(rotation @ rotation.T - np.eye(3)).max()), abs(float(np.linalg.det(rotation)) - 1.0))


def steered(increments: int) -> Found:
    """How far a camera is from where it began, over its distance, after so many increments that cancel out."""
    random = np.random.default_rng(15)
    begin = held = Steering.from_camera(START, (0.0, 0.5, 0.0))
    worst = 0.0
    for _ in range(increments // 8):
        x, y, factor = random.uniform(-0.02, 0.02), random.uniform(-0.02, 0.02), random.uniform(0.9, 1.1)
        held = held.orbit(x, 0.0).pan(x, y).zoom(factor).orbit(0.25 * x, 0.0)
        held = held.orbit(-0.25 * x, 0.0).zoom(1.0 / factor).pan(-x, -y).orbit(-x, 0.0)
    worst = max(worst, orthonormal_error(held.camera()))
    away = np.linalg.norm(held.camera().origin() - begin.camera().origin()) / begin.distance
    return Found(figure=float(away), note=f"rotation off by {worst:.2g}")


def closed_orbit(increments: int) -> Found:
    """How far a camera is from where it began, over its distance, after 1,000 turns in so many increments."""
    begin = held = Steering.from_camera(START, (0.0, 0.5, 0.0))
    step = 2.0 * 1000 / increments  # wall heights: a whole turn is 2
    for _ in range(increments):
        held = held.orbit(step, 0.0)
    away = np.linalg.norm(held.camera().origin() - begin.camera().origin()) / begin.distance
    return Found(figure=float(away), note=f"rotation off by {orthonormal_error(held.camera()):.2g}")


def rotations(cameras: int) -> Found:
    """How far from a rotation the matrix of a steered camera is, at worst."""
    random, worst = np.random.default_rng(15), 0.0
    held = Steering.from_camera(START, (0.0, 0.5, 0.0))
    for _ in range(cameras):
        held = held.orbit(random.uniform(-10.0, 10.0), random.uniform(-10.0, 10.0)).pan(*random.uniform(-9.0, 9.0, 2))
        held = held.zoom(random.uniform(0.1, 10.0))
        worst = max(worst, orthonormal_error(held.camera()))
    return Found(figure=worst)


def orbit_after_30_days(moments: int) -> Found:
    """How far an orbit of 20 s is from that of the first turn after 30 days, over its radius."""
    path = OrbitPathConfig(type="orbit", period_s=20.0)
    view = View(
        id="main", eye=np.array([0.0, 0.0, 1.0]), refresh_hz=60.0, target=np.array([0.0, 0.5, 0.0]),
        up=np.array([0.0, 1.0, 0.0]), spread=0.8, still=START, path=path, predicted=False, display_delay_s=0.0,
        eye_separation=0.0, scale=1.0,
    )  # fmt: skip
    worst, turned = 0.0, 0.0
    for time in np.linspace(0.0, 20.0, moments):
        now, then = view.camera_at(float(time)), view.camera_at(float(time) + 30 * DAY_S)
        worst = max(worst, float(np.linalg.norm(now.origin() - then.origin())) / 5.0)
        turned = max(turned, orthonormal_error(then))
    return Found(figure=worst, note=f"rotation off by {turned:.2g}")


def clock_steps(refreshes: int) -> Found:
    """Largest step of a predicted camera, units, while inputs' times jump by an hour either way; inputs move 0.01."""
    worst, last = 0.0, None
    predictor = Predictor(1.0 / 60.0)
    for k in range(refreshes):
        jump = HOUR_S * (((k // 50) % 3) - 1)
        now = 10 * HOUR_S + k / 60.0 + jump
        camera = replace(STILL, position=(0.01 * k, 0.0, 0.0))
        event = Event(view=0, camera_event=k, scene_event=0, scene_time=0.0, input_time=now, camera=camera)
        predictor.take(event)
        seen = predictor.at(now).camera
        if not all(map(math.isfinite, (*seen.position, *seen.world_from_wall))):
            return Found(figure=math.nan, note=f"refresh {k} is not finite")
        if last is not None:
            worst = max(worst, abs(seen.position[0] - last))
        last = seen.position[0]
    return Found(figure=worst)


def moving_objects(columns: int) -> Found:
    """How many of 25/32 columns^2 objects are not seen where they are, after each came along a way of its own.

    Squares start anywhere in a cube and fly, each at its own velocity, to the middle of their own pixel: object k is
    what pixel k shows, at a distance that is known in float64.
    """
    seen = view((0.0, 0.0, 4.0), (0.0, 0.0, 0.0), pixels=(columns, 25 * columns // 32))
    seen = replace(seen, event=replace(seen.event, scene_time=ARRIVED_S))
    eye, rays = np.array(seen.event.camera.position), directions(seen)
    ends = (eye - rays * (eye[2] / rays[..., 2:])).reshape(-1, 3)
    starts = np.random.default_rng(20).uniform(-50.0, 50.0, ends.shape)
    keys = [_way(*both) for both in zip(starts, starts + (ends - starts) / ARRIVED_S, strict=True)]
    squares = [instance(0, at=(x, y, z)) for x, y, z in starts.tolist()]
    scene = with_every_feature(scene_of([quad(SQUARE / columns, SQUARE / columns)], squares))
    moving = [Moving(body=k, motion=way, center=way.keyframes[0].position) for k, way in enumerate(keys)]
    image = traced_image(replace(scene, tracks=compile_tracks(moving)), seen)
    wrong = int((image.objects.ravel() != np.arange(len(ends)) + 1).sum())
    error = np.abs(image.depth.ravel() / np.linalg.norm(ends - eye, axis=1) - 1.0).max()
    return Found(figure=wrong, note=f"of {len(ends):,}; distances off by {error:.2g} of themselves at most")


def _way(start: Float64, end: Float64) -> KeyframesConfig:
    """Straight on from one position to another in a second."""
    keys = tuple(KeyframeConfig(time=k, position=tuple(at.tolist())) for k, at in enumerate((start, end)))
    return KeyframesConfig(type="keyframes", object="*", keyframes=keys)


_FAMILY = "Motion"
CASES = (
    Case(
        name="steering_to_and_fro", family=_FAMILY, unit="of the distance", bound=1e-9,
        reason="each of 10^6 increments rounds an angle, a distance or a target in float64: 10^6 x 2^-53 x 9",
        scene="A camera steered by 100,000 increments (--long: 1,000,000), each undone",
        measure=steered, size=100_000, small=800, long=1_000_000,
    ),
    Case(
        name="closed_orbit", family=_FAMILY, unit="of the distance", bound=1e-9,
        reason="each increment rounds the azimuth, at most pi, to 2^-53 of it: 10^6 times 3.5e-16 all the same way",
        scene="A thousand turns about the target by 1,000,000 increments", measure=closed_orbit, size=1_000_000,
        small=2_000,
    ),
    Case(
        name="rotations", family=_FAMILY, unit="of an element", bound=16 * 2.0**-53,
        reason="the matrix is made of the angles anew each time: some 16 roundings of float64, which do not add up",
        scene="The matrices of cameras steered far", measure=rotations, size=4_000, small=100,
    ),
    Case(
        name="orbit_after_30_days", family=_FAMILY, unit="of the radius", bound=1e-9,
        reason="2.6e6 s step by 4.7e-10 s in float64, of a turn in 20 s: 2.4e-10 of a turn's angle, 1.5e-10 rad",
        scene="An orbit's camera in its first turn, and 30 days later", measure=orbit_after_30_days, size=4_000,
        small=200,
    ),
    Case(
        name="clock_steps", family=_FAMILY, unit="units", bound=0.01 * 60 * LONGEST_S,
        reason="nothing is foreseen for longer than 0.1 s: at 0.6 units a second a jump of the clock shows 0.06 units",
        scene="A camera at constant speed whose inputs' times jump by an hour either way every 50 refreshes",
        measure=clock_steps, size=3_000, small=160,
    ),
    Case(
        name="moving_objects", family=_FAMILY, unit="objects", bound=0.0,
        reason="poses are float64, and a square is a third of a pixel wide, thousands of times what its place is "
        "rounded by",
        scene="4,960 objects that all move (--long: 20,000), each by itself into its own pixel",
        measure=moving_objects, size=80, small=80, long=160,
    ),
)  # fmt: skip
