"""Motion: closed forms of turns, quaternions and loops."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from small_scenes import keyframes

from wall.config.scene import AnimationConfig, KeyframesConfig, OrbitConfig, SpinConfig
from wall.scene.animation import Moving, compile_tracks, quaternion

EXACT = 1e-12  # a few float64 roundings at coordinates near 1


def moved(point: list[float], time: float, *motions: AnimationConfig) -> np.ndarray:
    """Where a point of one body goes; the body's own centre is (1, 2, 3)."""
    tracks = compile_tracks([Moving(body=1, motion=m, center=(1.0, 2.0, 3.0)) for m in motions])
    poses = np.tile(np.eye(4), (3, 1, 1))
    tracks.apply(poses, time)
    np.testing.assert_array_equal(poses[[0, 2]], np.tile(np.eye(4), (2, 1, 1)))  # nobody else moves
    return poses[1] @ [*point, 1.0]


def test_spin_turns_about_own_centre_right_handed() -> None:
    spin = SpinConfig(type="spin", object="*", axis=(0.0, 3.0, 0.0), period_s=8.0)
    np.testing.assert_allclose(moved([2.0, 2.0, 3.0], 2.0, spin)[:3], [1.0, 2.0, 2.0], atol=EXACT)
    np.testing.assert_allclose(moved([1.0, 9.0, 3.0], 2.0, spin)[:3], [1.0, 9.0, 3.0], atol=EXACT)


def test_spin_about_a_given_centre_carries_the_body_round() -> None:
    spin = SpinConfig(type="spin", object="*", axis=(0.0, 0.0, 1.0), period_s=4.0, center=(0.0, 0.0, 0.0))
    np.testing.assert_allclose(moved([1.0, 2.0, 3.0], 1.0, spin)[:3], [-2.0, 1.0, 3.0], atol=EXACT)


def test_orbit_keeps_orientation() -> None:
    orbit = OrbitConfig(type="orbit", object="*", center=(0.0, 2.0, 3.0), axis=(0.0, 1.0, 0.0), period_s=4.0)
    center, beside = moved([1.0, 2.0, 3.0], 1.0, orbit), moved([1.5, 2.0, 3.0], 1.0, orbit)
    np.testing.assert_allclose(center[:3], [0.0, 2.0, 2.0], atol=EXACT)
    np.testing.assert_allclose((beside - center)[:3], [0.5, 0.0, 0.0], atol=EXACT)


def test_a_million_turns_later_everything_is_where_it_was() -> None:
    spin = SpinConfig(type="spin", object="*", axis=(0.3, 1.0, 0.2), period_s=8.0)
    np.testing.assert_array_equal(moved([2.0, 0.0, 1.0], 3.0, spin), moved([2.0, 0.0, 1.0], 3.0 + 8.0e6, spin))


def test_first_motion_is_the_innermost() -> None:
    spin = SpinConfig(type="spin", object="*", axis=(0.0, 1.0, 0.0), period_s=4.0)
    orbit = OrbitConfig(type="orbit", object="*", center=(0.0, 2.0, 3.0), axis=(0.0, 1.0, 0.0), period_s=4.0)
    np.testing.assert_allclose(moved([2.0, 2.0, 3.0], 1.0, spin, orbit)[:3], [0.0, 2.0, 1.0], atol=EXACT)


def test_quaternion_turns_as_rodrigues_does() -> None:
    chance = np.random.default_rng(3)
    for axis, degrees in zip(chance.normal(size=(20, 3)), chance.uniform(-180, 180, 20), strict=True):
        matrix = Rotation.from_quat(quaternion(tuple(axis), degrees), scalar_first=True).as_matrix()
        k, point = axis / np.linalg.norm(axis), chance.normal(size=3)
        angle = math.radians(degrees)
        turned = point * math.cos(angle) + np.cross(k, point) * math.sin(angle)
        turned += k * (k @ point) * (1 - math.cos(angle))
        np.testing.assert_allclose(matrix @ point, turned, atol=EXACT)


def path(*, loop: bool) -> KeyframesConfig:
    return keyframes((0, 0, 0), (2, 0, 0), (2, 4, 0), times=(1.0, 3.0, 4.0), degrees=(0.0, 90.0, 90.0), loop=loop)


@pytest.mark.parametrize(
    ("time", "center", "degrees"),
    [
        (0.0, (0, 0, 0), 0.0),
        (1.0, (0, 0, 0), 0.0),
        (2.0, (1, 0, 0), 45.0),
        (3.5, (2, 2, 0), 90.0),
        (9.0, (2, 4, 0), 90.0),
    ],
)
def test_keyframes_blend_and_hold_at_both_ends(time: float, center: tuple[float, ...], degrees: float) -> None:
    np.testing.assert_allclose(moved([1.0, 2.0, 3.0], time, path(loop=False))[:3], center, atol=EXACT)
    angle = math.radians(degrees)
    off = (moved([2.0, 2.0, 3.0], time, path(loop=False)) - moved([1.0, 2.0, 3.0], time, path(loop=False)))[:3]
    np.testing.assert_allclose(off, [math.cos(angle), 0.0, -math.sin(angle)], atol=EXACT)


def test_looped_keyframes_begin_again_after_the_last() -> None:
    for time in (1.25, 2.5, 3.75):
        once, later = (moved([2.0, 2.0, 3.0], time + 3.0 * round_, path(loop=True)) for round_ in (0, 1000))
        np.testing.assert_allclose(once, later, atol=1e-9)  # time 3000 s has 5e-13 of rounding


@pytest.mark.parametrize("time", [0.0, 1.0, 2.5, 1e5])
def test_a_single_keyframe_stays_whether_it_loops_or_not(time: float) -> None:
    for loop in (False, True):
        still = keyframes((4, 5, 6), times=(1.0,), loop=loop)
        np.testing.assert_allclose(moved([1.0, 2.0, 3.0], time, still)[:3], [4.0, 5.0, 6.0], atol=EXACT)


def test_slerp_takes_the_shorter_way_round() -> None:
    keys = keyframes((0, 0, 0), (0, 0, 0), degrees=(10.0, 350.0))
    off = (moved([2.0, 2.0, 3.0], 0.5, keys) - moved([1.0, 2.0, 3.0], 0.5, keys))[:3]
    np.testing.assert_allclose(off, [1.0, 0.0, 0.0], atol=EXACT)


def test_paths_of_different_lengths_share_a_layer_without_disturbing_each_other() -> None:
    short, long = keyframes((5, 0, 0)), keyframes((0, 0, 0), (1, 0, 0), (0, 8, 0))
    both = compile_tracks([Moving(body=k, motion=m, center=(0.0, 0.0, 0.0)) for k, m in enumerate((short, long))])
    for time, place in ((0.0, (0, 0, 0)), (0.5, (0.5, 0, 0)), (1.5, (0.5, 4, 0)), (7.0, (0, 8, 0))):
        poses = np.tile(np.eye(4), (2, 1, 1))
        both.apply(poses, time)
        np.testing.assert_allclose(poses[:, :3, 3], [(5, 0, 0), place], atol=EXACT)


def test_many_turns_equal_one_by_one_rodrigues() -> None:
    chance = np.random.default_rng(5)
    periods = chance.uniform(0.5, 9, 40)
    motions = [
        SpinConfig(type="spin", object="*", axis=tuple(axis), period_s=float(period), center=tuple(center))
        for axis, center, period in zip(chance.normal(size=(40, 3)), chance.normal(size=(40, 3)), periods, strict=True)
    ]
    poses = np.tile(np.eye(4), (40, 1, 1))
    compile_tracks([Moving(body=k, motion=m, center=(0, 0, 0)) for k, m in enumerate(motions)]).apply(poses, 1.7)
    for pose, motion in zip(poses, motions, strict=True):
        axis = np.array(motion.axis) / np.linalg.norm(motion.axis)
        angle = 2 * np.pi * 1.7 / motion.period_s
        point = chance.normal(size=3)
        arm = point - motion.center
        turned = arm * math.cos(angle) + np.cross(axis, arm) * math.sin(angle)
        turned += axis * (axis @ arm) * (1 - math.cos(angle))
        np.testing.assert_allclose((pose @ [*point, 1.0])[:3], motion.center + turned, atol=EXACT)
