"""Points that are chosen evenly: of a sun's disc, by solid angle, and of a lens, by area."""

from __future__ import annotations

import math
from typing import Any

import numba
import numpy as np
import pytest

from wall.core.data import Float64
from wall.tracing import embree
from wall.tracing.kernels import rows
from wall.tracing.kernels.lens import open_lens
from wall.tracing.kernels.values import Paths
from wall.tracing.kernels.ways import way_to_sun
from wall.tracing.tracer import workspace

pytestmark = pytest.mark.usefixtures("compiled_only")
COUNT = 96_000
RINGS, SECTORS = 12, 16  # of equal size


@numba.njit
def ways(sun: Any, numbers: Any, work: Any, to: Any) -> None:
    for k in range(len(numbers)):
        lane = k % 16
        work.packet[rows.LIGHT_U + lane], work.packet[rows.LIGHT_V + lane] = numbers[k, 0], numbers[k, 1]
        x, y, z, _, _, _ = way_to_sun(sun, lane, work)
        to[k, 0], to[k, 1], to[k, 2] = x, y, z


@numba.njit
def starts(lens: Any, ahead: Any, paths: Any, work: Any, to: Any) -> None:
    p = work.packet
    for first in range(0, len(to), 16):
        for lane in range(16):
            for k in range(3):
                p[embree.DIRECTION_X + 16 * k + lane] = ahead[k]
        open_lens(lens, first, 16, paths, work)
        for lane in range(16):
            for k in range(3):
                to[first + lane, k] = p[embree.ORIGIN_X + 16 * k + lane]
                to[first + lane, 3 + k] = p[embree.DIRECTION_X + 16 * k + lane]


def assert_even(square: Float64, turn: Float64) -> None:
    """Chi-square at the 1e-6 level over rings and sectors of a disc; square : (n,) of the radius, 0..1; turn : rad."""
    ring = np.minimum((square * RINGS).astype(int), RINGS - 1)
    sector = np.minimum(((turn / (2 * np.pi) + 1.0) % 1.0 * SECTORS).astype(int), SECTORS - 1)
    counts = np.bincount(ring * SECTORS + sector, minlength=RINGS * SECTORS)
    expected, freedom = len(square) / (RINGS * SECTORS), RINGS * SECTORS - 1
    assert float(((counts - expected) ** 2 / expected).sum()) < freedom + 6.0 * math.sqrt(2.0 * freedom)


@pytest.mark.parametrize("diameter", [0.53, 30.0, 180.0])
@pytest.mark.parametrize("axis", [(0.0, 0.0, -1.0), (0.6, 0.64, 0.48)])
def test_ways_to_a_sun_are_even_by_solid_angle(axis: tuple[float, float, float], diameter: float) -> None:
    """The share of a cap below an angle a is (1 - cos a) / (1 - cos of the radius), 1 - cos a = |way - axis|^2 / 2."""
    cap = 2.0 * math.sin(math.radians(diameter) / 4.0) ** 2
    sun, to = np.array([*axis, 1.0, 1.0, 1.0, cap], np.float32), np.zeros((COUNT, 3), np.float32)
    numbers = np.random.default_rng(11).random((COUNT, 2), dtype=np.float32)
    ways(sun, numbers, workspace(coherent=False), to)
    up = np.array(axis)
    low = ((to - up) ** 2).sum(axis=1) / 2.0
    assert low.max() <= cap * (1.0 + 1e-4)
    side = np.cross(up, (0.8, 0.0, 0.6))
    side /= np.linalg.norm(side)
    assert_even(np.minimum(low / cap, 1.0), np.arctan2(to @ np.cross(up, side), to @ side))


def test_rays_start_evenly_on_a_lens_and_meet_in_its_focus() -> None:
    """A pixel's ray stands for a point at distance 4 along the axis: all rays go there."""
    right, up, ahead, radius, focus = np.eye(3)[0], np.eye(3)[1], -np.eye(3)[2], 0.25, 4.0
    lens = np.stack([right * radius, up * radius, ahead / focus]).astype(np.float32)
    pixel, count = np.array([0.6, 0.0, -0.8]), np.arange(COUNT)
    paths = Paths(
        rays=np.zeros((0, 12), np.float32), sample=count, key=(count * 7919).astype(np.uint32),
        radiance=np.zeros((0, 3), np.float32), normals=None, depth=1, number=count.astype(np.uint32), seed=np.uint32(0),
    )  # fmt: skip
    to = np.zeros((COUNT, 6), np.float32)
    starts(lens, pixel.astype(np.float32), paths, workspace(coherent=False), to)
    at, way = to[:, :3].astype(np.float64) / radius, to[:, 3:].astype(np.float64)
    assert_even(np.minimum((at**2).sum(axis=1), 1.0), np.arctan2(at[:, 1], at[:, 0]))
    met = radius * at + way * (focus / -way[:, 2])[:, None]
    np.testing.assert_allclose(met, np.tile(pixel * focus / 0.8, (COUNT, 1)), atol=1e-5)
