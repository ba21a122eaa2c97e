"""How far samples spread: a tent where they are few, steeper where they are dense, shares that always sum to 1."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

from wall.core.data import Float32
from wall.deepbuffer.store import SampleStore
from wall.reconstruction.kernels.splat import splat
from wall.reconstruction.kernels.visibility import (
    CONSERVATIVE_DEPTH,
    DECAY,
    DENSE,
    SHARPEST,
    SHARPNESS,
    SILHOUETTE_PER_S,
    SLOWEST,
    behind,
    bound_depths,
)

SIZE = 8  # pixels
RATIO = behind(1.0).own
FLOAT32 = 1e-5  # a few roundings of shares that sum to 1


def shares(x: float, y: float, sharpness: float, weight: float = 1.0) -> Float32:
    """(SIZE + 2, SIZE + 2) float32: what pixels get of one sample, a border around."""
    store = SampleStore.of(1, lit=False)
    store.radiance[:], store.screen_position[:, 0] = 1.0, (x, y, 1.0)
    sums: Float32 = np.full((SIZE + 2, SIZE + 2, 4), 7.0, np.float32)
    bounds = np.full((3, SIZE, SIZE), sharpness, np.float32)
    no_irradiance = np.zeros((0, 0, 2), np.float32)
    weights = np.full(1, weight, np.float32)
    splat(store, weights, 1, bounds, np.ones((1, 1), np.bool_), sums, no_irradiance, None)
    assert_allclose(sums[..., 0], sums[..., 3])
    return np.asarray(sums[..., 3])


@pytest.mark.parametrize("sharpness", [1.0, 1.7, 3.0])
def test_shares_follow_the_trapezoid_and_sum_to_1(sharpness: float) -> None:
    """In one dimension a pixel at distance d gets clip(1/2 + sharpness (1/2 - d), 0, 1)."""
    random = np.random.default_rng(3)
    for x, y in random.random((20, 2)) * SIZE:
        centres = np.arange(SIZE + 2) - 0.5
        across, down = (np.clip(0.5 + sharpness * (0.5 - np.abs(centres - at)), 0.0, 1.0) for at in (x, y))
        assert_allclose(shares(x, y, sharpness), np.outer(down, across), atol=FLOAT32)
        assert_allclose(shares(x, y, sharpness).sum(), 1.0, atol=FLOAT32)


def test_no_share_is_rounded_below_nothing(compiled_only: None) -> None:
    """Samples that leave nearly nothing to the first of their four pixels.

    Less than nothing had no square root, and showed as black where an image of few pixels was enlarged.
    """
    random = np.random.default_rng(5)
    for x, y, weight in random.random((3500, 3)) ** (8.0, 8.0, 1.0) * (1.0, 1e-3, 1.0):
        assert shares(3.5 - x, 2.5 - y, 1.0, weight).min() == 0.0


@pytest.mark.parametrize(
    ("weight", "expected"), [(0.0, 1.0), (float(DENSE), 1.0), (2 * float(DENSE), 2.0), (99.0, float(SHARPEST))]
)
def test_the_tent_is_steeper_only_where_samples_are_dense(weight: float, expected: float) -> None:
    nearest, bounds = np.ones((SIZE, SIZE, 4), np.float32), np.zeros((3, SIZE, SIZE), np.float32)
    sums = np.zeros((SIZE + 2, SIZE + 2, 4), np.float32)
    sums[3, 5, 3] = weight
    bound_depths(
        nearest, RATIO, np.zeros(2, np.uint8), np.zeros((1, 1), np.float32), SILHOUETTE_PER_S, sums,
        np.ones((1, 1), np.bool_), bounds, 0, SIZE,
    )  # fmt: skip
    sharpness = bounds[SHARPNESS]
    assert sharpness[2, 4] == expected
    assert np.count_nonzero(sharpness != 1.0) == (expected != 1.0)


@pytest.mark.parametrize(
    ("moves", "weight", "pace"), [(0, 0.6, 0.3), (1, 0.6, 1.0), (0, 8.0, 2.0), (1, 8.0, 1.0), (0, 0.0, 1.0)]
)
def test_silhouettes_age_at_full_pace_where_they_move_else_by_density(moves: int, weight: float, pace: float) -> None:
    """A near column before a far ground; `decay` of 2 / s goes by density everywhere."""
    nearest, bounds = np.full((SIZE, SIZE, 4), 2.0, np.float32), np.zeros((3, SIZE, SIZE), np.float32)
    nearest[:, 4, 0], nearest[:, 4, 3] = 1.0, 1.0
    sums = np.zeros((SIZE + 2, SIZE + 2, 4), np.float32)
    sums[..., 3] = weight
    decay, moved = np.full((1, 1), 2.0, np.float32), np.array([0, moves, 0], np.uint8)
    bound_depths(nearest, RATIO, moved, decay, SILHOUETTE_PER_S, sums, np.ones(decay.shape, np.bool_), bounds, 0, SIZE)
    by_density = {0.0: 1.0, 0.6: 0.3, 8.0: 2.0}[weight]
    assert_allclose(bounds[DECAY, :, 3:6], 2.0 * by_density + float(SILHOUETTE_PER_S) * pace, rtol=FLOAT32)
    assert_allclose(np.delete(bounds[DECAY], (3, 4, 5), axis=1), 2.0 * by_density, rtol=FLOAT32)


def neighbourhood(image: Float32) -> Float32:
    """(9, h, w): every pixel's 3x3, edges repeated."""
    wide = np.pad(image, 1, mode="edge")
    height, width = image.shape
    return np.array([wide[i : i + height, j : j + width] for i in range(3) for j in range(3)])


@pytest.mark.parametrize("moved", [(1, 1, 1), (0, 1, 1), (1, 0, 1), (0, 0, 0)])
@pytest.mark.parametrize("rows", [(0, 1, 2, 3), (0, 3), (2,)])
def test_bounds_come_from_nine_pixels_in_whichever_rows_of_tiles(moved: tuple[int, ...], rows: tuple[int, ...]) -> None:
    height, width, random = 59, 37, np.random.default_rng(6)
    nearest = np.zeros((height, width, 4), np.float32)
    nearest[..., 0], nearest[..., 3] = random.uniform(1, 1.1, (height, width)), random.integers(-1, 3, (height, width))
    nearest[..., 0][nearest[..., 3] < 0] = np.inf
    sums = np.zeros((height + 2, width + 2, 4), np.float32)
    sums[..., 3] = random.uniform(0, 16, sums.shape[:2])
    tiles = np.zeros((4, 3), np.bool_)
    tiles[list(rows), 1] = True
    decay, bounds = random.uniform(1, 2, tiles.shape).astype(np.float32), np.zeros((3, height, width), np.float32)
    bound_depths(nearest, RATIO, np.array(moved, np.uint8), decay, SILHOUETTE_PER_S, sums, tiles, bounds, 0, height)

    objects = nearest[..., 3].astype(int)
    limit = neighbourhood(nearest[..., 0]).min(axis=0) * float(RATIO)
    moves = neighbourhood(np.where(objects >= 0, np.array(moved)[objects], 0)).max(axis=0)
    deepest = neighbourhood(np.where(objects >= 0, nearest[..., 0], 0.0)).max(axis=0)
    pace = np.clip(sums[1:-1, 1:-1, 3] / float(DENSE), float(SLOWEST), float(SHARPEST))
    edge = np.where(deepest > limit, float(SILHOUETTE_PER_S) * np.where(moves > 0, 1.0, pace), 0.0)
    slow = pace * decay.repeat(16, axis=0).repeat(16, axis=1)[:height, :width]
    wanted = tiles.any(axis=1).repeat(16)[:height]
    assert_allclose(bounds[CONSERVATIVE_DEPTH][wanted], limit[wanted], rtol=FLOAT32)
    assert_allclose(bounds[DECAY][wanted], (slow + edge)[wanted], rtol=FLOAT32)
