"""The reference's positions: replayable, inside their pixels, well spread."""

from __future__ import annotations

import numpy as np
import pytest

from wall.core.data import SAMPLE, Float32, Rect
from wall.sampling.pixel_means import PixelMeans

WHOLE = Rect(x=0, y=0, width=19, height=21)


def by_pixel(xy: Float32) -> dict[tuple[int, int], tuple[float, float]]:
    return {(int(x), int(y)): (x, y) for x, y in xy.tolist()}


def parts() -> list[Rect]:
    return [
        Rect(x=0, y=0, width=19, height=5),
        Rect(x=0, y=5, width=7, height=16),
        Rect(x=7, y=5, width=12, height=16),
    ]


@pytest.mark.parametrize("k", [0, 1, 63])
def test_positions_are_the_same_however_the_image_is_divided(k: int) -> None:
    whole = by_pixel(PixelMeans(WHOLE, seed=3).positions(k))
    divided: dict[tuple[int, int], tuple[float, float]] = {}
    for rect in parts():
        divided |= by_pixel(PixelMeans(rect, seed=3).positions(k))
    assert divided == whole


def test_a_sample_can_be_replayed_alone() -> None:
    """Sample 40 of pixel (5, 7) from a sampler that never made the others."""
    alone = PixelMeans(Rect(x=5, y=7, width=1, height=1), seed=9).positions(40)
    assert tuple(alone[0].tolist()) == by_pixel(PixelMeans(WHOLE, seed=9).positions(40))[5, 7]


@pytest.mark.parametrize(("x", "y"), [(0, 0), (4095, 17), (8190, 8190)])
def test_positions_stay_inside_their_pixels_in_float32(x: int, y: int) -> None:
    sampler = PixelMeans(Rect(x=x, y=y, width=2, height=2), seed=5)
    for k in range(400):
        pixels = np.floor(sampler.positions(k)).astype(int)
        assert {tuple(p) for p in pixels.tolist()} == {(x + i, y + j) for i in range(2) for j in range(2)}


def test_pixels_and_seeds_differ() -> None:
    one, other = (by_pixel(PixelMeans(WHOLE, seed=s).positions(0)) for s in (1, 2))
    assert one != other
    assert len({(round(x % 1, 5), round(y % 1, 5)) for x, y in one.values()}) == WHOLE.area


def test_samples_of_a_pixel_are_spread_more_evenly_than_random_ones() -> None:
    """64 points in 8 x 8 cells: random ones leave 64 (63/64)^64 = 23 cells empty, a low-discrepancy set far fewer."""
    sampler = PixelMeans(Rect(x=6, y=6, width=1, height=1), seed=1)
    cells = {tuple(np.floor(8 * (sampler.positions(k)[0] - 6)).astype(int).tolist()) for k in range(64)}
    assert 64 - len(cells) <= 14


def test_positions_are_uniform_over_the_pixel() -> None:
    """4,096 first positions: mean 1/2 to 5 standard deviations of sqrt(1/12 / n) each way."""
    xy = PixelMeans(Rect(x=0, y=0, width=64, height=64), seed=1).positions(0) % 1
    assert np.abs(xy.mean(axis=0) - 0.5).max() < 5 * np.sqrt(1 / 12 / 4096)
    assert np.abs(np.corrcoef(xy.T)[0, 1]) < 0.08


def test_mean_is_that_of_the_samples_and_zero_where_none_was_usable() -> None:
    sampler = PixelMeans(Rect(x=2, y=3, width=2, height=2), seed=1)
    samples = np.zeros(5, SAMPLE)
    samples["xy"] = [[2.1, 3.2], [2.9, 3.9], [3.5, 3.5], [2.5, 4.5], [2.0, 3.0]]
    samples["radiance"] = np.float32([[1, 2, 3], [2, 2, 2], [9, 0, 0], [0.5, 0, 0], [6, 2, 1]])
    sampler.add(samples)
    expected = [[[3, 2, 2], [9, 0, 0]], [[0.5, 0, 0], [0, 0, 0]]]
    np.testing.assert_allclose(sampler.mean(), expected, rtol=1e-12)
