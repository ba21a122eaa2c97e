"""Maps of age and density hold what was put into the stores, within the rounding of their codes."""

from __future__ import annotations

import numpy as np
import pytest
from adaptive_images import GREEN, SIZE, START, event_at, hits, image_of, plate_before_wall
from hypothesis import given
from hypothesis import strategies as st

from wall.core.data import SAMPLE, Batch, Rect
from wall.deepbuffer.pixel_buffer import PixelBuffer
from wall.reconstruction.kernels import statistics as kernels
from wall.reconstruction.statistics import (
    AGE,
    DENSITY,
    ERROR_REDUCTION,
    codes_of,
    expected_error_reduction,
    grid_error_reduction,
    statistics_of_pixels,
    statistics_of_store,
    tile_areas,
    tile_sums,
    values_of,
)

HALF_STEP = 2 ** (1 / 32) + 1e-6  # 16 steps an octave; and what float32 ages lose


def near(codes: object, expected: float) -> bool:
    value = values_of(np.asarray(codes, np.uint8), AGE)
    return bool(((value <= expected * HALF_STEP) & (value >= expected / HALF_STEP)).all())


@given(st.sampled_from([AGE, DENSITY, ERROR_REDUCTION]), st.floats(0.0, 1.0))
def test_codes_are_within_half_a_step(scale: object, position: float) -> None:
    octaves = 254 / scale.steps  # type: ignore[attr-defined]
    value = 2.0 ** (scale.least + position * octaves)  # type: ignore[attr-defined]
    ratio = values_of(codes_of(np.array([value]), scale), scale)[0] / value  # type: ignore[arg-type]
    assert abs(np.log2(ratio)) <= 0.5 / scale.steps + 1e-9  # type: ignore[attr-defined]


def test_nothing_is_code_0_and_ends_are_kept() -> None:
    codes = codes_of(np.array([0.0, np.nan, -1.0, 1e-30, 1e30, np.inf]), DENSITY)
    assert codes.tolist() == [0, 0, 0, 1, 255, 255]


@pytest.mark.parametrize("age", [-1.0, 0.0, 1e-4, 0.001, 0.0101, 0.5, 3.0, 58.0, 1e4])
def test_the_kernel_codes_ages_like_the_table(age: float) -> None:
    histogram = np.zeros((1, 1, 256), np.uint32)
    state = np.array([[10.0 - age], [1.0]], np.float64).astype(np.float32)
    kernels.count_stored(*state, np.ones((3, 1), np.float32), 1, np.float32(10.0), histogram)
    passed = max(float(np.float32(10.0) - state[0, 0]), 1e-9)
    assert np.flatnonzero(histogram[0, 0]).tolist() == codes_of(np.array([passed]), AGE).tolist()


def test_median_age_and_density_of_stored_samples() -> None:
    """Upper left tile: 3 samples of 0.5 s and 2 of 0.02 s; lower right one: 1 of 2 s; nothing elsewhere."""
    image = image_of(plate_before_wall((100.0, 0.0, 0.0)))
    event = event_at(0)
    for count, place, age in ((3, (4.5, 4.5), 0.5), (2, (9.5, 9.5), 0.02), (1, (40.5, 20.5), 2.0)):
        image.insert(hits([place] * count, GREEN), START - age, event)

    age, density = statistics_of_store(image, START)

    assert near(age[0, 0], 0.5)
    assert near(age[1, 2], 2.0)
    assert density[0, 0] == pytest.approx(5 / 256)
    assert density[1, 2] == pytest.approx(1 / 256)
    assert np.count_nonzero(age) == np.count_nonzero(density) == 2


def test_dead_samples_are_not_counted() -> None:
    image = image_of(plate_before_wall((100.0, 0.0, 0.0)))
    image.insert(hits([(4.5, 4.5), (5.5, 5.5)], GREEN), START, event_at(0))
    stored = image.stored()
    assert stored.in_use == 2
    stored.confidence[0], image.buffer.history.accumulation[:] = 0.0, 0.0
    assert statistics_of_store(image, START + 1.0)[1][0, 0] == pytest.approx(1 / 256)


def test_a_still_image_counts_the_samples_that_it_has_accumulated() -> None:
    """Stored are at most `kept` a pixel, here 1; the pixel shows the mean of all 7."""
    image = image_of(plate_before_wall((100.0, 0.0, 0.0)), kept=1.0)
    event = event_at(0)
    image.refresh(event, START)
    image.refresh(event, START)
    for _ in range(7):
        image.insert(hits([(4.5, 4.5)], GREEN), START, event)
    assert statistics_of_store(image, START)[1][0, 0] == pytest.approx(7 / 256)


def test_age_and_density_of_newest_samples() -> None:
    buffer = PixelBuffer(40, 20)
    samples = np.zeros(256, SAMPLE)
    x, y = np.meshgrid(np.arange(16), np.arange(16))
    samples["xy"] = np.stack([x.ravel(), y.ravel()], 1) + 0.5
    samples["time"] = np.where(np.arange(256) < 100, 0.9, 0.0)  # 100 of 0.1 s, 156 of 1 s
    rect = Rect(x=0, y=0, width=40, height=20)
    buffer.insert(
        Batch(
            view=0, panel=0, rect=rect, rank=1, sequence=1, camera_event=0, scene_event=0, base_time=START,
            samples=samples,
        )
    )  # fmt: skip

    age, density = statistics_of_pixels(buffer.records, START + 1.0)

    assert near(age[0, 0], 1.0)
    assert density[0, 0] == 1.0
    assert age.ravel()[1:].tolist() == density.ravel()[1:].tolist() == [0.0] * 5


def test_sums_and_areas_of_cut_tiles() -> None:
    values = np.arange(20 * 40, dtype=np.float64).reshape(20, 40)
    expected = [[values[i : i + 16, j : j + 16].sum() for j in (0, 16, 32)] for i in (0, 16)]
    assert tile_sums(values).tolist() == expected
    assert tile_areas(20, 40).tolist() == [[256, 256, 128], [64, 64, 32]]


def test_error_reduction_of_a_grid_is_contrast_over_n_n_plus_1() -> None:
    radiance = np.zeros((16, 32, 3), np.float32)
    radiance[:8, :15] = 1.0  # 15 edges of 1 below it and 8 at its right, among two of each of 256 pixels
    rects, error_reduction = grid_error_reduction(radiance, np.ones((1, 2)))
    assert rects.tolist() == [[0, 0, 16, 16], [16, 0, 16, 16]]
    assert error_reduction.tolist() == pytest.approx([(15 + 8) / (2 * 256) / 2, 0.0])


def test_contrasts_of_cut_tiles_equal_those_of_numpy() -> None:
    radiance = np.random.default_rng(3).random((20, 40, 3)).astype(np.float32)
    contrast = np.empty((2, 3), np.float64)
    kernels.contrasts(radiance, np.empty((20, 40), np.float32), contrast)
    value = np.sqrt(radiance.astype(np.float64)).mean(2)
    across, down = np.diff(value, axis=1, append=value[:, -1:]), np.diff(value, axis=0, append=value[-1:])
    expected = tile_sums((across**2 + down**2) / 2) / tile_areas(20, 40)
    np.testing.assert_allclose(contrast, expected, rtol=1e-5)


def test_error_reduction_of_a_sample_is_contrast_over_n_times_n_plus_1() -> None:
    contrast, density = np.array([0.36, 0.0], np.float32), np.array([2.0, 1.0], np.float32)
    assert expected_error_reduction(contrast, density) == pytest.approx([0.36 / 6, 0.0])


def test_size_of_the_maps_is_that_of_the_image() -> None:
    image = image_of(plate_before_wall((100.0, 0.0, 0.0)))
    age, density = statistics_of_store(image, START)
    assert age.shape == density.shape == (SIZE[1] // 16, SIZE[0] // 16)
