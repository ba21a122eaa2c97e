"""Dirty tiles as rectangles: every dirty one once, none of a clean row, nothing outside."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays

from wall.compositing.executor import tiles_to_regions
from wall.core.data import Rect

TILE = 4


@given(
    dirty=arrays(np.bool_, array_shapes(min_dims=2, max_dims=2, max_side=7)),
    cut=st.tuples(st.integers(0, TILE - 1), st.integers(0, TILE - 1)),
    corner=st.tuples(st.integers(-9, 9), st.integers(-9, 9)),
)
def test_regions_hold_every_row_of_tiles_from_its_first_dirty_one_to_its_last_once(
    dirty: np.ndarray[tuple[int, int], np.dtype[np.bool_]], cut: tuple[int, int], corner: tuple[int, int]
) -> None:
    rows, columns = dirty.shape
    rect = Rect(x=corner[0], y=corner[1], width=columns * TILE - cut[0], height=rows * TILE - cut[1])

    times = np.zeros((rect.height, rect.width), int)
    for region in tiles_to_regions(dirty, TILE, rect):
        assert rect.contains(region)
        times[region.inside(rect)] += 1

    wanted = np.zeros_like(dirty)
    for row in range(rows):
        if dirty[row].any():
            ends = np.flatnonzero(dirty[row])
            wanted[row, ends[0] : ends[-1] + 1] = True
    pixels = np.kron(wanted, np.ones((TILE, TILE), int))[: rect.height, : rect.width]
    np.testing.assert_array_equal(times, pixels)


def test_nothing_dirty_is_no_region_and_all_dirty_is_one() -> None:
    rect = Rect(x=3, y=5, width=10, height=7)
    assert tiles_to_regions(np.zeros((2, 3), np.bool_), TILE, rect) == []
    assert tiles_to_regions(np.ones((2, 3), np.bool_), TILE, rect) == [rect]
