"""Curves that bring light into what displays show, against their published formulas in float64."""

from __future__ import annotations

import numpy as np
import pytest

from wall.core.data import Float64
from wall.core.kernels import tone_mapping as kernels
from wall.core.tone_mapping import CODES, TONE_MAPPINGS, WHITES, tone_mapped

CURVES = TONE_MAPPINGS[1:]
ROUNDING = 1e-5  # of float32, through a dozen operations


def published(light: Float64, mapping: str) -> Float64:
    """(n, 3): Reinhard et al. 2002, eq. 3; Narkowicz 2016; Khronos PBR Neutral 2024; of light of 0 or more."""
    if mapping == "reinhard":
        return light / (1.0 + light)
    if mapping == "aces":
        x = light
        return np.clip(x * (2.51 * x + 0.03) / (x * (2.43 * x + 0.59) + 0.14), 0.0, 1.0)
    start, desaturation = 0.8 - 0.04, 0.15
    least = light.min(axis=1, keepdims=True)
    light = light - np.where(least < 0.08, least - 6.25 * least**2, 0.04)
    peak = light.max(axis=1, keepdims=True)
    new = 1.0 - (1.0 - start) ** 2 / (np.maximum(peak, start) + (1.0 - start) - start)
    share = 1.0 / (desaturation * (peak - new) + 1.0)
    mapped = light * new / np.maximum(peak, start) * share + new * (1.0 - share)
    return np.asarray(np.where(peak < start, light, mapped), np.float64)


@pytest.mark.parametrize("mapping", CURVES)
def test_curves_are_as_published_for_any_colour(mapping: str) -> None:
    light = 30.0 * np.random.default_rng(1).random((5000, 3)) ** 6
    light[:1000] = light[:1000, :1]  # greys
    np.testing.assert_allclose(tone_mapped(light, mapping), published(light, mapping), atol=ROUNDING)


@pytest.mark.parametrize("mapping", CURVES)
def test_black_stays_black_nothing_is_above_white_and_more_light_is_never_shown_darker(mapping: str) -> None:
    grey = np.concatenate([[0.0], np.geomspace(1e-6, 1e9, 4000)])
    for colour in ([1.0, 1.0, 1.0], [1.0, 0.5, 0.0], [0.05, 0.2, 1.0]):
        shown = tone_mapped(grey[:, None] * np.array(colour), mapping)
        assert not shown[0].any()
        assert (shown.min(), shown.max() <= 1.0) == (0.0, True)
        assert (np.diff(shown.max(axis=1)) >= -ROUNDING).all()
    shown = tone_mapped(np.array([[np.nan, -1.0, 0.0], [np.inf, np.inf, np.inf]]), mapping)
    np.testing.assert_allclose(shown, [[0.0] * 3, [1.0] * 3], atol=ROUNDING)
    white = tone_mapped(np.full(3, min(WHITES[CODES[mapping]], 1e6)), mapping)
    assert white == pytest.approx(1.0, abs=ROUNDING)


def test_neutral_keeps_colours_below_the_knee_but_for_a_reflection() -> None:
    light = np.array([[0.1, 0.5, 0.79], [0.08, 0.09, 0.3]])
    np.testing.assert_allclose(tone_mapped(light, "khronos_neutral"), light - 0.04, atol=ROUNDING)


def test_light_is_mapped_without_its_alpha_in_dirty_tiles_alone() -> None:
    light = np.array([0.2, 2.0, 5.0])
    alpha = np.array([[1.0, 0.25, 0.0], [1.0, 1.0, 1.0]], np.float32)
    colour = (alpha[..., None] * light).astype(np.float32)
    before = colour.copy()
    kernels.map_tiles(colour, alpha, np.array([[True, True], [True, False]]), 2, CODES["khronos_neutral"])
    np.testing.assert_allclose(colour, alpha[..., None] * tone_mapped(light, "khronos_neutral"), atol=ROUNDING)
    colour[...] = before
    kernels.map_tiles(colour, alpha, np.array([[False, True]]), 2, CODES["aces"])
    np.testing.assert_array_equal(colour[:, :2], before[:, :2])
    np.testing.assert_allclose(colour[1, 2], tone_mapped(light, "aces"), atol=ROUNDING)
