"""Error reduction of a sample: before anything is known, in motion, at rest, and after a contradiction or a loss."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from numpy.typing import ArrayLike

from wall.core.data import SAMPLE, Event, Float32, Float64, Rect, Samples
from wall.core.tone_mapping import AS_IT_IS, TONE_MAPPINGS, Tone, tone_mapped
from wall.deepbuffer.feedback import Feedback
from wall.deepbuffer.kernels.columns import ACCUMULATION_COLUMNS
from wall.sampling.adaptive import ENOUGH, FLOOR_MOVING, AdaptiveSampler, shown_as
from wall.sampling.kernels import scores as kernels
from wall.sampling.kernels.adaptive import PACKET

Path = Callable[[int], Event]
SHOWN = shown_as(AS_IT_IS)
RECT = Rect(x=5, y=9, width=40, height=37)  # 3 x 3 tiles, ragged


def unknown(rect: Rect = RECT, *, nothing_moves: bool = False) -> Feedback:
    """Feedback of a reconstruction that has no samples, for a test to fill in."""
    height, width = rect.height, rect.width
    return Feedback(
        resolved=np.zeros((height, width, 3), np.float32),
        sample_density=np.zeros((height + 2, width + 2, 4), np.float32)[1:-1, 1:-1, 3],
        accumulation=np.zeros((height, width, ACCUMULATION_COLUMNS), np.float32),
        accumulating=np.ones((-(-height // 16), -(-width // 16)), np.bool_),
        temporal_gradient=np.zeros((-(-height // 16), -(-width // 16)), np.float32),
        nothing_moves=nothing_moves,
    )


def sampler_over(feedback: Feedback, rect: Rect = RECT, *, batch: int = 4096, seed: int = 1) -> AdaptiveSampler:
    sampler = AdaptiveSampler(rect, feedback, batch=batch, seed=seed)
    sampler.replan(feedback)
    return sampler


def rays(sampler: AdaptiveSampler, event: Event, *, batches: int = 1) -> Float64:
    """(h, w) how many rays each pixel of RECT gets."""
    counts = np.zeros((RECT.height, RECT.width))
    for _ in range(batches):
        targets = sampler.choose(event)
        assert targets is not None
        x, y = (np.floor(targets.xy) - (RECT.x, RECT.y)).astype(int).T
        np.add.at(counts, (y, x), 1)
    return counts


def samples_at(pixels: ArrayLike, *, change: float = 0.0) -> Samples:
    """One in the middle of each pixel (i, j) of RECT."""
    places = np.asarray(pixels).reshape(-1, 2)
    samples = np.zeros(len(places), SAMPLE)
    samples["xy"] = places[:, ::-1] + (RECT.x + 0.5, RECT.y + 0.5)
    samples["change"] = change
    return samples


def test_before_anything_is_known_every_pixel_is_worth_the_same(camera_path: Path) -> None:
    counts = rays(sampler_over(unknown()), camera_path(0), batches=2)
    assert set(np.unique(counts)) <= {4, 5, 6, 7}, "8192 rays on 1480 pixels: 5.5 each"


def test_in_motion_the_gain_is_contrast_over_n_times_n_plus_1() -> None:
    """The NumPy twin: contrast to the eight neighbours (the border repeated); n, the weight at the pixel, halves it."""
    random = np.random.default_rng(1)
    value = random.random((37, 40)).astype(np.float32)
    resolved = np.repeat((value**2)[..., None], 3, axis=2)
    splat_sums = np.zeros((39, 42, 4), np.float32)
    splat_sums[..., 3] = random.uniform(0.11, 3, (39, 42))
    splat_sums[5:9, 7:11, 3] = 0.05  # holes
    accumulation = np.zeros((37, 40, 8), np.float32)
    accumulation[20, 20, 3] = 50
    scores = kernels.Scores(*np.zeros((3, 37, 40), np.float32))

    rows = np.array([False, True, False])  # of 16: those with an accumulation
    kernels.score_moving(resolved, splat_sums[1:-1, 1:-1, 3], accumulation, rows, FLOOR_MOVING, SHOWN, scores)

    padded = np.pad(value, 1, mode="edge")
    around = [padded[1 + di : 38 + di, 1 + dj : 41 + dj] for di in (-1, 0, 1) for dj in (-1, 0, 1)]
    expected = np.mean([(v - value) ** 2 for k, v in enumerate(around) if k != 4], axis=0)
    n = np.maximum(splat_sums[1:-1, 1:-1, 3], accumulation[..., 3])
    gain = np.where(n < kernels.HOLE_DENSITY, kernels.HOLE + expected, expected / (n * (n + 1))) + FLOOR_MOVING
    assert_allclose(scores.score, gain, rtol=1e-5)


def test_what_pixels_want_does_not_depend_on_how_many_samples_they_have() -> None:
    """So renderers can be compared, one that has just begun as well: twice the contrast wants twice the samples."""
    value = np.random.default_rng(1).random((37, 40)).astype(np.float32)

    def wanted(density: float, contrast: float) -> float:
        feedback = unknown()
        feedback.resolved[:] = (contrast * value[..., None]) ** 2
        feedback.sample_density[:] = density
        return sampler_over(feedback).demand

    assert wanted(0.0, 0.5) == wanted(4.0, 0.5)
    assert_allclose(wanted(1.0, 1.0), 2.0 * wanted(1.0, 0.5), rtol=0.01)  # the floor that every pixel has
    assert 0.0 < wanted(1.0, 0.0) < 0.05 * wanted(1.0, 0.5)


def test_holes_come_first_and_edges_before_plain_surfaces(camera_path: Path) -> None:
    known = unknown()
    known.sample_density[:] = 1.0
    known.sample_density[:6, :6] = 0.0  # 36 pixels not known
    known.resolved[:, 20:] = 0.04  # an edge of 0.2 in brightness between columns 19 and 20
    counts = rays(sampler_over(known), camera_path(0), batches=4)
    plain = counts[10:, 25:].mean()
    assert counts[:6, :6].min() > 20 * plain
    assert counts[10:, 19:21].min() > 20 * plain
    assert plain > 0, "nothing starves"


def test_a_sample_lowers_the_error_reduction_of_its_pixel_and_no_other() -> None:
    sampler = sampler_over(unknown())
    before = sampler._scores.score.copy()
    sampler.observe(samples_at([(3, 4)]))
    lower = sampler._scores.score < before
    assert np.argwhere(lower).tolist() == [[3, 4]]
    assert (sampler._scores.score == before)[~lower].all()


@pytest.mark.parametrize("at", [(12, 13), (0, 0), (36, 39), (15, 16)])
def test_a_contradiction_draws_rays_to_its_neighbours_at_once(at: tuple[int, int], camera_path: Path) -> None:
    known = unknown()
    known.sample_density[:] = 1.0
    sampler = sampler_over(known)
    plain = rays(sampler, camera_path(0)).mean()
    sampler.observe(samples_at([at], change=1.0))

    counts = rays(sampler, camera_path(0))

    near = np.zeros(counts.shape, bool)
    near[max(at[0] - 1, 0) : at[0] + 2, max(at[1] - 1, 0) : at[1] + 2] = True
    assert counts[near].min() > 50 * plain
    assert counts[~near].max() <= np.ceil(plain)


def test_lost_samples_turn_their_pixels_into_holes() -> None:
    known = unknown()
    known.sample_density[:] = 1.0
    sampler = sampler_over(known)
    before = sampler._scores.score.copy()
    lost = samples_at([(0, 0), (36, 39), (7, 7), (7, 7), (-1, 5), (5, 40), (37, 0)])

    sampler.forget(lost)

    changed = np.argwhere(sampler._scores.score != before)
    assert changed.tolist() == [[0, 0], [7, 7], [36, 39]]
    assert (sampler._scores.score[sampler._scores.score != before] == kernels.HOLE).all()


def test_no_samples_and_no_losses_change_nothing() -> None:
    sampler = sampler_over(unknown())
    before = sampler._scores.score.copy()
    sampler.observe(np.zeros(0, SAMPLE))
    sampler.forget(np.zeros(0, SAMPLE))
    assert_array_equal(sampler._scores.score, before)


def test_a_still_view_ends_when_every_standard_error_is_below_half_a_step(
    camera_path: Path, compiled_only: None
) -> None:
    """Light of 0.25 with noise of 0.03, which is 0.03 in brightness too (2 sqrt(0.25) = 1), but for a corner without
    noise: (0.03 / (0.5 / 255))^2 = 234 samples are needed.

    The end is judged from the samples' own variance, so single pixels stop early: the bound is on the mean square of
    the error against the true mean, half a step, and on how many samples that took.
    """
    random = np.random.default_rng(9)
    known = unknown(nothing_moves=True)
    known.resolved[:] = 0.25  # brightness 0.5
    noise = np.full((RECT.height, RECT.width), 0.03)
    noise[:10, :10] = 0.0
    sampler = sampler_over(known, batch=16384)
    total = 0
    while (targets := sampler.choose(camera_path(0))) is not None:
        total += len(targets.xy)
        assert total < 234 * RECT.area * 2, "never ends"
        x, y = (np.floor(targets.xy) - (RECT.x, RECT.y)).astype(int).T
        observe(known.accumulation, y, x, 0.25 + noise[y, x] * random.standard_normal(len(x)))
        samples = np.zeros(len(x), SAMPLE)
        samples["xy"] = targets.xy
        sampler.observe(samples)
        sampler.replan(known)

    count, mean, deviations = (known.accumulation[..., k] for k in (3, 0, 5))
    assert (count >= kernels.BELIEVED).all()
    assert (np.sqrt(deviations / (4.0 * mean)) / count <= ENOUGH).all(), "standard error, from its own samples"
    assert np.sqrt(((mean - 0.25) ** 2).mean()) < ENOUGH
    assert count[:9, :9].max() <= 2 * kernels.BELIEVED + PACKET, "rays were spent where nothing was to be gained"
    assert total < 1.5 * 234 * RECT.area


def observe(accumulated: Float32, i: ArrayLike, j: ArrayLike, values: Float64) -> None:
    """Welford's update, in the order in which values came; what Image does for pixels at rest."""
    for row, column, value in zip(np.asarray(i), np.asarray(j), values, strict=True):
        pixel = accumulated[row, column]
        pixel[3] += 1
        delta = value - pixel[0]
        pixel[:3] += delta / pixel[3]
        pixel[5] += delta * (value - pixel[0])


def gain_of_pixel(light: Float64, tone: Tone = AS_IT_IS, *, enough: float = ENOUGH) -> float:
    """Error reduction of one more sample of a grey pixel at rest that received this light (n,), beside alike pixels."""
    pixel = np.zeros((1, 1, ACCUMULATION_COLUMNS), np.float32)
    observe(pixel, np.zeros(len(light), int), np.zeros(len(light), int), light)
    none, n = np.float32(0.0), np.float32(len(light))
    return float(kernels.still_gain(pixel[0, 0], none, n, none, np.float32(enough), shown_as(tone)))


def test_an_error_counts_as_it_is_shown() -> None:
    """n samples, half of them a and half b: the value shown, sqrt(m), is off by |a - b| / 2 / sqrt(n) / (2 sqrt(m))."""
    light = np.tile([0.1, 0.5], 50)
    variance = 0.2**2 / (4.0 * 0.3)
    assert_allclose(gain_of_pixel(light), variance / (100.5 * 101.0), rtol=1e-4)
    assert_allclose(gain_of_pixel(light, Tone(1.0)), 2.0 * variance / (100.5 * 101.0), rtol=1e-4)
    assert gain_of_pixel(np.tile(light, 40)) > 0.0, "0.18 / sqrt(4000) is 0.7 of a step"
    assert gain_of_pixel(np.tile(light, 100)) == 0.0, "0.18 / sqrt(10,000) is 0.47 of a step"


def test_a_pixel_that_is_surely_beyond_the_range_is_complete() -> None:
    """Half lamp of 10, half sky of 0.2: shown as 1, whatever its noise; four stops darker it is 0.32, and noise counts.

    A mean above 1 by less than four standard errors may come down.
    """
    edge = np.tile([10.0, 0.2], 15)
    assert gain_of_pixel(edge) == 0.0
    assert gain_of_pixel(edge, Tone(-4.0)) > 0.0
    assert gain_of_pixel(np.array([2.0, 0.2, 0.2, 2.0])) > 0.0
    assert gain_of_pixel(np.array([2.0, 0.2, 0.2, 2.0] * 400)) == 0.0


@pytest.mark.parametrize("mapping", TONE_MAPPINGS[1:])
def test_under_tone_mapping_an_error_counts_as_the_curve_shows_it(mapping: str) -> None:
    """Of greys the variance times the square of the slope of sqrt(curve), by differences; never less."""
    for level in (0.003, 0.02, 0.07, 0.3, 0.7, 1.5, 4.0):
        light = np.tile([0.98 * level, 1.02 * level], 50)
        ends = np.sqrt(tone_mapped(level * np.array([[0.98] * 3, [1.02] * 3]), mapping).astype(float))[:, 0]
        found = gain_of_pixel(light, Tone(mapping=mapping), enough=0.0) * 100.5 * 101.0
        assert found >= 0.99 * ((ends[1] - ends[0]) / 2.0) ** 2, level
        assert found <= 1.01 * ((ends[1] - ends[0]) / 2.0) ** 2 or (mapping == "khronos_neutral" and level < 0.08)
    noisy = np.tile([5.0, 1.0], 30)
    assert gain_of_pixel(noisy, enough=0.0) == 0.0, "white, whatever the noise"
    assert gain_of_pixel(noisy, Tone(mapping=mapping), enough=0.0) > 0.0


def test_no_pixel_takes_more_samples_than_the_most_and_none_counts_more_than_the_range() -> None:
    spark = np.zeros(int(kernels.MOST))
    spark[::1000] = 900.0  # at the display's edge for ever
    assert gain_of_pixel(spark) == 0.0
    assert 0.0 < gain_of_pixel(spark[:4001]) <= 1.0 / 4001.0


@pytest.mark.parametrize("size", [(1, 1), (1, 40), (17, 1), (16, 16), (33, 31)])
@pytest.mark.parametrize("still", [False, True])
def test_regions_of_any_size_are_sampled_inside(size: tuple[int, int], still: bool, camera_path: Path) -> None:
    rect = Rect(x=7, y=3, width=size[0], height=size[1])
    sampler = sampler_over(unknown(rect, nothing_moves=still), rect, batch=256)
    for _ in range(5):
        targets = sampler.choose(camera_path(0))
        assert targets is not None
        assert len(targets.xy) == 256
        assert ((targets.xy >= (7, 3)) & (targets.xy < (7 + size[0], 3 + size[1]))).all()


def test_rays_that_are_asked_for_come_in_whole_packets_and_at_least_one(camera_path: Path) -> None:
    sampler = sampler_over(unknown())
    for asked, given in ((1, 16), (16, 16), (31, 16), (32, 32), (1000, 992)):
        targets = sampler.choose(camera_path(0), asked)
        assert targets is not None
        assert len(targets.xy) == given
