"""Rays go where scores say: pixels by a systematic draw, none where nothing is to be gained."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from numpy.typing import NDArray

from wall.core.data import Event, Float32, Float64
from wall.deepbuffer.kernels.pixel_buffer import TILE
from wall.sampling.kernels import adaptive as kernels
from wall.sampling.kernels.adaptive import Pixels, Tiles
from wall.sampling.tiles import Grid

PACKET = kernels.PACKET
Path = Callable[[int], Event]
SIZES = [(1, 1), (16, 16), (17, 16), (15, 1), (40, 37), (3, 70)]  # width, height
ORIGIN = (5, 9)  # panel pixel of the region's corner


def tiles_of(score: Float32 | Float64) -> Float64:
    """(rows, columns) float64 sums, by NumPy."""
    height, width = score.shape
    down, across = np.arange(0, height, TILE), np.arange(0, width, TILE)
    return np.add.reduceat(np.add.reduceat(score.astype(np.float64), down, axis=0), across, axis=1)


def grid_over(score: Float32) -> Tiles:
    """The grid of 16 pixels."""
    return Grid(score.shape[1], score.shape[0]).tiles


def drawn(
    score: Float32, packets: int, *, seed: int = 1, sequence: int = 1, visits: NDArray[np.uint16] | None = None
) -> Float32:
    xy = np.full((packets * PACKET, 2), np.nan, np.float32)
    seen = np.zeros(score.shape, np.uint16) if visits is None else visits
    filled = kernels.draw(score, grid_over(score), Pixels(seen, seed, *ORIGIN), sequence, xy)
    assert np.isnan(xy[filled:]).all()
    return xy[:filled]


def per_pixel(xy: Float32, shape: tuple[int, ...]) -> Float64:
    x, y = (np.floor(xy) - ORIGIN).astype(int).T
    assert (np.minimum(x, y) >= 0).all(), "outside the region"
    assert ((x < shape[1]) & (y < shape[0])).all(), "outside the region"
    counts = np.zeros(shape)
    np.add.at(counts, (y, x), 1)
    return counts


def scores(size: tuple[int, int], *, seed: int = 5) -> Float32:
    """Over three orders of magnitude, some of them zero."""
    random = np.random.default_rng(seed)
    found = np.exp(random.uniform(-7, 0, (size[1], size[0]))).astype(np.float32)
    found[random.random(found.shape) < 0.1] = 0.0
    found[0, 0] = 1.0
    return found


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("packets", [1, 7, 40])
def test_a_draw_fills_all_packets_inside_the_region(size: tuple[int, int], packets: int) -> None:
    xy = drawn(scores(size), packets)
    assert len(xy) == packets * PACKET
    assert per_pixel(xy, (size[1], size[0])).sum() == packets * PACKET


@pytest.mark.parametrize("seed", range(10))
def test_every_tile_gets_its_expected_number_of_rays_rounded_down_or_up(seed: int) -> None:
    """A systematic draw: marks at equal distances over the sums hit an interval of length L floor or ceil L times."""
    score = scores((100, 80), seed=seed)
    packets = 60
    found = tiles_of(per_pixel(drawn(score, packets, seed=seed), score.shape))
    expected = PACKET * packets * tiles_of(score) / score.sum(dtype=np.float64)
    assert (found >= np.floor(expected - 1e-6)).all()
    assert (found <= np.ceil(expected + 1e-6)).all()


def test_inside_a_tile_every_pixel_gets_its_expected_number_rounded_down_or_up() -> None:
    score = scores((16, 16))
    for sequence in range(20):
        found = per_pixel(drawn(score, 9, sequence=sequence), score.shape)
        expected = 9 * PACKET * score / score.sum(dtype=np.float64)
        assert (found >= np.floor(expected - 1e-3)).all()
        assert (found <= np.ceil(expected + 1e-3)).all()


def test_over_many_draws_pixels_get_rays_in_proportion_to_their_scores(compiled_only: None) -> None:
    """400 draws of 48 rays: a pixel's count is its expectation rounded down or up at random, with a deviation of at
    most half, so that the mean of 400 is within 5 / (2 sqrt(400))."""
    score = scores((32, 32))
    found = np.mean([per_pixel(drawn(score, 3, sequence=k), score.shape) for k in range(400)], axis=0)
    expected = 3 * PACKET * score / score.sum(dtype=np.float64)
    assert_allclose(found, expected, rtol=0, atol=5 / 40)


@pytest.mark.parametrize("size", [(16, 16), (64, 64)])
def test_where_all_pixels_score_alike_rays_make_a_regular_grid(size: tuple[int, int]) -> None:
    """One packet on one tile: every fourth pixel of every fourth row. On 16 tiles: one ray in each."""
    found = per_pixel(drawn(np.ones(size, np.float32), 1), size)
    i, j = np.nonzero(found)
    edge = size[0] // 4
    assert sorted(zip(i // edge, j // edge, strict=True)) == [(row, column) for row in range(4) for column in range(4)]
    assert len(set(zip(i % 4, j % 4, strict=True))) == 1, "the same pixel of each block"


def test_pixels_without_a_score_get_no_rays() -> None:
    score = scores((40, 37))
    assert (score == 0.0).sum() > 50
    for sequence in range(20):
        assert (per_pixel(drawn(score, 30, sequence=sequence), score.shape)[score == 0.0] == 0).all()


@pytest.mark.parametrize("size", SIZES)
def test_where_no_pixel_has_a_score_nothing_is_drawn(size: tuple[int, int]) -> None:
    assert len(drawn(np.zeros((size[1], size[0]), np.float32), 4)) == 0


@pytest.mark.parametrize("size", SIZES)
def test_a_draw_sums_the_scores_as_they_are_now(size: tuple[int, int]) -> None:
    """In float32 by columns of a block, in float64 from there on: six additions round to 4e-7."""
    score, tiles = scores(size), Grid(*size).tiles
    tiles.sums[:] = 7.0
    kernels.draw(score, tiles, Pixels(np.zeros(score.shape, np.uint16), 1, *ORIGIN), 1, np.zeros((16, 2), np.float32))
    assert_allclose(tiles.sums, tiles_of(score).ravel(), rtol=4e-7)


def test_a_seed_repeats_its_positions_and_another_does_not() -> None:
    score = scores((40, 37))
    assert_array_equal(drawn(score, 8), drawn(score, 8))
    assert (drawn(score, 8) != drawn(score, 8, seed=2)).any()
    assert (drawn(score, 8) != drawn(score, 8, sequence=2)).any()


def test_visits_to_a_pixel_spread_evenly_over_it() -> None:
    """The R2 sequence: of 64 visits each 1/16 of the pixel, in x and in y, gets 4 of them within 3."""
    visits = np.zeros((1, 1), np.uint16)
    xy = np.concatenate([drawn(np.ones((1, 1), np.float32), 1, sequence=k, visits=visits) for k in range(4)])
    assert visits[0, 0] == 64
    for axis in range(2):
        counts = np.bincount(((xy[:, axis] - ORIGIN[axis]) * 16).astype(int), minlength=16)
        assert np.abs(counts - 4).max() <= 3


def test_far_right_on_a_wide_wall_positions_stay_in_their_pixels(compiled_only: None) -> None:
    """At pixel 8191 float32 steps by 1/2048: rounding must not carry a position over the edge."""
    score = np.ones((1, 16), np.float32)
    xy = np.zeros((2000 * PACKET, 2), np.float32)
    pixels = Pixels(np.zeros(score.shape, np.uint16), 3, 8176, 8191)
    kernels.draw(score, grid_over(score), pixels, 1, xy)
    assert_array_equal(np.bincount(xy[:, 0].astype(int) - 8176, minlength=16), 2000)
    assert (xy[:, 1] < 8192).all()
