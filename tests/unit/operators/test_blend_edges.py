"""`blend_edges`: what overlapping projectors emit sums to what one emits alone."""

from __future__ import annotations

import numpy as np
import pytest
from framelets import applied, made, random_framelet, rect
from pydantic import ValidationError

from wall.core.colour import srgb_encoded
from wall.core.data import Float64, Framelet, Rect
from wall.operators.blend_edges import BlendEdges, shares
from wall.operators.colour import Encode

LIGHT = [0.002, 0.18, 1.0]  # linear red, green, blue
CODE = 1 / 255


def lit(where: Rect, light: list[float]) -> Framelet:
    made_of = Framelet.blank(where, frozenset())
    made_of.colour[...] = light
    return made_of


def emitted(values: Float64, gamma: float) -> Float64:
    """Light of a display that is sent values in 0..1."""
    return np.clip(values, 0.0, 1.0) ** gamma


@pytest.mark.parametrize("gamma", [1.0, 1.8, 2.2, 2.6])
@pytest.mark.parametrize("light", [LIGHT, [0.5, 3.0, 40.0]])
def test_light_sums_to_one_image_across_an_overlap(gamma: float, light: list[float]) -> None:
    """Two projectors 30 pixels wide that overlap by 12."""
    left = applied(made(BlendEdges, input="a", right=12, gamma=gamma), lit(rect(0, 0, 30, 2), light))
    right = applied(made(BlendEdges, input="a", left=12, gamma=gamma), lit(rect(18, 0, 30, 2), light))
    total = np.zeros((2, 48, 3))
    for each in (left, right):
        total[each.rect.inside(rect(0, 0, 48, 2))] += emitted(srgb_encoded(each.colour.astype(np.float64)), gamma)
    alone = emitted(srgb_encoded(np.float64(light)), gamma)
    np.testing.assert_allclose(total, np.broadcast_to(alone, total.shape), rtol=1e-5, atol=1e-6)


def test_light_sums_to_one_where_four_projectors_overlap() -> None:
    total = np.zeros((20, 30, 3))
    for x, y, sides in ((0, 0, ("right", "bottom")), (10, 0, ("left", "bottom")), (0, 8, ("right", "top")),
                        (10, 8, ("left", "top"))):  # fmt: skip
        widths = {side: 10 if side in ("left", "right") else 4 for side in sides}
        one = applied(made(BlendEdges, input="a", gamma=2.2, **widths), lit(rect(x, y, 20, 12), LIGHT))
        total[one.rect.inside(rect(0, 0, 30, 20))] += emitted(srgb_encoded(one.colour.astype(np.float64)), 2.2)
    alone = emitted(srgb_encoded(np.float64(LIGHT)), 2.2)
    np.testing.assert_allclose(total, np.broadcast_to(alone, total.shape), rtol=1e-5)


def test_with_codes_of_8_bits_the_sum_is_off_by_their_rounding_only() -> None:
    """Each of two codes is off by one at most (encode's bound), which is light of at most gamma codes."""
    total = np.zeros((1, 24, 3))
    for x, side in ((0, "right"), (0, "left")):
        ramp = applied(made(BlendEdges, input="a", **{side: 24}), lit(rect(x, 0, 24, 1), LIGHT))
        total += emitted(applied(made(Encode, input="a"), ramp, encoded=True).colour / 255.0, 2.2)
    assert np.abs(total - emitted(srgb_encoded(np.float64(LIGHT)), 2.2)).max() <= 2 * 2.2 * CODE


def test_pixels_beside_the_ramps_are_not_changed(random_numbers: np.random.Generator) -> None:
    source = random_framelet(random_numbers, rect(0, 0, 20, 10))
    source.colour *= 5.0
    out = applied(made(BlendEdges, input="a", left=6, bottom=3), source)
    np.testing.assert_array_equal(out.colour[:7, 6:], source.colour[:7, 6:])
    np.testing.assert_array_equal(out.channel("depth"), source.channel("depth"))
    assert "variance" not in out.channels


def test_shares_of_two_ramps_sum_to_one_and_never_fall_towards_the_middle() -> None:
    for width in (1, 2, 7, 100):
        rising, falling = shares(width, width, 0), shares(width, 0, width)
        np.testing.assert_allclose(rising + falling, 1.0, atol=1e-15)
        assert (np.diff(rising) >= 0).all()


def test_a_blend_without_ramps_is_refused() -> None:
    with pytest.raises(ValidationError):
        made(BlendEdges, input="a")
