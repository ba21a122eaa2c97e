"""`tile` and `crop`: values at their places, unchanged."""

from __future__ import annotations

import numpy as np
import pytest
from framelets import applied, assert_equal, made, random_framelet, rect
from pydantic import ValidationError

from wall.core.data import BLANK, ORIGIN_STEP_S, Framelet
from wall.operators.arrange import Crop, Tile


@pytest.mark.parametrize("encoded", [False, True])
def test_tile_puts_each_input_at_its_place(encoded: bool, random_numbers: np.random.Generator) -> None:
    left = random_framelet(random_numbers, rect(10, 5, 4, 3), encoded=encoded)
    right = random_framelet(random_numbers, rect(15, 4, 2, 6), encoded=encoded)
    out = applied(made(Tile, inputs=("a", "b")), left, right)
    assert out.rect == rect(10, 4, 7, 6)
    for name in out.channels:
        whole = np.full_like(out.channel(name), BLANK[name][0] if name in BLANK else 0)
        whole[1:4, 0:4], whole[:, 5:7] = left.channel(name), right.channel(name)
        np.testing.assert_array_equal(out.channel(name), whole)


def test_times_are_counted_from_the_outputs_origin() -> None:
    one, other = (Framelet.blank(rect(x, 0, 1, 1), frozenset({"time"})) for x in (0, 1))
    one.refreshed_at, other.refreshed_at = 2 * ORIGIN_STEP_S, 4.5 * ORIGIN_STEP_S
    one.channel("time")[...] = -2.0
    out = applied(made(Tile, inputs=("a", "b")), one, other, refreshed_at=3.5 * ORIGIN_STEP_S)
    assert out.channel("time").tolist() == [[-2.0 - ORIGIN_STEP_S, -np.inf]]


def test_channels_that_one_input_lacks_are_not_given() -> None:
    operator = made(Tile, inputs=("a", "b"))
    given = operator.gives([frozenset({"colour", "depth", "alpha"}), frozenset({"colour", "depth"})])
    assert given == {"colour", "depth"}


@pytest.mark.parametrize("encoded", [False, True])
def test_crop_keeps_its_area_and_is_blank_beside_the_input(encoded: bool, random_numbers: np.random.Generator) -> None:
    source = random_framelet(random_numbers, rect(2, 1, 8, 6), encoded=encoded)
    inner = applied(made(Crop, input="a", area=(4, 2, 3, 4)), source)
    assert inner.rect == rect(4, 2, 3, 4)
    for name in inner.channels:
        np.testing.assert_array_equal(inner.channel(name), source.channel(name)[1:5, 2:5])
    beyond = applied(made(Crop, input="a", area=(8, 5, 4, 4)), source)
    np.testing.assert_array_equal(beyond.colour[:2, :2], source.colour[4:, 6:])
    assert_equal(
        applied(made(Crop, input="a", area=(10, 5, 2, 4)), source),
        Framelet.blank(rect(10, 5, 2, 4), source.channels, encoded=encoded),
    )


def test_crop_needs_an_area_or_a_panel() -> None:
    assert made(Crop, input="a", panel="left").rect([rect(1, 2, 3, 4)]) == rect(1, 2, 3, 4)
    for keys in ({}, {"area": (0, 0, 1, 1), "panel": "left"}, {"area": (0, 0, 0, 1)}):
        with pytest.raises(ValidationError):
            made(Crop, input="a", **keys)
