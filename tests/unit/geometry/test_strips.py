"""Strips between cuts: every pixel is one rank's, cuts lie where they may, and cost is divided evenly."""

from __future__ import annotations

import numpy as np
import pytest

from wall.core.data import Rect, Region
from wall.core.errors import RemoteProtocolError
from wall.geometry.strips import LEAST_ROWS, STEP, Strips, equal_cost


def strips(*sizes):
    return Strips(
        tuple(
            Region(panel=10 + k, layer=k, rect=Rect(x=0, y=0, width=width, height=height))
            for k, (width, height) in enumerate(sizes)
        )
    )


@pytest.mark.parametrize("seed", range(50))
def test_every_pixel_is_one_ranks_wherever_the_cuts_are_wanted(seed):
    rng = np.random.default_rng(seed)
    sizes = [(int(w), int(h)) for w, h in rng.integers(1, 300, (rng.integers(1, 6), 2))]
    own = strips(*sizes)
    ranks = int(rng.integers(1, own.most_ranks + 1))
    rows = sum(height for _, height in sizes)
    cuts = own.nearest(np.sort(rng.random(ranks + 1)) ** rng.integers(1, 8) * rows)
    regions = own.regions(cuts)
    assert len(regions) == ranks
    seen = [np.zeros(size[::-1], int) for size in sizes]
    for region in (region for of_rank in regions for region in of_rank):
        rect = region.rect
        seen[region.layer][rect.y : rect.bottom, rect.x : rect.right] += 1
        whole = rect.height == sizes[region.layer][1]
        assert whole or (rect.height >= LEAST_ROWS and (rect.y % STEP == 0))
    assert all((image == 1).all() for image in seen)
    assert all(len({region.layer for region in of_rank}) == len(of_rank) for of_rank in regions)


@pytest.mark.parametrize("ranks", [1, 2, 3, 5, 8])
def test_even_cuts_are_even(ranks):
    cuts = strips((64, 480), (64, 480)).evenly(ranks)
    assert np.abs(np.diff(cuts) - 960 / ranks).max() <= LEAST_ROWS


def test_a_ranks_regions_tell_their_first_rows():
    own = strips((64, 100), (64, 50), (64, 100))
    ((first,), (second, third, fourth)) = own.regions((0, 64, 250))
    assert [own.top(region) for region in (first, second, third, fourth)] == [0, 64, 100, 150]
    assert [region.panel for region in (first, second, third, fourth)] == [10, 10, 11, 12]


@pytest.mark.parametrize("cuts", [(0, 100), (0, 1, 250), (0, 64, 32, 250), (16, 64, 250), (), (0,)])
def test_cuts_that_no_manager_gives_are_refused(cuts):
    with pytest.raises(RemoteProtocolError, match="cuts"):
        strips((64, 100), (64, 50), (64, 100)).regions(cuts)


def test_a_rank_between_equal_cuts_has_no_strip():
    assert [len(regions) for regions in strips((64, 100), (64, 50)).regions((0, 64, 64, 150))] == [1, 0, 2]


def test_rows_between_cuts_cost_the_same():
    rows = np.random.default_rng(1).random(1000) ** 8 + 1e-6
    cuts = equal_cost(rows, 7)
    total = np.concatenate([[0.0], np.cumsum(rows)])
    costs = np.diff(np.interp(cuts, np.arange(1001), total))
    assert costs == pytest.approx(rows.sum() / 7, rel=1e-9)
