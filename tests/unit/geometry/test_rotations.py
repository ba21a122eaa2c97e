"""Rotations against scipy's, and the ends of what they are defined for."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.spatial.transform import Rotation

from wall.geometry.rotations import matrices_of, on_the_way, quaternions_of

ROUNDING = 1e-14  # a dozen float64 operations on numbers up to 1
TURNS = np.random.default_rng(7).normal(size=(40, 3)) * np.geomspace(1e-12, 3.0, 40)[:, None]


def test_turns_as_quaternions_and_as_matrices_are_scipys() -> None:
    expected, found = Rotation.from_rotvec(TURNS), quaternions_of(TURNS)
    sign = np.sign(found[:, :1]) * np.sign(expected.as_quat(scalar_first=True)[:, :1])  # q and -q are one rotation
    assert_allclose(sign * found, expected.as_quat(scalar_first=True), atol=ROUNDING)
    assert_allclose(matrices_of(found), expected.as_matrix(), atol=ROUNDING)


def test_no_turn_is_the_identity_and_a_tiny_one_keeps_its_axis() -> None:
    assert_array_equal(matrices_of(quaternions_of(np.zeros(3))), np.eye(3))
    assert_allclose(quaternions_of(np.array([0.0, 2e-200, 0.0])), [1.0, 0.0, 1e-200, 0.0], rtol=ROUNDING)


@pytest.mark.parametrize("flip", [1.0, -1.0])
def test_the_way_between_rotations_is_scipys_shorter_one(flip: float) -> None:
    """Whichever of the two quaternions of an end is given."""
    begin, end = quaternions_of(TURNS), quaternions_of(TURNS[::-1] + 0.3)
    share = np.linspace(0.0, 1.0, len(TURNS))[:, None]
    first, last = (Rotation.from_quat(q, scalar_first=True) for q in (begin, end))
    expected = (first * Rotation.from_rotvec(share * (first.inv() * last).as_rotvec())).as_matrix()
    assert_allclose(matrices_of(on_the_way(begin, flip * end, share)), expected, atol=10 * ROUNDING)


def test_a_rotation_is_on_the_way_to_itself() -> None:
    still = quaternions_of(TURNS)
    assert_allclose(on_the_way(still, still, np.full((len(still), 1), 0.4)), still, atol=ROUNDING)
