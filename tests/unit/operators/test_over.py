"""`over` against Porter and Duff's formula, back to front."""

from __future__ import annotations

import numpy as np
from framelets import applied, made, random_framelet, rect

from wall.core.data import ORIGIN_STEP_S, Framelet
from wall.operators.over import Over

OVER = made(Over, inputs=("a", "b", "c"))
ROUNDING = 1e-6  # three multiplications and additions of values up to 1


def back_to_front(inputs: list[Framelet]) -> tuple[np.ndarray, np.ndarray]:
    """The painter's order: every nearer one dims what is behind it; float64."""
    colour = np.zeros(inputs[0].colour.shape)
    alpha = np.zeros(inputs[0].channel("alpha").shape)
    for framelet in sorted(inputs, key=lambda f: -f.order):
        a = framelet.channel("alpha").astype(np.float64)
        colour = framelet.colour + (1 - a)[..., None] * colour
        alpha = a + (1 - a) * alpha
    return colour, alpha


def test_front_to_back_is_the_painters_back_to_front(random_numbers: np.random.Generator) -> None:
    inputs = [random_framelet(random_numbers, rect(0, 0, 9, 5), order=order) for order in (2, -1, 7)]
    out, (colour, alpha) = applied(OVER, *inputs), back_to_front(inputs)
    np.testing.assert_allclose(out.colour, colour, atol=ROUNDING)
    np.testing.assert_allclose(out.channel("alpha"), alpha, atol=ROUNDING)


def test_depth_object_and_time_are_of_the_first_that_can_be_seen(random_numbers: np.random.Generator) -> None:
    inputs = [random_framelet(random_numbers, rect(0, 0, 9, 5), order=order) for order in (0, 1)]
    inputs[1].refreshed_at = ORIGIN_STEP_S
    out = applied(OVER, *inputs)
    near, far = (framelet.channel("alpha") > 0 for framelet in inputs)
    for name, nothing in (("depth", np.inf), ("object_id", 0), ("time", -np.inf)):
        values = [framelet.channel(name) + (framelet.time_origin if name == "time" else 0) for framelet in inputs]
        expected = np.where(near, values[0], np.where(far, values[1], nothing))
        np.testing.assert_array_equal(out.channel(name), expected)


def test_variances_add_by_the_squared_share_in_the_colour() -> None:
    glass, wall = (Framelet.blank(rect(0, 0, 1, 1), frozenset({"alpha", "variance"}), order=k) for k in (0, 1))
    glass.channel("alpha")[...], glass.channel("variance")[...] = 0.25, 0.5
    wall.channel("alpha")[...], wall.channel("variance")[...] = 1.0, 4.0
    assert applied(OVER, glass, wall).channel("variance").item() == 0.5 + 0.75**2 * 4.0
    assert applied(OVER, wall, glass).channel("variance").item() == 0.5 + 0.75**2 * 4.0  # by order, not by place
    glass.channel("alpha")[...] = wall.channel("alpha")[...] = 0.0
    assert applied(OVER, wall, glass).channel("variance").item() == np.inf


def test_what_is_hidden_has_no_influence_not_even_if_it_is_nan() -> None:
    front, back = (Framelet.blank(rect(0, 0, 2, 2), frozenset({"alpha"}), order=k) for k in (0, 1))
    front.channel("alpha")[...] = 1.0
    front.colour[...] = 0.5
    back.colour[...] = np.nan
    back.channel("alpha")[...] = [[np.nan, 1.0], [np.inf, 0.3]]
    out = applied(OVER, front, back)
    assert (out.colour == 0.5).all()
    assert (out.channel("alpha") == 1.0).all()


def test_alpha_is_clipped_and_nan_is_nothing() -> None:
    only = Framelet.blank(rect(0, 0, 4, 1), frozenset({"alpha"}))
    only.colour[...] = 1.0
    only.channel("alpha")[...] = [[-0.5, 1.5, np.nan, 0.5]]
    out = applied(OVER, only)
    assert out.channel("alpha").tolist() == [[0.0, 1.0, 0.0, 0.5]]
    assert out.colour[0, :, 0].tolist() == [1.0, 1.0, 0.0, 1.0]


def test_inputs_that_do_not_meet_keep_their_pixels(random_numbers: np.random.Generator) -> None:
    left, right = (random_framelet(random_numbers, rect(x, 0, 3, 4)) for x in (0, 4))
    out = applied(OVER, left, right)
    np.testing.assert_array_equal(out.colour[:, :3], left.colour)
    np.testing.assert_array_equal(out.colour[:, 4:], right.colour)
    assert (out.colour[:, 3] == 0.0).all()
    assert (out.channel("alpha")[:, 3] == 0.0).all()
