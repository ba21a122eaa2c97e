"""`average` and `age_blend` against weighted means in float64."""

from __future__ import annotations

import numpy as np
import pytest
from framelets import applied, assert_equal, made, random_framelet, rect

from wall.core.data import ORIGIN_STEP_S, Framelet
from wall.operators.means import AgeBlend, Average

AVERAGE = made(Average, inputs=("a", "b", "c"))
PLAIN = frozenset({"colour", "depth", "alpha"})
ROUNDING = 1e-6  # a few operations on values up to 1


def test_average_is_the_mean_of_those_that_cover_a_pixel(random_numbers: np.random.Generator) -> None:
    left = random_framelet(random_numbers, rect(0, 0, 6, 4), channels=PLAIN)
    right = random_framelet(random_numbers, rect(4, 0, 6, 4), channels=PLAIN)
    out = applied(AVERAGE, left, right)
    np.testing.assert_array_equal(out.colour[:, :4], left.colour[:, :4])
    np.testing.assert_array_equal(out.colour[:, 6:], right.colour[:, 2:])
    middle = (left.colour[:, 4:].astype(np.float64) + right.colour[:, :2]) / 2
    np.testing.assert_allclose(out.colour[:, 4:6], middle, atol=ROUNDING)
    mixed = (left.channel("alpha")[:, 4:] + right.channel("alpha")[:, :2]) / 2
    np.testing.assert_allclose(out.channel("alpha")[:, 4:6], mixed, atol=ROUNDING)
    np.testing.assert_array_equal(out.channel("depth")[:, 4:6], left.channel("depth")[:, 4:])  # of equals the earlier


def test_weights_are_one_over_the_variance(random_numbers: np.random.Generator) -> None:
    inputs = [random_framelet(random_numbers, rect(0, 0, 8, 8)) for _ in range(3)]
    out = applied(AVERAGE, *inputs)
    variances = np.stack([framelet.channel("variance") for framelet in inputs]).astype(np.float64)
    weights = 1 / variances
    weights[:, np.isinf(variances).all(axis=0)] = 1.0
    colours = np.stack([framelet.colour for framelet in inputs]).astype(np.float64)
    np.testing.assert_allclose(out.colour, (colours * weights[..., None]).sum(0) / weights.sum(0)[..., None], atol=1e-5)
    with np.errstate(divide="ignore"):
        expected = 1 / (1 / variances).sum(axis=0)
    np.testing.assert_allclose(out.channel("variance"), expected, rtol=1e-5)
    heaviest = weights.argmax(axis=0)
    objects = np.stack([framelet.channel("object_id") for framelet in inputs])
    np.testing.assert_array_equal(out.channel("object_id"), np.take_along_axis(objects, heaviest[None], 0)[0])


@pytest.mark.parametrize("useless", [np.inf, np.nan, -1.0])
def test_an_input_without_a_use_does_not_count(useless: float) -> None:
    one, other = (Framelet.blank(rect(0, 0, 1, 1), frozenset({"variance"})) for _ in range(2))
    one.colour[...], other.colour[...] = 0.25, 100.0
    one.channel("variance")[...], other.channel("variance")[...] = 2.0, useless
    out = applied(AVERAGE, other, one)
    assert (out.colour == 0.25).all()
    assert out.channel("variance").item() == 2.0


def test_values_without_variance_outweigh_all_others() -> None:
    exact = [Framelet.blank(rect(0, 0, 1, 1), frozenset({"variance"})) for _ in range(3)]
    for framelet, value, variance in zip(exact, (1.0, 3.0, 500.0), (0.0, 0.0, 1e-3), strict=True):
        framelet.colour[...], framelet.channel("variance")[...] = value, variance
    out = applied(AVERAGE, *exact)
    assert (out.colour == 2.0).all()
    assert out.channel("variance").item() < 1e-15


def test_means_of_large_values_do_not_cancel() -> None:
    """Sums of values near 1e8 in float32 would lose 64 of what they differ by after 16 of them."""
    inputs = [Framelet.blank(rect(0, 0, 1, 1), frozenset()) for _ in range(16)]
    for k, framelet in enumerate(inputs):
        framelet.colour[...] = 1e8 + 8.0 * (k % 2)
    assert np.abs(applied(AVERAGE, *inputs).colour - (1e8 + 4.0)).max() <= 8.0


def test_a_single_input_stays_as_it_is(random_numbers: np.random.Generator) -> None:
    only = random_framelet(random_numbers, rect(0, 0, 5, 4), channels=PLAIN)
    assert_equal(applied(AVERAGE, only), only)


@pytest.mark.parametrize("now", [0.0, 1e4])
def test_ages_weigh_by_their_exponential(now: float, random_numbers: np.random.Generator) -> None:
    tau = 0.4
    inputs = [random_framelet(random_numbers, rect(0, 0, 7, 6)) for _ in range(3)]
    for k, framelet in enumerate(inputs):
        framelet.channel("time")[...] += 0.25 * k
        framelet.refreshed_at = now
        framelet.stamp(now + k * ORIGIN_STEP_S)
    out = applied(made(AgeBlend, inputs=("a", "b", "c"), tau_s=tau), *inputs, refreshed_at=now)
    times = np.stack([framelet.channel("time") + k * ORIGIN_STEP_S for k, framelet in enumerate(inputs)])
    times = times.astype(np.float64)
    weights = np.exp(-(1.0 - times) / tau)  # seen one second after `now`
    total = weights.sum(axis=0)
    colours = np.stack([framelet.colour for framelet in inputs]).astype(np.float64)
    with np.errstate(invalid="ignore"):
        mean = (colours * weights[..., None]).sum(axis=0) / total[..., None]
    np.testing.assert_allclose(out.colour, np.where(total[..., None] > 0, mean, 0.0), atol=1e-5)
    np.testing.assert_array_equal(out.channel("time"), times.max(axis=0).astype(np.float32))


def test_what_was_never_traced_counts_nothing_and_nan_times_neither() -> None:
    inputs = [Framelet.blank(rect(0, 0, 2, 1), frozenset({"time"})) for _ in range(3)]
    for k, times in enumerate(([-1.0, -np.inf], [np.nan] * 2, [-np.inf] * 2)):
        inputs[k].colour[...], inputs[k].channel("time")[...] = k + 1.0, [times]
    out = applied(made(AgeBlend, inputs=("a", "b", "c"), tau_s=1.0), *inputs)
    assert out.colour[0, :, 0].tolist() == [1.0, 0.0]
    assert out.channel("time").tolist() == [[-1.0, -np.inf]]
