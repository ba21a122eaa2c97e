"""Tiles that came with the samples: a display that does not judge learns from them where old samples are wrong."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from adaptive_pictures import GREEN, RED, SIZE, START, centres, event_at, hits, picture_of, plate_before_wall
from numpy.testing import assert_allclose, assert_array_equal

from wall.core.data import Rect, Tiling
from wall.reconstruction.kernels import tiling as kernels_tiling
from wall.scene.build import Scene


@pytest.fixture(scope="module")
def scene() -> Scene:
    return plate_before_wall((9.0, 0.0, 2.0))


def tiling_of(*tiles: tuple[int, int, int, int], change: Any = 0.01) -> Tiling:
    n = len(tiles)
    return Tiling(
        view=0, panel=0, rect=Rect(x=0, y=0, width=SIZE[0], height=SIZE[1]), rank=1, sequence=1, camera_event=0,
        scene_event=0, base_time=START, rects=np.array(tiles, np.uint16), spatial=np.zeros(n, np.float32),
        temporal=np.broadcast_to(np.float32(change), n), density=np.zeros(n, np.float32),
    )  # fmt: skip


def test_squares_get_the_mean_of_the_tiles_over_them_by_area() -> None:
    """The NumPy twin: each pixel has its tile's value, each square the mean of its pixels; the rest keep theirs."""
    random = np.random.default_rng(4)
    height, width, x0, y0 = 40, 53, 100, 70
    pixels = np.repeat(np.repeat(random.random((3, 4), np.float32), 16, 0), 16, 1)[:height, :width]
    squares = pixels[::16, ::16].copy()
    tiles = [(90, 60, 30, 25), (120, 60, 33, 18), (120, 78, 9, 30), (140, 100, 60, 60)]  # some reach out
    values = random.random(4, np.float32)
    for (x, y, w, h), value in zip(tiles, values, strict=True):
        pixels[max(y - y0, 0) : max(y - y0 + h, 0), max(x - x0, 0) : max(x - x0 + w, 0)] = value
    rects = np.array(tiles, np.uint16)

    kernels_tiling.spread(rects, values, x0, y0, height, width, squares, np.empty((3, 4, 2), np.float32))

    down, across = np.arange(0, height, 16), np.arange(0, width, 16)
    sums = np.add.reduceat(np.add.reduceat(pixels.astype(np.float64), down, 0), across, 1)
    areas = np.add.reduceat(np.add.reduceat(np.ones((height, width)), down, 0), across, 1)
    assert_allclose(squares, sums / areas, rtol=1e-5)


def test_tiles_outside_the_picture_and_none_at_all_change_nothing() -> None:
    squares = np.ones((2, 2), np.float32)
    far = np.array([[0, 0, 10, 10], [300, 0, 5, 5], [100, 300, 5, 5]], np.uint16)
    for rects in (far, far[:0]):
        values = np.full(len(rects), 9.0, np.float32)
        kernels_tiling.spread(rects, values, 100, 70, 32, 32, squares, np.empty((2, 2, 2), np.float32))
    assert (squares == 1.0).all()


def test_tiles_that_overlap_count_no_more_than_the_square_they_cover() -> None:
    squares = np.zeros((1, 1), np.float32)
    rects, values = np.array([[0, 0, 16, 16]] * 3, np.uint16), np.array([1.0, 2.0, 6.0], np.float32)
    kernels_tiling.spread(rects, values, 0, 0, 16, 16, squares, np.empty((1, 1, 2), np.float32))
    assert squares[0, 0] == 3.0


def test_old_samples_fade_where_tiles_say_that_change_is_found_and_only_there(scene: Scene) -> None:
    """A red sample 1 s old and a green one 0.1 s old in every pixel centre. Weights are 1 / (1 + a + a^2 / 2 + a^3 / 6)
    with a = age / 2 s (1 + 100 change): red has 39 % of them without change, 9 % with 0.05, where a is 6 times that."""
    picture = picture_of(scene)
    picture.insert(hits(centres(SIZE), RED), START, event_at(0))
    picture.insert(hits(centres(SIZE), GREEN), START + 0.9, event_at(0))
    picture.take_tiling(tiling_of((0, 0, 16, 32), change=0.05))
    picture.refresh(event_at(1), START + 1.0)

    def weight(age: float, change: float) -> float:
        a = 0.5 * age * (1 + 100 * change)
        return 1 / (1 + a + a * a / 2 + a**3 / 6)

    for columns, change in ((slice(1, 15), 0.05), (slice(17, 47), 0.0)):
        share = weight(1.0, change) / (weight(1.0, change) + weight(0.1, change))
        shown = picture.base[1:-1, columns]
        assert_allclose(shown[..., 0], RED[0] * share, rtol=1e-3)
        assert_allclose(shown[..., 1], GREEN[1] * (1 - share), rtol=1e-3)


def test_a_picture_that_judges_for_itself_keeps_what_it_found(scene: Scene) -> None:
    picture = picture_of(scene, judging=True)
    before = picture.residual.copy()
    picture.take_tiling(tiling_of((0, 0, 48, 32), change=0.5))
    assert_array_equal(picture.residual, before)
