"""Splat sums become means, and what is missing comes from coarser levels."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from wall.core.data import Float32
from wall.deepbuffer.kernels.change import TRUSTED
from wall.reconstruction.pyramid import Pyramid

FLOAT32 = 2e-6  # a few roundings at every level


def halved(sums: Float32, full: float) -> Float32:
    """Sums over 2x2, a pixel of weight `full` or more counting once."""
    rows, columns = (-(-edge // 2) for edge in sums.shape[:2])
    padded = np.zeros((2 * rows, 2 * columns, 4), np.float32)
    padded[: sums.shape[0], : sums.shape[1]] = sums / np.maximum(sums[..., 3:], full)
    return np.asarray(padded.reshape(rows, 2, columns, 2, 4).sum(axis=(1, 3)))


def doubled(coarse: Float32, height: int, width: int) -> Float32:
    """Bilinear: three quarters of the own coarser pixel and a quarter of the one beside, in both directions."""
    for axis, edge in ((0, height), (1, width)):
        at = np.arange(edge)
        beside = np.clip(at // 2 - 1 + 2 * (at % 2), 0, coarse.shape[axis] - 1)
        coarse = 0.75 * coarse.take(at // 2, axis) + 0.25 * coarse.take(beside, axis)
    return coarse


def filled(sums: Float32, full: float) -> Float32:
    """What `Pyramid.resolve` shows, level by level in NumPy."""
    weight = sums[..., 3:]
    if sums.shape[:2] == (1, 1):
        return np.asarray(sums[..., :3] / np.maximum(weight, np.finfo(np.float32).tiny))
    coarse = doubled(filled(halved(sums, full), 1.0), *sums.shape[:2])
    return np.asarray(sums[..., :3] / np.maximum(weight, full) + np.maximum(1.0 - weight / full, 0.0) * coarse)


@pytest.mark.parametrize("size", [(37, 50), (16, 33), (1, 18), (2, 2)])
def test_means_are_shown_and_what_weight_they_lack_comes_from_coarser_levels(size: tuple[int, int]) -> None:
    random = np.random.default_rng(4)
    sums = np.zeros((size[0] + 2, size[1] + 2, 4), np.float32)
    inside = sums[1:-1, 1:-1]
    inside[..., 3] = random.uniform(0.0, 2.0 * TRUSTED, size) * (random.random(size) < 0.8)
    inside[..., :3] = random.uniform(0.0, 1.0, (*size, 3)) * inside[..., 3:]
    inside[0, -1] = TRUSTED  # just enough
    shown: Float32 = np.full((*size, 3), 7.0, np.float32)

    Pyramid(*size).resolve(sums, shown)

    assert_allclose(shown, filled(inside, float(TRUSTED)), rtol=FLOAT32, atol=FLOAT32)


def test_an_image_without_holes_keeps_its_means_and_nothing_of_an_earlier_hole() -> None:
    pyramid, sums = Pyramid(20, 30), np.full((22, 32, 4), 0.5, np.float32)
    shown = np.zeros((20, 30, 3), np.float32)
    sums[6, 9] = 0.0
    pyramid.resolve(sums, shown)
    sums[..., :3], sums[6, 9] = 0.25, (0.4, 0.2, 0.1, 0.5)
    pyramid.resolve(sums, shown)
    expected = np.full((20, 30, 3), 0.5, np.float32)
    expected[5, 8] = np.array([0.4, 0.2, 0.1], np.float32) / 0.5
    assert_array_equal(shown, expected)
