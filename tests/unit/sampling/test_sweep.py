"""Sweeps: each pixel of an image gets a ray, and finer sweeps leave out what coarser ones have sampled."""

from __future__ import annotations

import numpy as np
import pytest

from wall.core.data import Float32
from wall.sampling.sweep import Sweep

NONE: Float32 = np.empty((0, 2), np.float32)


@pytest.mark.parametrize("grid", [(30, 17), (60, 34), (120, 68), (240, 135)])
def test_every_pixel_of_the_image_has_one_ray_near_its_middle(grid: tuple[int, int]) -> None:
    size = (240, 135)

    sweep = Sweep(size, grid, NONE)

    cells = sweep.xy * np.array(grid) / np.array(size)
    assert len(np.unique(cells.astype(int), axis=0)) == len(cells) == grid[0] * grid[1]
    middle = (np.floor(cells) + 0.5) * np.array(size) / np.array(grid)
    assert np.abs(sweep.xy - middle).max() <= 0.5 + 1e-3, "panel pixels"
    assert (sweep.xy < size).all()


def test_packets_of_16_rays_are_blocks_of_neighbours() -> None:
    packets = Sweep((64, 32), (64, 32), NONE).xy.reshape(-1, 16, 2)

    assert np.ptp(packets, axis=1).max() == 3.0


def test_batches_are_taken_until_none_is_left() -> None:
    sweep = Sweep((20, 10), (10, 5), NONE)

    batches = [sweep.take(16) for _ in range(5)]

    assert [len(batch) for batch in batches] == [16, 16, 16, 2, 0]
    assert sweep.left == 0
    assert len(np.unique(np.concatenate(batches), axis=0)) == 50


def test_all_sweeps_together_cost_as_many_rays_as_the_finest() -> None:
    size, known = (480, 270), NONE
    for grid in [(60, 34), (120, 68), (240, 135), (480, 270)]:
        known = np.concatenate([known, Sweep(size, grid, known).xy])
        cells = (known * np.array(grid) / np.array(size)).astype(int)
        assert len(np.unique(cells, axis=0)) == grid[0] * grid[1], "the image has a sample in each pixel"

    assert len(known) <= 1.001 * 480 * 270
