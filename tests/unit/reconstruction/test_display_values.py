"""Display values against exact sRGB."""

from __future__ import annotations

import numpy as np
import pytest

from wall.core.data import Float32, Float64
from wall.core.tone_mapping import AS_IT_IS, TONE_MAPPINGS, Tone
from wall.display.image_file import display_values
from wall.reconstruction.display_values import update_display

CODES_OFF = 1  # the stated bound of the curve's table
EVERY_TILE = np.ones((1, 1), np.bool_)


def exact_codes(linear: Float64) -> Float64:
    """sRGB of IEC 61966-2-1 in float64, scaled to 0..255, not rounded."""
    clipped = np.clip(linear, 0.0, 1.0)
    encoded = np.where(clipped <= 0.0031308, 12.92 * clipped, 1.055 * clipped ** (1 / 2.4) - 0.055)
    return np.asarray(255.0 * encoded, np.float64)


def displayed(radiance: Float32, tone: Tone = AS_IT_IS) -> np.ndarray[tuple[int, ...], np.dtype[np.uint8]]:
    rgb = np.zeros(radiance.shape, np.uint8)
    tile = max(radiance.shape[:2])
    assert update_display(radiance, EVERY_TILE, tile, rgb, tone=tone) == radiance.shape[0] * radiance.shape[1]
    return rgb


def test_every_half_float_is_within_one_code_of_exact_srgb(compiled_only: None) -> None:
    values = np.arange(65536, dtype=np.uint16).view(np.float16).astype(np.float32)
    values = values[~np.isnan(values)]
    image = np.zeros((256, 256, 3), np.float32)
    image.reshape(-1)[: len(values)] = values
    got = displayed(image).reshape(-1)[: len(values)].astype(float)
    exact = np.round(exact_codes(values.astype(np.float64)))
    assert np.abs(got - exact).max() <= CODES_OFF
    assert (got != exact).mean() < 0.02


def test_unrounded_error_stays_below_0_55_codes_where_the_curve_is_steepest() -> None:
    """A table step moves the curve by 0.09 codes at most, so nearest lookup adds 0.045 to rounding's half code."""
    values = np.linspace(0.0, 0.01, 3 * 33 * 31, dtype=np.float32).reshape(33, 31, 3)
    assert np.abs(displayed(values) - exact_codes(values.astype(np.float64))).max() < 0.55


def test_codes_never_fall_when_radiance_rises() -> None:
    values = np.repeat(np.linspace(0.0, 1.0, 900, dtype=np.float32), 3).reshape(30, 30, 3)
    assert (np.diff(displayed(values)[..., 0].ravel().astype(int)) >= 0).all()


@pytest.mark.parametrize(
    ("value", "code"),
    [(0.0, 0), (-0.0, 0), (-5.0, 0), (1.0, 255), (7.0, 255), (np.inf, 255), (-np.inf, 0), (np.nan, 0), (1e-40, 0)],
)
def test_out_of_range_and_nan_are_clipped_to_what_a_display_has(value: float, code: int) -> None:
    assert (displayed(np.full((1, 1, 3), value, np.float32)) == code).all()


def test_only_dirty_tiles_are_redone_and_the_last_ones_may_be_cut() -> None:
    radiance, rgb = np.ones((5, 7, 3), np.float32), np.zeros((5, 7, 3), np.uint8)
    dirty = np.array([[False, True], [True, False]])
    assert update_display(radiance, dirty, 4, rgb) == 4 * 3 + 1 * 4
    expected = np.zeros((5, 7), np.uint8)
    expected[:4, 4:] = expected[4:, :4] = 255
    np.testing.assert_array_equal(rgb, np.repeat(expected[:, :, None], 3, axis=2))


@pytest.mark.parametrize("mapping", TONE_MAPPINGS)
def test_an_image_shown_is_the_image_written_up_to_one_code(mapping: str) -> None:
    """Of colours from black to 60 times white: the wall's kernel in float32, files in float64."""
    random, tone = np.random.default_rng(2), Tone(1.5, mapping)
    radiance = (20.0 * random.random((40, 50, 3)) ** 5).astype(np.float32)
    shown, written = displayed(radiance, tone).astype(int), display_values(radiance, tone=tone)
    assert np.abs(shown - written).max() <= CODES_OFF
    assert (shown != written).mean() < 0.02
