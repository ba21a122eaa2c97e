"""Stored samples go where their rows' moments have them, within the stated bound of a straight path."""

from __future__ import annotations

import math

import numpy as np
import pytest
from small_scenes import instance, quad, scene_of, view

from wall.core.data import Camera, Float64
from wall.deepbuffer.kernels.reproject import FAR, OUTSIDE, pixel_of, reproject
from wall.deepbuffer.kernels.reproject_rows import RowTables, pixel_in, reproject_rows
from wall.deepbuffer.pose import Pose
from wall.deepbuffer.store import SampleStore
from wall.geometry.frusta import project
from wall.geometry.twist import moved

SIZE = (320, 240)
VIEW = view((0.0, 0.0, 4.0), (0.0, 0.0, 0.0), pixels=SIZE, fov=60.0)
FOCUS = SIZE[1] / 2 / math.tan(math.radians(30.0))  # pixels
SCENE = scene_of([quad(1.0, 1.0)], [instance(0)])
DOWN = np.array([0.0, 0.0, 1.0 / SIZE[1]], np.float32)
ROUNDING = 2e-3  # pixels: float32 matrices of two poses, see test_reproject


def table(camera: Camera) -> np.ndarray:
    return Pose.at(VIEW.panel, VIEW.eye, SCENE, camera, 0.0).panel_from_object


def points(n: int = 4000) -> Float64:
    """(n, 3) float32 values, in and around what the panel shows."""
    return np.random.default_rng(5).uniform((-4, -3, -3), (4, 3, 1.5), (n, 3)).astype(np.float32).astype(np.float64)


def store_of(positions: Float64, object_id: int) -> SampleStore:
    store = SampleStore.of(len(positions), lit=False)
    store.position[:] = positions.T
    store.object_id[:] = object_id
    return store


def solved(positions: Float64, twist: Float64) -> Float64:
    """(n, 2): where a point is at the moment of the row in which it is then: the true motion, in float64."""
    found = np.full((len(positions), 2), np.nan)
    for k, point in enumerate(positions):
        share = 0.5
        for _ in range(8):
            camera = moved(VIEW.event.camera, share * twist)
            (pixel,), (depth,) = project(VIEW.panel, VIEW.eye, camera, point[None])
            share = min(max(pixel[1] / SIZE[1], 0.0), 1.0)
        if depth > 0.0:
            found[k] = pixel
    return found


def shown(positions: Float64, twist: Float64, *, object_id: int = 1) -> Float64:
    """(n, 3) screen positions by the kernel."""
    first, last = table(VIEW.event.camera), table(moved(VIEW.event.camera, twist))
    store, everything = store_of(positions, object_id), np.ones(2, np.uint8)
    size = np.float32(SIZE[0]), np.float32(SIZE[1])
    reproject_rows(store, len(positions), first, RowTables(last, DOWN), everything, *size)
    return store.screen_position.T.astype(np.float64)


@pytest.mark.parametrize("degrees", [0.5, 2.0, 8.0])
def test_a_turning_camera_keeps_the_bound_and_nearly_reaches_it(compiled_only: None, degrees: float) -> None:
    """x = f tan(a): its acceleration is 2 f tan(a) (1 + tan(a)^2) per squared radian, most at the sides.

    So the error is at most an eighth of that times the squared turn. At the sides it is near that in the middle row.
    """
    turn = math.radians(degrees)
    positions = points(400)

    found, wanted = (
        shown(positions, np.array([0.0, turn, 0.0, 0.0, 0.0, 0.0])),
        solved(positions, np.array([0.0, turn, 0.0, 0.0, 0.0, 0.0])),
    )

    inside = (found[:, 2] > 0.0) & np.isfinite(wanted).all(axis=1)
    off = np.hypot(*(found[inside, :2] - wanted[inside]).T)
    side = SIZE[0] / 2 / FOCUS
    at_corner = math.hypot(1.0, 0.75)  # y moves too, at most by as much
    bound = FOCUS / 8 * 2 * side * (1 + side**2) * (turn * 1.05) ** 2 * at_corner
    assert inside.sum() > 80
    assert off.max() <= bound + ROUNDING
    if degrees == 8.0:
        assert off.max() >= 0.4 * bound


def test_one_moment_for_all_rows_would_be_off_by_the_motion(compiled_only: None) -> None:
    positions, twist = points(300), np.array([0.0, math.radians(2.0), 0.0, 0.0, 0.0, 0.0])
    found, still = shown(positions, twist), shown(positions, np.zeros(6))
    inside = (found[:, 2] > 0.0) & (still[:, 2] > 0.0) & (found[:, 1] > 0.9 * SIZE[1])

    assert np.abs(found[inside, 0] - still[inside, 0]).min() > 0.85 * FOCUS * math.radians(2.0)


def test_a_camera_at_rest_leaves_the_bits_of_the_plain_projection(compiled_only: None) -> None:
    positions = points()
    first, everything = table(VIEW.event.camera), np.ones(2, np.uint8)
    plain = store_of(positions, 1)
    reproject(plain, 0, len(positions), first, everything, np.float32(SIZE[0]), np.float32(SIZE[1]))

    found = shown(positions, np.zeros(6))

    same = plain.screen_position.T
    assert ((found[:, 2] == OUTSIDE) == (same[:, 2] == OUTSIDE)).all()
    inside = same[:, 2] > 0.0
    assert np.abs(found[inside] - same[inside]).max() <= 2e-4  # sums in another order


def test_the_sky_is_far_and_what_is_behind_at_either_moment_is_outside(compiled_only: None) -> None:
    directions = np.array([[0.1, 0.1, -1.0], [0.0, 0.0, 1.0], [10.0, 0.0, -0.1]])
    found = shown(directions, np.array([0.0, math.radians(3.0), 0.0, 0.0, 0.0, 0.0]), object_id=0)

    assert found[0, 2] == FAR
    assert (found[1:, 2] == OUTSIDE).all()


def test_a_new_sample_lands_where_stored_ones_are_brought() -> None:
    twist = np.array([0.01, 0.02, -0.01, 0.05, 0.02, 0.1])
    first, last = table(VIEW.event.camera), table(moved(VIEW.event.camera, twist))
    positions = points(60)
    brought = shown(positions, twist)

    for point, (x, y, depth) in zip(positions.astype(np.float32), brought, strict=True):
        landed = pixel_in(*point, 1, first, RowTables(last, DOWN))
        if depth > 0.0:
            assert landed == pytest.approx((x, y, depth), abs=ROUNDING)
        assert pixel_in(*point, 1, first, None) == pixel_of(*point, 1, first)
