"""`legend`: colours of a colour map, sharp and in their order, with numbers at their places."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from framelets import applied, by_regions, made, random_framelet, rect
from pydantic import ValidationError

from wall.core.color_maps import ColorMap
from wall.core.colour import srgb_decoded
from wall.core.data import Framelet
from wall.operators.legend import Legend

UPRIGHT, LYING = (12, 30, 60, 120), (12, 30, 160, 48)
MAP = {"name": "viridis", "range": [0.0, 10.0]}


def legend(**keys: object) -> Legend:
    operator = made(Legend, input="a", color_map=MAP, size=10, **keys)
    assert isinstance(operator, Legend)
    return operator


def black(*, encoded: bool = True) -> Framelet:
    return Framelet.blank(rect(0, 10, 200, 160), frozenset({"colour"}), encoded=encoded)


def bar_of(image: Framelet, operator: Legend) -> np.ndarray:
    """(h, w, 3) sRGB codes of the pixels that have colours of the map, in its bounding box."""
    table = np.round(255 * operator.color_map.table())
    shown = (np.abs(image.colour[..., None, :].astype(float) - table) <= 1.0).all(axis=3).any(axis=2)
    rows, columns = np.flatnonzero(shown.any(axis=1)), np.flatnonzero(shown.any(axis=0))
    return np.asarray(image.colour[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1])


@pytest.mark.parametrize("area", [UPRIGHT, LYING])
def test_the_whole_map_is_shown_from_its_lower_end_to_its_upper(area: tuple[int, int, int, int]) -> None:
    """Upright the upper end is above; across the bar all pixels are one colour."""
    operator = legend(area=area)
    bar = bar_of(applied(operator, black()), operator)
    upright = area is UPRIGHT
    along = bar[::-1, bar.shape[1] // 2] if upright else bar[bar.shape[0] // 2]
    expected = 255 * operator.color_map.table()
    places = np.linspace(0, len(expected) - 1, len(along))
    smooth = np.stack([np.interp(places, np.arange(len(expected)), expected[:, k]) for k in range(3)], axis=1)
    assert len(along) > 60
    assert np.abs(along - smooth).max() <= 1.0
    assert (np.ptp(bar, axis=1 if upright else 0) == 0).all()


@pytest.mark.parametrize("encoded", [False, True])
def test_only_its_area_changes_and_linear_and_encoded_images_show_the_same(
    encoded: bool, random_numbers: np.random.Generator
) -> None:
    channels = frozenset({"depth", "alpha"})
    source = random_framelet(random_numbers, rect(0, 10, 200, 160), encoded=encoded, channels=channels)
    operator = legend(area=UPRIGHT, title="heat, K")
    out = applied(operator, source)
    x, y, width, height = UPRIGHT
    inside = np.zeros((160, 200), np.bool_)
    inside[y - 10 : y - 10 + height, x : x + width] = True
    np.testing.assert_array_equal(out.colour[~inside], source.colour[~inside])
    np.testing.assert_array_equal(out.channel("depth"), source.channel("depth"))
    assert (out.channel("alpha")[inside] >= 0.6 - 1e-6).all()
    codes, linear = applied(operator, black()), applied(operator, black(encoded=False))
    opaque = np.zeros_like(inside)
    opaque[inside] = operator.prepare(Path(), []).cover.ravel() == 1.0
    assert opaque.sum() > 500
    np.testing.assert_allclose(linear.colour[opaque], srgb_decoded(codes.colour[opaque] / 255.0), atol=5e-3)


def test_it_is_the_same_however_the_image_is_cut(random_numbers: np.random.Generator) -> None:
    source = random_framelet(random_numbers, rect(0, 10, 200, 160), channels=frozenset({"colour"}))
    operator = legend(area=LYING, title="heat")
    whole = applied(operator, source)
    parts = by_regions(operator, [source], ([20, 77], [51, 52]), whole, Path())
    np.testing.assert_array_equal(parts.colour, whole.colour)


@pytest.mark.parametrize(
    ("keys", "most", "numbers"),
    [
        ({"range": [0.0, 240.0]}, 6, [0.0, 50.0, 100.0, 150.0, 200.0]),
        ({"range": [-0.3, 0.3]}, 3, [-0.2, 0.0, 0.2]),
        ({"range": [1e-3, 1e3], "scale": "log"}, 4, [1e-3, 1e-1, 1e1, 1e3]),
        ({"range": [2.0, 7.0], "scale": "log"}, 4, [2.0, 7.0]),
    ],
)
def test_numbers_are_round_and_have_room(keys: dict[str, object], most: int, numbers: list[float]) -> None:
    operator = made(Legend, input="a", color_map=keys, area=UPRIGHT, size=10)
    assert isinstance(operator, Legend)
    assert operator._numbers(most) == pytest.approx(numbers)


def test_a_legend_needs_a_range_and_room() -> None:
    with pytest.raises(ValidationError, match="has no range"):
        made(Legend, input="a", color_map={"name": "gray"}, area=UPRIGHT)
    with pytest.raises(ValidationError, match="is 60 x 39 pixels, too little for text of 10"):
        legend(area=(0, 0, 60, 39))
    with pytest.raises(ValidationError, match=r"60 pixels wide, and the title takes [0-9]+ at size 10"):
        legend(area=(0, 0, 60, 90), title="temperature of the water")
    with pytest.raises(ValidationError, match=r"50 pixels high, of which the title takes 4[0-9] and the numbers 20"):
        legend(area=(0, 0, 90, 50), title="heat\nof\nwater")


def test_numbers_outside_and_missing_ones_have_the_colours_that_are_said() -> None:
    values = np.array([-1.0, 0.0, 10.0, 11.0, np.nan])
    plain = ColorMap(range=(0.0, 10.0)).colors(values)
    ends = srgb_decoded(ColorMap().table()[[0, -1]])
    np.testing.assert_allclose(plain, [ends[0], ends[0], ends[1], ends[1], (0.6, 0.0, 0.6)], atol=1e-6)
    said = ColorMap(range=(0.0, 10.0), below=(1.0, 0.0, 0.0), above=(0.0, 0.0, 1.0), missing=(0.0, 1.0, 0.0))
    np.testing.assert_allclose(said.colors(values)[[0, 3, 4]], [(1, 0, 0), (0, 0, 1), (0, 1, 0)])
    np.testing.assert_allclose(said.colors(values)[1:3], ends, atol=1e-6)


def test_maps_are_reversed_logarithmic_and_span_what_they_are_given() -> None:
    table = srgb_decoded(ColorMap().table())
    values = np.array([1.0, 10.0, 100.0, 0.0])
    np.testing.assert_allclose(ColorMap(reversed=True).colors(values[:3])[[0, 2]], table[[-1, 0]], atol=1e-6)
    found = ColorMap(scale="log").colors(values)
    middle = srgb_decoded((ColorMap().table()[127] + ColorMap().table()[128]) / 2.0)
    np.testing.assert_allclose(found, [table[0], middle, table[-1], (0.6, 0.0, 0.6)], atol=1e-6)
    assert ColorMap().over(np.full(3, 7.0)).range == (6.5, 7.5)
    assert ColorMap().over(np.array([np.nan])).range == (0.0, 1.0)
    with pytest.raises(ValidationError, match="has no logarithm"):
        ColorMap(scale="log", range=(0.0, 1.0))
