"""The Hilbert order visits every pixel of any rectangle once, in steps of one pixel."""

from __future__ import annotations

import os

import numpy as np
import pytest

from wall.geometry.hilbert import hilbert_order

UP_TO = 12 if os.environ.get("NUMBA_DISABLE_JIT") == "1" else 48


def test_two_by_two_is_the_first_hilbert_curve() -> None:
    assert hilbert_order(2, 2).tolist() == [[0, 0], [0, 1], [1, 1], [1, 0]]


def test_order_of_a_power_of_two_is_hilbert_s_curve() -> None:
    # the four-by-four curve of Hilbert 1891, turned to begin at (0, 0) and end at (3, 0)
    expected = "00 10 11 01 02 03 13 12 22 23 33 32 31 21 20 30"

    assert " ".join(f"{x}{y}" for x, y in hilbert_order(4, 4)) == expected


@pytest.mark.parametrize("size", [(0, 0), (0, 5), (5, 0)])
def test_rectangle_without_pixels_has_no_order(size: tuple[int, int]) -> None:
    assert hilbert_order(*size).shape == (0, 2)


@pytest.mark.parametrize("n", [1, 2, 7])
def test_line_of_pixels_is_walked_from_end_to_end(n: int) -> None:
    assert hilbert_order(n, 1).tolist() == [[i, 0] for i in range(n)]
    assert hilbert_order(1, n).tolist() == [[0, i] for i in range(n)]


def test_every_rectangle_is_visited_once_in_steps_of_one_pixel() -> None:
    for width in range(1, UP_TO):
        for height in range(1, UP_TO):
            order = hilbert_order(width, height)
            assert np.array_equal(np.unique(order[:, 1] * width + order[:, 0]), np.arange(width * height))
            steps = np.abs(np.diff(order, axis=0))
            diagonal = int((steps.sum(axis=1) == 2).sum())
            parity_forbids = max(width, height) % 2 == 1 and min(width, height) % 2 == 0
            early = parity_forbids and min(width, height) == 2
            assert len(steps) == 0 or steps.max() == 1
            assert diagonal == (parity_forbids and not early), (width, height)
            end = max(width, height) - 1 - early
            assert order[0].tolist() == [0, 0]
            assert order[-1].tolist() == ([end, 0] if width >= height else [0, end])


@pytest.mark.skipif(os.environ.get("NUMBA_DISABLE_JIT") == "1", reason="a million pixels are too slow without JIT")
@pytest.mark.parametrize("size", [(480, 270), (4096, 257), (3, 100_000), (1023, 1024)])
def test_large_and_narrow_rectangles_are_visited_once(size: tuple[int, int]) -> None:
    order = hilbert_order(*size).astype(np.int64)

    assert np.array_equal(np.sort(order[:, 1] * size[0] + order[:, 0]), np.arange(size[0] * size[1]))
    assert np.abs(np.diff(order, axis=0)).max() == 1


def test_neighbours_on_the_curve_are_neighbours_in_the_image() -> None:
    # 64 consecutive pixels of a Hilbert curve fill an 8 x 8 block; of raster order, a line of 64
    order = hilbert_order(64, 64)
    blocks = order.reshape(-1, 64, 2)

    assert (blocks.max(axis=1) - blocks.min(axis=1)).max() == 7
