"""Every operator gives the same pixels region by region as at once."""

from __future__ import annotations

import numpy as np
import pytest
from framelets import applied, assert_equal, by_regions, made, random_framelet, rect
from hypothesis import given
from hypothesis import strategies as st

from wall.operators.base import Operator
from wall.operators.crop import Crop
from wall.operators.depth import Depth
from wall.operators.encode import Encode
from wall.operators.newest import Newest
from wall.operators.over import Over
from wall.operators.tile import Tile

THREE = ("a", "b", "c")
CASES: dict[str, tuple[Operator, int]] = {  # the operator, and how many inputs it gets
    "crop": (made(Crop, input="a", area=(-1, 1, 9, 9)), 1),
    "depth": (made(Depth, inputs=THREE), 3),
    "encode": (made(Encode, input="a"), 1),
    "newest": (made(Newest, inputs=THREE), 3),
    "over": (made(Over, inputs=THREE), 3),
    "tile": (made(Tile, inputs=THREE), 3),
}
cuts = st.lists(st.integers(-4, 20), max_size=4)


@pytest.mark.parametrize("name", CASES)
@given(xs=cuts, ys=cuts, seed=st.integers(0, 9))
def test_region_by_region_equals_the_whole(name: str, xs: list[int], ys: list[int], seed: int) -> None:
    operator, count = CASES[name]
    rng = np.random.default_rng(seed)
    places = [rect(0, 0, 11, 9), rect(2, -3, 11, 9), rect(-4, 2, 7, 8)]
    inputs = [random_framelet(rng, place, order=(3 * k) % 2) for k, place in enumerate(places[:count])]
    for k, framelet in enumerate(inputs):
        framelet.moment = 0.3 * k
    whole = applied(operator, *inputs, encoded=name == "encode", moment=0.2)
    assert_equal(by_regions(operator, inputs, (xs, ys), whole), whole)
