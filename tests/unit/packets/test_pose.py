"""What packets say about where their samples were seen from."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from packet_examples import batch_of, plain_samples

from wall.core.data import Camera
from wall.core.errors import LocalProtocolError
from wall.packets.samples import decode, encode

LARGEST_CHANGE = 2e-15  # of a rotation's elements, docs/guide/packet_format.md
CAMERA = Camera(position=(1e6 + 0.1, -2.5, math.pi), world_from_wall=(0.6, 0.0, 0.8, 0.0, 1.0, 0.0, -0.8, 0.0, 0.6))


def turned(axis: tuple[float, float, float], angle: float) -> tuple[float, ...]:
    """Rodrigues' rotation of so many radians, 9 numbers row major."""
    x, y, z = np.array(axis) / np.linalg.norm(axis)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    matrix = np.eye(3) + math.sin(angle) * cross + (1 - math.cos(angle)) * (cross @ cross)
    u, _, v = np.linalg.svd(matrix)  # to the last bit orthonormal: what is measured is the wire's error
    return tuple((u @ v).ravel().tolist())


def through(matrix: tuple[float, ...]) -> tuple[float, ...]:
    sent = batch_of(plain_samples(1), camera=Camera(position=(0.0, 0.0, 0.0), world_from_wall=matrix))
    return decode(encode(sent)).camera.world_from_wall


def test_position_scene_time_and_filter_come_back_exactly() -> None:
    sent = replace(batch_of(plain_samples(5)), camera=CAMERA, scene_time=12.345678901234567, adaptive=True)
    came = decode(encode(sent))
    assert (came.camera.position, came.scene_time, came.adaptive) == (CAMERA.position, 12.345678901234567, True)
    np.testing.assert_allclose(came.camera.world_from_wall, CAMERA.world_from_wall, rtol=0, atol=LARGEST_CHANGE)


@pytest.mark.parametrize("angle", [0.0, 1e-12, 1e-3, 1.0, math.pi / 2, 3.0, math.pi - 1e-9, math.pi, 2 * math.pi])
def test_rotations_of_any_angle_come_back_within_the_stated_bound(angle: float) -> None:
    axes = [tuple(axis) for axis in np.random.default_rng(5).normal(size=(40, 3)).tolist()]
    for axis in [(1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (1.0, 1.0, 0.0), (-1.0, 1e-9, 0.0), *axes]:
        matrix = turned(axis, angle)
        np.testing.assert_allclose(through(matrix), matrix, rtol=0, atol=LARGEST_CHANGE)


def test_quarter_turns_come_back_exactly() -> None:
    for matrix in [(1, 0, 0, 0, 1, 0, 0, 0, 1), (1, 0, 0, 0, -1, 0, 0, 0, -1), (-1, 0, 0, 0, 1, 0, 0, 0, -1)]:
        assert through(tuple(map(float, matrix))) == matrix


@pytest.mark.parametrize(
    "matrix",
    [
        (-1, 0, 0, 0, 1, 0, 0, 0, 1),  # a mirror
        (0, 0, 0, 0, 0, 0, 0, 0, 0),
        (1.00001, 0, 0, 0, 1, 0, 0, 0, 1),
        (1, 0.00001, 0, 0, 1, 0, 0, 0, 1),
        (2, 0, 0, 0, 2, 0, 0, 0, 2),
        (math.nan, 0, 0, 0, 1, 0, 0, 0, 1),
        (1e200, 0, 0, 0, -1e200, 0, 0, 0, 1),
        (1, 0, 0, 0, 1, 0),
    ],
)
def test_what_is_no_rotation_is_not_sent(matrix: tuple[float, ...]) -> None:
    with pytest.raises(LocalProtocolError, match="world_from_wall"):
        through(matrix)


def test_a_matrix_of_seven_digits_is_sent_as_the_rotation_it_means() -> None:
    matrix = turned((1.0, 2.0, 3.0), 1.0)
    assert np.abs(np.subtract(through(tuple(round(v, 7) for v in matrix)), matrix)).max() < 1e-7


@pytest.mark.parametrize("wrong", [math.nan, math.inf])
def test_a_pose_that_is_not_finite_is_not_sent(wrong: float) -> None:
    with pytest.raises(LocalProtocolError, match="finite"):
        encode(replace(batch_of(plain_samples(5)), scene_time=wrong))


def test_changes_of_adaptive_samples_come_back_within_a_thirtieth() -> None:
    samples = plain_samples(301)
    samples["change"] = np.linspace(0.0, 1.0, 301)
    came = decode(encode(batch_of(samples, adaptive=True))).samples["change"]
    error = np.abs(np.sort(came) - samples["change"])  # samples come in another order, changes grew
    assert error.max() <= 1 / 30 + 1e-6
    assert error.max() > 0.9 / 30  # the bound is tight


def test_plain_samples_bring_no_change() -> None:
    samples = plain_samples(9)
    samples["change"] = 1.0
    assert not decode(encode(batch_of(samples))).samples["change"].any()


def test_lighting_stays_at_the_sender() -> None:
    samples = plain_samples(5)
    samples["sqrt_irradiance"] = 0.5
    assert not decode(encode(batch_of(samples))).samples["sqrt_irradiance"].any()
