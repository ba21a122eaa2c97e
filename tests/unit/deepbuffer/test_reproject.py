"""A hit, stored as a float32 point of its object, comes back to its pixel and goes where float64 says it goes."""

from __future__ import annotations

import math

import numpy as np
import pytest
from small_scenes import Triple, View, flat_wall, instance, quad, scene_of, turned, view

from wall.core.data import Camera, Float64
from wall.deepbuffer.kernels.reproject import FAR, OUTSIDE
from wall.deepbuffer.pose import Pose
from wall.geometry.cameras import default_eye, look_at
from wall.geometry.frusta import project, ray_frame
from wall.geometry.panels import Panel
from wall.scene.model import Instance
from wall.study.accuracy.reprojection import there

EPSILON = 2.0**-24  # float32's rounding
# pixels: eye to object is about as far as eye to hit and the focal length is 630 pixels, so 8 roundings add up to 3e-4;
# measured: 1.2e-4 under its own event, 1.0e-4 under another
BACK_PIXEL, THERE_PIXEL = 3e-4, 3e-4
SIZE = (480, 270)
VIEW = view((0.0, 1.0, 6.0), (0.0, 0.0, 0.0), pixels=SIZE, fov=24.2)  # focal length 270 / (2 tan 12.1) = 630 pixels
FAR_AWAY: Triple = (1e6, -2e6, 1.5e6)
ORIGIN: Triple = (0.0, 0.0, 0.0)


def pose(matrix: Float64 | None, camera: Camera, seen: View = VIEW, panel: Panel | None = None) -> Pose:
    """Of a scene of one object; None: at the origin."""
    placed = instance(0) if matrix is None else Instance(name="it", mesh=0, world_from_object=matrix)
    return Pose.at(panel or seen.panel, seen.eye, scene_of([quad(1.0, 1.0)], [placed]), camera, 0.0)


def test_a_pixels_edge_over_its_distance_is_that_of_the_focal_length() -> None:
    assert math.isclose(pose(None, VIEW.event.camera).pixel, 2 * math.tan(math.radians(24.2 / 2)) / SIZE[1])


def moved(matrix: Float64, by: Triple) -> Float64:
    matrix = matrix.copy()
    matrix[:3, 3] += by
    return matrix


def some_hits(n: int, nearest: float, farthest: float) -> Float64:
    """(n, 3): positions all over the panel in float32 as in SAMPLE, and depths."""
    random = np.random.default_rng(7)
    hits = random.uniform((0, 0, nearest), (*SIZE, farthest), (n, 3)).astype(np.float32)
    return hits.astype(np.float64)


def twin(hits: Float64, was: Float64, before: Camera, now: Float64, after: Camera) -> Float64:
    """(n, 2): the same in float64, through geometry.frusta."""
    frame = ray_frame(VIEW.panel, VIEW.eye, before)
    rays = frame[0] + (hits[:, :2] + VIEW.panel.screen) @ frame[1:]
    rays *= hits[:, 2:] / np.linalg.norm(rays, axis=1, keepdims=True)
    # relative to both origins: at 1e6 units the world coordinates themselves would step by 1e-10
    local = np.linalg.solve(was[:3, :3], (rays + (before.origin() - was[:3, 3])).T)
    world = (now[:3, :3] @ local).T + now[:3, 3]
    return project(VIEW.panel, VIEW.eye, after, world)[0]


OBJECTS = {
    "plain": instance(0, at=(0.3, -0.2, 0.5)).world_from_object,
    "turned": instance(0, at=(0.3, -0.2, 0.5), turn=("z", 33.0), scale=0.7).world_from_object,
    "tiny": instance(0, at=(0.3, -0.2, 0.5), turn=("x", 71.0), scale=1e-5).world_from_object,
    "huge": instance(0, at=(0.3, -0.2, 0.5), turn=("x", 71.0), scale=1e5).world_from_object,
    "uneven": instance(0, at=(0.3, -0.2, 0.5), turn=("y", 33.0), scale=(1e-3, 1.0, 40.0)).world_from_object,
    "mirrored": instance(0, at=(0.3, -0.2, 0.5), turn=("y", 33.0), scale=(-1.0, 1.0, 2.0)).world_from_object,
}


@pytest.mark.parametrize("away", [ORIGIN, FAR_AWAY])
@pytest.mark.parametrize("name", OBJECTS)
def test_under_its_own_event_a_hit_comes_back_to_where_it_was_traced(name: str, away: Triple) -> None:
    camera = look_at(tuple(np.add((0.0, 1.0, 6.0), away)), away, (0, 1, 0))
    hits = some_hits(200, 3.0, 9.0)
    traced = pose(moved(OBJECTS[name], away), camera)

    found = there(hits, traced, traced)

    np.testing.assert_allclose(found[:, :2], hits[:, :2], rtol=0, atol=BACK_PIXEL)


@pytest.mark.parametrize("away", [ORIGIN, FAR_AWAY])
@pytest.mark.parametrize("name", OBJECTS)
def test_after_camera_and_object_moved_a_hit_is_where_float64_puts_it(name: str, away: Triple) -> None:
    before = look_at(tuple(np.add((0.0, 1.0, 6.0), away)), away, (0, 1, 0))
    after = look_at(tuple(np.add((0.8, 1.4, 5.5), away)), tuple(np.add((0.1, 0.0, 0.0), away)), (0.05, 1, 0))
    was, rigid = moved(OBJECTS[name], away), np.eye(4)
    rigid[:3, :3] = turned("y", 8.0) @ turned("x", -5.0)
    now = was.copy()
    now[:3, :3] = rigid[:3, :3] @ was[:3, :3]
    now[:3, 3] += (0.1, -0.05, 0.2)
    hits = some_hits(200, 5.0, 7.5)

    found = there(hits, pose(was, before), pose(now, after))

    expected = twin(hits, was, before, now, after)
    assert np.hypot(*(expected - hits[:, :2]).T).min() > 2.0, "nothing moved"
    np.testing.assert_allclose(found[:, :2], expected, rtol=0, atol=THERE_PIXEL)


@pytest.mark.parametrize("near", [1.0, 0.1, 0.01])
def test_near_the_eye_on_a_distant_object_the_error_grows_no_faster_than_their_ratio(near: float) -> None:
    """A point of an object whose origin is d away is rounded to d * EPSILON and seen from `near` away; a few such
    roundings add up (measured: 2.6)."""
    distance, focal = 600.0, 630.0
    camera = look_at((0.0, 0.0, 0.0), (0.0, 0.0, -1.0), (0, 1, 0))
    traced = pose(instance(0, at=(0.0, -distance, 0.0), turn=("x", 30.0)).world_from_object, camera)
    hits = some_hits(200, near, 1.5 * near)

    found = there(hits, traced, traced)

    worst = np.abs(found[:, :2] - hits[:, :2]).max()
    assert worst < 6 * EPSILON * focal * (1.0 + distance / near)
    assert worst > EPSILON * focal * distance / near / 2, "the bound says nothing here"


def test_a_sky_ray_depends_on_where_the_camera_looks_and_not_on_where_it_stands() -> None:
    before = look_at((0.0, 1.0, 6.0), (0.0, 0.0, 0.0), (0, 1, 0))
    after = look_at((1e6, 1.0, 6.0), (1e6, 0.0, 0.0), (0, 1, 0))
    hits = some_hits(100, 1.0, 2.0)
    hits[:, 2] = np.inf

    found = there(hits, pose(None, before), pose(None, after), object_id=0)

    np.testing.assert_allclose(found[:, :2], hits[:, :2], rtol=0, atol=BACK_PIXEL)
    assert (found[:, 2] == FAR).all()


def test_after_the_camera_turned_a_sky_ray_is_where_an_infinitely_far_point_is() -> None:
    before = look_at((0.0, 1.0, 6.0), (0.0, 0.0, 0.0), (0, 1, 0))
    after = look_at((0.0, 1.0, 6.0), (0.5, 0.1, 0.0), (0, 1, 0))
    hits = some_hits(100, 1.0, 2.0)
    hits[:, 2] = np.inf

    found = there(hits, pose(None, before), pose(None, after), object_id=0)

    hits[:, 2] = 1e12  # the camera's height of 1 is 1e-12 of that
    expected = twin(hits, np.eye(4), before, np.eye(4), after)
    np.testing.assert_allclose(found[:, :2], expected, rtol=0, atol=THERE_PIXEL)


def test_depth_is_the_distance_along_the_panels_axis() -> None:
    """In units of the eye's distance from the panel: a hit at distance d in direction r is d r_z / (|r| eye_z) deep."""
    camera = look_at((3.0, 1.0, 6.0), (0.0, 0.0, 0.0), (0, 1, 0))
    hits = some_hits(50, 3.0, 9.0)
    traced = pose(OBJECTS["turned"], camera)

    found = there(hits, traced, traced)

    focal = 270 / 2 / math.tan(math.radians(24.2 / 2))
    away = np.hypot(hits[:, 0] - SIZE[0] / 2, hits[:, 1] - SIZE[1] / 2)
    metres = np.linalg.norm(VIEW.eye)  # its panel is straight before it
    np.testing.assert_allclose(found[:, 2], hits[:, 2] / np.hypot(1.0, away / focal) / metres, rtol=1e-5)


def test_what_was_seen_at_a_grazing_angle_lands_where_float64_puts_it_when_seen_from_above() -> None:
    """A floor seen from 0.5 degrees, then from 40: an error along the ray, harmless before, would show now.

    Depth is given to EPSILON of itself; from 40 degrees an error of 9 * EPSILON along the floor is below 1e-4 pixels.
    """
    eye_height = 9.0 * math.sin(math.radians(0.5))
    before = look_at((0.0, eye_height, 9.0), (0.0, 0.0, 0.0), (0, 1, 0))
    after = look_at((0.0, 5.8, 6.9), (0.0, 0.0, 0.0), (0, 1, 0))
    floor = instance(0, turn=("x", -90.0)).world_from_object
    frame = ray_frame(VIEW.panel, VIEW.eye, before)
    x, y = np.random.default_rng(3).uniform((10, 136), (470, 140), (100, 2)).astype(np.float32).astype(float).T
    rays = frame[0] + np.outer(x, frame[1]) + np.outer(y, frame[2])
    hits = np.stack([x, y, np.float32(eye_height / -rays[:, 1] * np.linalg.norm(rays, axis=1))], axis=1)

    found = there(hits, pose(floor, before), pose(floor, after))

    np.testing.assert_allclose(found[:, :2], twin(hits, floor, before, floor, after), rtol=0, atol=THERE_PIXEL)


def test_what_has_come_behind_the_eye_is_outside() -> None:
    before = look_at((0.0, 0.0, 6.0), (0.0, 0.0, 0.0), (0, 1, 0))
    past = look_at((0.0, 0.0, -20.0), (0.0, 0.0, -40.0), (0, 1, 0))
    hits = some_hits(50, 3.0, 9.0)

    found = there(hits, pose(np.eye(4), before), pose(np.eye(4), past))

    assert (found[:, 2] == OUTSIDE).all()


@pytest.mark.parametrize("depth", [np.nan, -1.0])
@pytest.mark.parametrize("name", ["plain", "uneven"])
def test_a_depth_that_is_no_depth_is_outside(name: str, depth: float) -> None:
    traced = pose(OBJECTS[name], VIEW.event.camera)
    assert there(np.array([[100.0, 100.0, depth]]), traced, traced)[0, 2] == OUTSIDE


def test_a_hit_at_the_eye_itself_is_finite_wherever_it_falls() -> None:
    hits = some_hits(100, 3.0, 9.0) * (1, 1, 0)
    for matrix in OBJECTS.values():
        traced = pose(matrix, VIEW.event.camera)
        found = there(hits, traced, traced)
        assert np.isfinite(found[found[:, 2] > 0]).all()
        assert (found[:, 2] < 1e-5).all(), "at the eye, but for rounding"


@pytest.mark.parametrize("squashed", [0, 1, 2])
def test_an_object_squashed_to_nothing_gives_finite_tables_and_no_nan_inside(squashed: int) -> None:
    matrix = OBJECTS["turned"].copy()
    matrix[:, squashed] = 0.0
    flat = pose(matrix, VIEW.event.camera)
    assert np.isfinite(flat.object_from_eye).all()
    assert np.isfinite(flat.panel_from_object).all()
    found = there(some_hits(50, 3.0, 9.0), flat, flat)
    assert np.isfinite(found[found[:, 2] > 0]).all()


def test_of_a_panel_of_a_larger_wall_positions_are_its_own_pixels() -> None:
    wall = flat_wall(3, 2, (160, 90))
    eye = default_eye(wall, 40.0)
    panel = wall.panels[4]
    traced = pose(OBJECTS["turned"], VIEW.event.camera, View(wall=wall, eye=eye, event=VIEW.event), panel)
    hits = some_hits(50, 3.0, 9.0) * (1 / 3, 1 / 3, 1.0)

    found = there(hits, traced, traced)

    assert panel.screen == (160, 90)
    np.testing.assert_allclose(found[:, :2], hits[:, :2], rtol=0, atol=BACK_PIXEL)
