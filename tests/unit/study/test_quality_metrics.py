"""Error measures: closed forms, and plain NumPy twins."""

from __future__ import annotations

import math

import numpy as np
import pytest

from wall.study.quality.metrics import Score, delay_of, display_values, flip, mean_square, ssim

FLOAT32_RMSE = 1e-6  # of values in 0..1, summed in float64


def test_display_values_are_the_srgb_curve_of_clipped_light() -> None:
    linear = np.array([-1.0, 0.0, 0.001, 0.0031308, 0.18, 1.0, 7.0], np.float32)
    clipped = np.clip(linear.astype(np.float64), 0, 1)
    expected = np.where(clipped <= 0.0031308, 12.92 * clipped, 1.055 * clipped ** (1 / 2.4) - 0.055)
    assert display_values(linear) == pytest.approx(expected, abs=FLOAT32_RMSE)


def test_mean_square_matches_its_definition(random_numbers: np.random.Generator) -> None:
    a, b = random_numbers.random((2, 8, 9, 3)).astype(np.float32)
    assert mean_square(a, b) == pytest.approx(float(np.mean((a.astype(np.float64) - b) ** 2)), rel=1e-5)
    assert mean_square(a[:0], b[:0]) == 0.0


def test_score_of_a_run_averages_squares_over_refreshes_and_keeps_each_error() -> None:
    score, black = Score(judged=frozenset()), np.zeros((4, 4, 3), np.float32)
    for light in (1.0, 0.0, 1.0, 1.0):
        score.add(np.full_like(black, light), black)
    assert score.over_time == pytest.approx([1.0, 0.0, 1.0, 1.0])
    assert (score.rmse, score.rmse_display) == (pytest.approx(math.sqrt(3 / 4)), pytest.approx(math.sqrt(3 / 4)))
    assert math.isnan(score.flip)


def test_linear_error_is_not_clipped_and_display_error_is() -> None:
    score, white = Score(judged=frozenset()), np.ones((2, 2, 3), np.float32)
    score.add(5.0 * white, white)
    assert (score.rmse, score.rmse_display) == (pytest.approx(4.0), 0.0)


def test_flicker_counts_changes_that_the_reference_does_not_have() -> None:
    steady, blinking, following = (Score(judged=frozenset()) for _ in range(3))
    black, white = np.zeros((2, 2, 3), np.float32), np.ones((2, 2, 3), np.float32)
    for k in range(5):
        steady.add(white, black)
        blinking.add((black, white)[k % 2], black)
        following.add((black, white)[k % 2], (black, white)[k % 2])
    assert (steady.flicker, blinking.flicker, following.flicker) == (0.0, pytest.approx(1.0), 0.0)


def test_the_noise_of_two_independent_references_cancels(random_numbers: np.random.Generator) -> None:
    """An error of 0.1 under references whose own noise is as large: one of them reads 0.14."""
    truth = np.full((128, 128, 3), 0.5, np.float32)
    one, other = (truth + random_numbers.normal(0.0, 0.1, truth.shape).astype(np.float32) for _ in range(2))
    both, single = (Score(judged=frozenset()) for _ in range(2))
    both.add(truth + np.float32(0.1), one, other)
    single.add(truth + np.float32(0.1), one)
    assert both.rmse == pytest.approx(0.1, rel=0.01)
    assert single.rmse == pytest.approx(0.1414, rel=0.01)


def test_flip_and_ssim_know_equal_images_and_order_worse_ones(random_numbers: np.random.Generator) -> None:
    reference = random_numbers.random((64, 64, 3)).astype(np.float32)
    noise = random_numbers.normal(size=reference.shape).astype(np.float32)
    near, far = (np.clip(reference + share * noise, 0, 1) for share in (0.05, 0.3))
    assert flip(reference, reference) == 0.0
    assert ssim(reference, reference) == pytest.approx(1.0)
    assert 0.0 < flip(near, reference) < flip(far, reference) < 1.0
    assert 1.0 > ssim(near, reference) > ssim(far, reference)


def test_judged_images_are_those_asked_for() -> None:
    reference = np.full((16, 16, 3), 0.5, np.float32)
    score = Score(judged=frozenset({1}))
    score.add(0 * reference, reference)
    assert math.isnan(score.flip)
    score.add(reference, reference)
    score.add(0 * reference, reference)
    assert (score.flip, score.ssim) == (0.0, pytest.approx(1.0))


@pytest.mark.parametrize(("error", "delay"), [(0.0, 0.0), (0.05, 10.0), (0.1, 20.0), (0.2, 30.0), (0.31, None)])
def test_delay_equivalent_is_read_off_the_delayed_references_own_errors(error: float, delay: float | None) -> None:
    found = delay_of(error, [0.0, 0.1, 0.3], 20.0)
    assert found == (None if delay is None else pytest.approx(delay))


def test_delay_equivalent_of_a_scene_where_nothing_moves_does_not_exist() -> None:
    assert delay_of(0.01, [0.0, 0.0, 0.0], 20.0) is None
