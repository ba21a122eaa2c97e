"""`scale` against Pillow's resampling and against exact areas."""

from __future__ import annotations

import numpy as np
import pytest
from framelets import applied, made, random_framelet, rect
from PIL import Image
from pydantic import ValidationError

from wall.core.data import Float32, Float64, Framelet
from wall.operators.scale import Scale

ROUNDING = 2e-6  # sums of some ten float32 products of values up to 1
PILLOWS = {
    "triangle": Image.Resampling.BILINEAR,
    "catmull_rom": Image.Resampling.BICUBIC,
    "lanczos3": Image.Resampling.LANCZOS,
}
FILTERS = ["box", *PILLOWS]
SIZES = [(5, 7), (11, 9), (40, 3), (23, 31), (1, 1)]


def scaled(values: Float32, size: tuple[int, int], shape: str) -> Float32:
    """(h, w) float32 through the operator."""
    source = Framelet.blank(rect(0, 0, values.shape[1], values.shape[0]), frozenset())
    source.colour[...] = values[..., None]
    return applied(made(Scale, input="a", size=size, filter=shape), source).colour[..., 1]


def mean_of_area(values: Float32, size: tuple[int, int]) -> Float64:
    """Through integrals: of an image of constant pixels they are linear between pixel corners."""
    integral = np.zeros((values.shape[0] + 1, values.shape[1] + 1))
    integral[1:, 1:] = values.astype(np.float64).cumsum(axis=0).cumsum(axis=1)
    ys, xs = (np.linspace(0, n, m + 1) for n, m in zip(values.shape, size[::-1], strict=True))
    columns = np.stack([np.interp(xs, np.arange(values.shape[1] + 1), row) for row in integral])
    both = np.stack([np.interp(ys, np.arange(values.shape[0] + 1), column) for column in columns.T], axis=1)
    return np.diff(np.diff(both, axis=0), axis=1) / (np.diff(ys)[:, None] * np.diff(xs))


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("shape", PILLOWS)
def test_filters_are_pillows(shape: str, size: tuple[int, int], random_numbers: np.random.Generator) -> None:
    values = random_numbers.random((9, 11), np.float32)
    expected = np.asarray(Image.fromarray(values).resize(size, PILLOWS[shape]))
    np.testing.assert_allclose(scaled(values, size, shape), expected, atol=ROUNDING)


@pytest.mark.parametrize("size", SIZES)
def test_box_is_the_mean_of_the_area(size: tuple[int, int], random_numbers: np.random.Generator) -> None:
    values = random_numbers.random((9, 11), np.float32)
    np.testing.assert_allclose(scaled(values, size, "box"), mean_of_area(values, size), atol=ROUNDING)


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("shape", FILTERS)
def test_constants_stay(shape: str, size: tuple[int, int]) -> None:
    np.testing.assert_allclose(scaled(np.full((9, 11), 0.7, np.float32), size, shape), 0.7, atol=ROUNDING)


@pytest.mark.parametrize("shape", FILTERS)
def test_stripes_finer_than_the_new_pixels_become_grey(shape: str) -> None:
    """Stripes of one pixel are above the new limit eightfold: without wider support they would alias."""
    stripes = np.tile(np.float32([0.0, 1.0]), (64, 32))
    grey = scaled(stripes, (8, 8), shape)
    assert np.abs(grey[:, 1:-1] - 0.5).max() < 0.02


def test_the_frame_is_scaled_about_its_origin_so_neighbours_stay_neighbours() -> None:
    half = made(Scale, input="a", factor=0.5, filter="box")
    assert half.rect([rect(0, 0, 40, 20)]) == rect(0, 0, 20, 10)
    assert half.rect([rect(40, 20, 40, 20)]) == rect(20, 10, 20, 10)
    assert half.rect([rect(0, 0, 1, 1)]) == rect(0, 0, 1, 1)
    assert made(Scale, input="a", size=(80, 10), filter="box").rect([rect(40, 20, 40, 20)]) == rect(80, 10, 80, 10)


def test_what_cannot_be_mixed_is_of_the_pixel_at_the_centre(random_numbers: np.random.Generator) -> None:
    source = random_framelet(random_numbers, rect(0, 0, 9, 6))
    out = applied(made(Scale, input="a", factor=1 / 3, filter="triangle"), source)
    for name in ("depth", "time", "object_id"):
        np.testing.assert_array_equal(out.channel(name), source.channel(name)[1::3, 1::3])


def test_variance_is_that_of_a_weighted_sum() -> None:
    source = Framelet.blank(rect(0, 0, 4, 4), frozenset({"variance"}))
    source.channel("variance")[...] = 0.8
    out = applied(made(Scale, input="a", factor=0.5, filter="box"), source)
    np.testing.assert_allclose(out.channel("variance"), 0.8 / 4, rtol=1e-6)


def test_alpha_stays_within_0_and_1_where_the_filter_overshoots() -> None:
    source = Framelet.blank(rect(0, 0, 16, 1), frozenset({"alpha"}))
    source.channel("alpha")[0, 8:] = 1.0
    out = applied(made(Scale, input="a", size=(31, 1), filter="lanczos3"), source)
    assert out.channel("alpha").min() == 0.0
    assert out.channel("alpha").max() == 1.0


def test_scale_needs_a_factor_or_a_size() -> None:
    for keys in ({}, {"factor": 2.0, "size": (3, 3)}, {"factor": 0.0}):
        with pytest.raises(ValidationError):
            made(Scale, input="a", filter="box", **keys)
