"""The K-D cut: whatever the scores, its leaves share the pixels out exactly, and drift towards equal importance."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from wall.core.data import Float32
from wall.sampling.cut import BALANCE, COARSE, FINE, GAIN, Cut
from wall.sampling.kernels import adaptive as kernels_adaptive
from wall.sampling.kernels import cut as kernels
from wall.sampling.kernels.adaptive import BLOCK, Pixels
from wall.sampling.kernels.cut import LEAST_EDGE, MOST_EDGE

SIZES = [(1, 1), (5, 3), (1, 200), (300, 11), (23, 70), (16, 16), (65, 64), (100, 75), (150, 40)]  # width, height
MANY = 10_000


def check(cut: Cut, score: Float32) -> None:
    """Every pixel lies in one leaf, which knows it; edges and sums are what they should be."""
    rects, sums, tile_of, order = cut.tiles
    owner = np.full(tile_of.shape, -1)
    for leaf in order:
        x, y, width, height = rects[leaf]
        assert 0 < width <= MOST_EDGE
        assert 0 < height <= MOST_EDGE
        assert width >= min(LEAST_EDGE, tile_of.shape[1])
        assert height >= min(LEAST_EDGE, tile_of.shape[0])
        assert (x % BLOCK, y % BLOCK) == (0, 0), "a block lies in two leaves"
        assert (owner[y : y + height, x : x + width] == -1).all(), "leaves overlap"
        owner[y : y + height, x : x + width] = leaf
        assert_allclose(sums[leaf], score[y : y + height, x : x + width].sum(dtype=np.float64), rtol=1e-6, atol=1e-12)
    assert_array_equal(owner, tile_of)
    assert len(order) <= len(rects) // 2


def settle(cut: Cut, score: Float32, calls: int = 200) -> bool:
    """Whether the cut came to rest."""
    return any(cut.adjust(score, MANY) == 0 for _ in range(calls))


def uneven(size: tuple[int, int], seed: int) -> Float32:
    """Over three orders of magnitude, in patches, some of them zero."""
    random = np.random.default_rng(seed)
    coarse = np.exp(random.uniform(-7, 0, (-(-size[1] // 7), -(-size[0] // 9))))
    coarse[random.random(coarse.shape) < 0.1] = 0.0
    score = np.kron(coarse, np.ones((7, 9)))[: size[1], : size[0]] * random.uniform(0.5, 1.5, (size[1], size[0]))
    return score.astype(np.float32)


@pytest.mark.parametrize("size", SIZES)
def test_leaves_share_out_the_region_after_every_step(size: tuple[int, int], compiled_only: None) -> None:
    cut, random = Cut(*size), np.random.default_rng(3)
    check(cut, np.ones((size[1], size[0]), np.float32))
    for seed in range(6):
        score = uneven(size, seed)
        cut.balance(np.full_like(score, 0.01), float(random.uniform(0.0, 0.1)))
        for _ in range(40):
            steps = int(random.integers(1, 4))
            assert cut.adjust(score, steps) <= steps
            check(cut, score)


@pytest.mark.parametrize("size", [(100, 75), (150, 40)])
@pytest.mark.parametrize("seed", range(3))
def test_left_alone_the_leaves_come_to_about_equal_importance(
    size: tuple[int, int], seed: int, compiled_only: None
) -> None:
    """No leaf that could be split has more than SPLIT times the wanted sum, no two siblings less than MERGE times."""
    cut, score = Cut(*size), uneven(size, seed)
    cut.wanted = 40.0
    assert settle(cut, score)
    rects, sums, _, order = cut.tiles
    wanted = score.sum(dtype=np.float64) / 40
    assert (sums[order][rects[order, 2:].max(axis=1) >= 2 * LEAST_EDGE] <= kernels.SPLIT * wanted).all()
    parents = cut.tree.parent[order]
    for parent in {p for p in parents.tolist() if (parents == p).sum() == 2}:
        if rects[parent, 2:].max() <= MOST_EDGE:
            assert sums[order[parents == parent]].sum() >= kernels.MERGE * wanted


def test_a_single_hot_pixel_draws_small_leaves_to_it_and_lets_go_when_it_has_moved(compiled_only: None) -> None:
    """A leaf with all the importance is cut down to twice the least edge, and no further; leaves without any merge."""
    cut = Cut(64, 64)
    for at in ((40, 20), (3, 60), (63, 63)):
        score = np.zeros((64, 64), np.float32)
        score[at] = 1.0
        assert settle(cut, score)
        check(cut, score)
        widths = cut.tiles.rects[cut.tiles.order, 2:]
        assert cut.tiles.rects[cut.tiles.tile_of[at], 2:].max() < 2 * LEAST_EDGE
        assert len(cut.tiles.order) <= 2 * math.log2(64) + 2, "the rest is a few leaves along the way down"
        assert widths.max() >= 16


def test_where_nothing_is_to_be_gained_nothing_is_drawn_and_no_number_breaks(compiled_only: None) -> None:
    cut, score = Cut(100, 75), np.zeros((75, 100), np.float32)
    before = len(cut.tiles.order)
    cut.adjust(score, MANY)
    check(cut, score)
    assert len(cut.tiles.order) <= before
    cut.balance(score, 0.0)
    assert math.isfinite(cut.wanted)
    xy, pixels = np.zeros((160, 2), np.float32), Pixels(np.zeros((75, 100), np.uint16), 1, 0, 0)
    assert kernels_adaptive.draw(score, cut.tiles, pixels, 1, xy) == 0


def test_equal_calls_give_equal_cuts(compiled_only: None) -> None:
    cuts = [Cut(100, 75), Cut(100, 75)]
    for cut in cuts:
        for seed in range(4):
            cut.adjust(uneven((100, 75), seed), 7)
    assert_array_equal(*(cut.tiles.tile_of for cut in cuts))
    assert_array_equal(*(cut.tiles.order for cut in cuts))


@pytest.mark.parametrize("axis", [0, 1])
@pytest.mark.parametrize("seed", range(5))
def test_a_leaf_is_cut_across_its_longer_axis_at_the_weighted_median(axis: int, seed: int) -> None:
    """The NumPy twin: of all cuts the one that divides the sum most evenly, rounded to a block."""
    score = np.random.default_rng(seed).random((12, 70) if axis else (70, 12)).astype(np.float32) ** 4
    across = bool(axis)
    at = kernels.cut_at(score, 0, 0, score.shape[1], score.shape[0], across)
    before = np.append(0.0, np.cumsum(score.sum(axis=1 - axis, dtype=np.float64)))
    best = int(np.abs(before / before[-1] - 0.5).argmin())
    assert abs(at - min(max(best, LEAST_EDGE), 70 - LEAST_EDGE)) <= BLOCK // 2
    assert at % BLOCK == 0


@pytest.mark.parametrize("last", [False, True])
def test_a_leaf_is_cut_at_a_whole_block_at_least_the_least_edge_from_both_ends(last: bool) -> None:
    score = np.zeros((12, 30), np.float32)
    score[0, -1 if last else 0] = 1.0
    assert kernels.cut_at(score, 0, 0, 30, 12, True) == (16 if last else 12)


def test_with_a_floor_no_pixel_starves_beside_a_hot_one(compiled_only: None) -> None:
    """All but one pixel have 1 / 33,000 of the scores: of 100 draws of 16,000 rays they get 48 each on average."""
    score = np.full((48, 64), 1e-3, np.float32)
    score[10, 10] = 30.0
    cut, seen, pixels = Cut(64, 48), np.zeros((48, 64)), Pixels(np.zeros((48, 64), np.uint16), 1, 0, 0)
    xy = np.zeros((1000 * kernels_adaptive.PACKET, 2), np.float32)
    for sequence in range(100):
        cut.adjust(score, 5)
        filled = kernels_adaptive.draw(score, cut.tiles, pixels, sequence, xy)
        assert filled == len(xy)
        np.add.at(seen, (xy[:, 1].astype(int), xy[:, 0].astype(int)), 1)
    expected = seen.sum() * score / score.sum(dtype=np.float64)
    assert seen.min() > 0
    assert_allclose(seen[score < 1].mean(), expected[score < 1].mean(), rtol=0.02)


def settled_number(contrast: float, change: float, area: tuple[int, int] = (320, 200)) -> float:
    cut = Cut(*area)
    for _ in range(120):
        cut.balance(np.full(area[::-1], contrast**2, np.float32), change)
    return cut.wanted


def test_the_number_of_leaves_balances_change_over_a_tile_with_change_over_a_samples_life() -> None:
    """dC/ds S = K (dC/dt) T with S = sqrt(A / N): contrast 0.04, change 0.005, K = 200 make S = 25 pixels."""
    assert BALANCE == 200.0
    assert_allclose(settled_number(0.04, 0.005), 320 * 200 / 25**2, rtol=1e-4)


def test_change_in_time_makes_tiles_fewer_and_contrast_makes_them_more_within_bounds() -> None:
    area = 320 * 200
    assert settled_number(0.04, 0.006) < settled_number(0.04, 0.005) < settled_number(0.05, 0.005)
    for contrast, change, edge in ((0.04, 0.0, FINE), (0.0, 0.0, FINE), (0.04, 1.0, COARSE), (0.0, 0.1, COARSE)):
        assert_allclose(settled_number(contrast, change), area / edge**2, rtol=1e-4)


def test_the_number_of_leaves_moves_a_fixed_part_of_the_way_at_a_time() -> None:
    cut = Cut(320, 200)
    before, goal = cut.wanted, 320 * 200 / FINE**2
    cut.balance(np.ones((200, 320), np.float32), 0.0)
    assert_allclose(math.log(cut.wanted / before), GAIN * math.log(goal / before), rtol=1e-9)
