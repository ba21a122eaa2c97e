"""Samples give the same image on a GPU as on the CPU, whatever happens to them. Tested on llvmpipe as well."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from adaptive_images import FRONT, GREEN, RED, SIZE, START, centres, event_at, hits, plate_before_wall
from gpu_twins import DECIDED_BY_ROUNDING, ROUNDING, Noise, Twins
from numpy.testing import assert_allclose
from small_scenes import view

from wall.core.data import Event, Float32, Rect
from wall.core.tone_mapping import AS_IT_IS, TONE_MAPPINGS, Tone
from wall.reconstruction.display_values import update_display
from wall.reconstruction.gpu.device import Device
from wall.reconstruction.gpu.reconstruction import GpuReconstruction
from wall.reconstruction.gpu.store import WORDS

# At pixel 2,048 positions are rounded to 1.2e-4 pixels, a few times, between neighbours of 0 and 1, and what weighs as
# little as 0.25 is divided by that. Where samples are dense, shares change SHARPEST times as fast. Seen: 2e-2 at most.
ROUNDING_FAR_OUT, USUAL_FAR_OUT = 3e-2, 6e-3
ANY_ORDER = 1e-6  # of sums of four positive float32 numbers: three roundings each way, 6e-8 each
WIDE = view((0.0, 0.0, 4.0), (0.0, 0.0, 0.0), pixels=(97, 65))
MOVING = ((0.0, 0.0, 2.0), (0.5, 0.0, 2.0), (0.6, 0.1, 2.0))


@pytest.fixture
def noise(random_numbers: np.random.Generator) -> Callable[[int], Noise]:
    return lambda count: Noise(random_numbers, count)


def at_refresh(k: int) -> Event:
    """The plate moves, stops with the eye for three refreshes, moves alone, then the eye comes along."""
    number = k if k < 10 else max(10, k - 3)
    aside, nearer = 0.02 * min(number, 10), 0.01 * max(number - 14, 0)
    return event_at(number, WIDE, scene_time=0.1 * number, position=(aside, 0.0, 4.0 - nearer))


@pytest.mark.parametrize(("samples", "kept"), [(400, 4.0), (900, 1.0), (1500, 4.0)], ids=["few", "dense", "flooded"])
def test_a_scene_that_moves_stops_and_moves_on_looks_the_same_at_every_refresh(
    opengl: Device, noise: Callable[[int], Noise], compiled_only: None, samples: int, kept: float
) -> None:
    """25 refreshes, three batches each: with room for all, more than may stay, more than there is slack for."""
    twins, source = Twins(plate_before_wall(*MOVING), WIDE, kept=kept), noise(samples)
    rested = 0
    for k in range(25):
        event = at_refresh(k)
        for batch in range(3):
            twins.insert(source.of(twins, event), START + k / 60 + 0.004 * batch, event)
        twins.refresh(event, START + (k + 1) / 60)
        twins.agree(decided=DECIDED_BY_ROUNDING)
        rested += twins.gpu.nothing_moves
    assert rested == 3


def test_pixels_that_stood_still_keep_their_mean_when_something_else_moves(
    opengl: Device, noise: Callable[[int], Noise], compiled_only: None
) -> None:
    """At rest means grow on the CPU; the plate moves on, and the wall's pixels must not lose theirs."""
    twins, source = Twins(plate_before_wall(*MOVING), WIDE), noise(6000)
    for k in range(4):
        twins.refresh(event_at(0, WIDE), START + k / 60)
        samples = source.of(twins, event_at(0, WIDE))
        samples["change"] = 0.0
        twins.insert(samples, START + k / 60, event_at(0, WIDE))
    twins.refresh(event_at(1, WIDE, scene_time=0.5), START + 0.1)
    twins.agree(decided=DECIDED_BY_ROUNDING)
    kept = twins.cpu.buffer.history.accumulation[..., 3] > 1
    assert 0.5 < kept.mean() < 1.0
    from_samples_alone = np.abs(twins.cpu.resolved - twins.gpu.radiance).max(axis=2)
    assert np.median(from_samples_alone[kept]) > 100 * ROUNDING, "mixing would not be noticed"
    twins.refresh(event_at(1, WIDE, scene_time=0.5), START + 0.2)
    on_gpu, on_cpu = twins.gpu._history.accumulation, twins.cpu.buffer.history.accumulation
    assert_allclose(on_gpu[..., :4], on_cpu[..., :4], rtol=1e-4, atol=1e-4)


def test_the_mean_of_a_million_equal_samples_beside_what_moves_is_the_sample(
    opengl: Device, compiled_only: None
) -> None:
    """A float32 sum of 10^6 times 0.7 is off by 1 %. The plate moves, so the wall's pixel accumulates on the GPU."""
    image = GpuReconstruction(FRONT.panel, FRONT.eye, plate_before_wall(*MOVING))
    image.refresh(event_at(0), START)
    moved = event_at(1, scene_time=0.1)
    image.refresh(moved, START + 0.01)
    batch = hits(np.full((10_000, 2), (2.5, 2.5)), (0.7, 0.7, 0.7))
    for _ in range(100):
        image.insert(batch, START + 0.02, moved)
    image.refresh(event_at(2, scene_time=0.2), START + 0.03)
    assert image.accumulated_counts()[2, 2] == 1e6
    assert_allclose(image.radiance[2, 2], 0.7, rtol=1e-5)


def test_far_from_the_corner_of_a_wide_panel_rounding_stays_small(
    opengl: Device, random_numbers: np.random.Generator, compiled_only: None
) -> None:
    """2,048 x 16 pixels, samples black or white: near the worst case of what roundings of positions can do."""
    seen = view((0.0, 0.0, 4.0), (0.0, 0.0, 0.0), pixels=(2048, 16))
    twins = Twins(plate_before_wall((9.0, 0.0, 2.0)), seen)
    xy = (random_numbers.random((4 * 2048 * 16, 2)) * (2048, 16)).astype(np.float32)
    twins.insert(hits(xy, random_numbers.integers(0, 2, (len(xy), 1)).astype(np.float32)), START, event_at(0, seen))
    for k in range(3):
        twins.refresh(event_at(k, seen, position=(0.01 * k, 0.0, 4.0 + 0.001 * k)), START + 0.02 * k)
        twins.agree(rounding=ROUNDING_FAR_OUT)
        error = np.abs(twins.gpu.radiance - twins.cpu.radiance).max(axis=2)
        assert np.quantile(error, 0.999) < USUAL_FAR_OUT


@pytest.mark.parametrize("size", [(1, 1), (1, 40), (17, 1), (33, 16)])
def test_images_of_any_size_are_the_same(opengl: Device, size: tuple[int, int]) -> None:
    seen = view((0.0, 0.0, 4.0), (0.0, 0.0, 0.0), pixels=size)
    twins = Twins(plate_before_wall((9.0, 0.0, 2.0)), seen)
    twins.insert(hits(centres(size)[::3] + 0.2, GREEN), START, event_at(0, seen))
    twins.refresh(event_at(0, seen), START)
    twins.agree()
    assert (twins.gpu.radiance[..., 1] > 0.4).all(), "holes are filled"


@pytest.mark.parametrize("crowd", [1, 50])
def test_sums_without_float_atomics_are_the_same(
    opengl: Device, noise: Callable[[int], Noise], monkeypatch: pytest.MonkeyPatch, compiled_only: None, crowd: int
) -> None:
    """Where a driver lacks them, invocations exchange bits until nobody came between; also if many add to one pixel."""
    without = Device(opengl.context, float_atomics=False)
    monkeypatch.setattr("wall.reconstruction.gpu.reconstruction.device", lambda: without)
    seen = view((0.0, 0.0, 4.0), (0.0, 0.0, 0.0), pixels=(16, 8))
    twins, source = Twins(plate_before_wall(*MOVING), seen, kept=100.0), noise(100 * crowd)
    for k in range(6):
        event = event_at(max(k, 2), seen, position=(0.01 * max(k, 2), 0.0, 4.0))  # at rest they accumulate
        twins.insert(source.of(twins, event), START + k / 60, event)
        twins.refresh(event, START + (k + 1) / 60)
        twins.agree(decided=DECIDED_BY_ROUNDING * 4)


@pytest.mark.parametrize("depth", [0.0, -1.0, np.nan, np.inf, -np.inf, 1e-45, 3e38])
def test_impossible_depths_spoil_no_other_pixel(opengl: Device, depth: float) -> None:
    twins = Twins(plate_before_wall((9.0, 0.0, 2.0)), view((0.0, 0.0, 4.0), (0.0, 0.0, 0.0), pixels=(16, 8)))
    wrong = hits(centres((16, 8))[::7], GREEN, depth=depth)
    event = event_at(0, twins.seen)
    twins.insert(np.concatenate([hits(centres((16, 8)), GREEN), wrong]), START, event)
    for k in range(2):
        twins.refresh(event_at(k, twins.seen), START + 0.1 * k)
        twins.agree()
    assert_allclose(twins.gpu.radiance, np.broadcast_to(GREEN, (8, 16, 3)), rtol=0, atol=ROUNDING)


def test_samples_of_no_object_beside_the_panel_or_not_a_number_are_left_out(opengl: Device) -> None:
    twins = Twins(plate_before_wall((9.0, 0.0, 2.0)), view((0.0, 0.0, 4.0), (0.0, 0.0, 0.0), pixels=(16, 8)))
    event = event_at(0, twins.seen)
    places = [(-0.01, 5.0), (16.01, 5.0), (5.0, 8.01), (1e9, 1e9), (np.nan, 5.0), (np.inf, 5.0)]
    for stray in (hits(places, (9.0, 9.0, 9.0)), hits(centres((16, 8)), (9.0, 9.0, 9.0), object_id=2**32 - 1)):
        twins.insert(stray, START, event)
    twins.insert(hits(centres((16, 8)), GREEN), START, event)
    for k in range(2):
        twins.refresh(event_at(k, twins.seen), START + 0.1 * k)
        twins.agree()
    assert_allclose(twins.gpu.radiance, np.broadcast_to(GREEN, (8, 16, 3)), rtol=0, atol=ROUNDING)


def test_an_empty_image_is_black_and_a_cleared_one_forgets_everything(opengl: Device) -> None:
    seen = view((0.0, 0.0, 4.0), (0.0, 0.0, 0.0), pixels=(16, 8))
    twins = Twins(plate_before_wall((9.0, 0.0, 2.0)), seen)
    for k in range(4):
        twins.refresh(event_at(0, seen), START + k)
        twins.agree()
        assert (twins.gpu.radiance == 0.0).all() == (k == 0)
        twins.insert(hits(centres((16, 8)), GREEN), START + k, event_at(0, seen))
    twins.cpu.clear()
    twins.gpu.clear()
    twins.refresh(event_at(0, seen), START + 5)
    twins.agree()
    assert (twins.gpu.radiance == 0.0).all()


def test_a_batch_larger_than_the_whole_store_leaves_the_newest_in_the_memory_there_is(opengl: Device) -> None:
    """A store of 3 x 2 pixels has room for some 4,000 samples; 40 rounds of 400, each brighter than the one before."""
    seen = view((0.0, 0.0, 4.0), (0.0, 0.0, 0.0), pixels=(3, 2))
    twins = Twins(plate_before_wall((9.0, 0.0, 2.0)), seen)
    sizes = {name: array.size for name, array in twins.gpu._store.arrays.items()}
    for k in range(40):
        round_ = np.tile(hits(centres((3, 2)), (0.0, float(k), 0.0)), 400)[:400]
        twins.insert(round_, START + 0.01 * k, event_at(1, seen))
        assert twins.gpu.count == twins.cpu.count <= twins.gpu._store.capacity
    twins.insert(np.tile(round_, 164)[:65536], START + 0.4, event_at(1, seen))
    twins.refresh(event_at(1, seen), START + 0.4)
    twins.agree()
    assert_allclose(twins.gpu.radiance[..., 1], 39.0, rtol=1e-5)
    assert {name: array.size for name, array in twins.gpu._store.arrays.items()} == sizes
    assert sizes == {name: 4 * words * twins.gpu._store.capacity for name, words in WORDS.items()}


@pytest.mark.parametrize("rect", [Rect(x=0, y=0, width=48, height=9), Rect(x=5, y=7, width=17, height=21)])
def test_a_part_of_a_panel_is_the_same(opengl: Device, rect: Rect) -> None:
    twins = Twins(plate_before_wall((0.0, 0.0, 2.0)), view((0.0, 0.0, 4.0), (0.0, 0.0, 0.0), pixels=SIZE), rect)
    event = event_at(0)
    twins.insert(hits(centres(SIZE), GREEN), START, event)
    twins.refresh(event, START)
    twins.agree()


def test_the_same_moments_later_on_the_clock_give_the_same_image(opengl: Device) -> None:
    """A machine that has been up for months, and a clock that starts anew while samples and rejections are about."""
    images: list[Float32] = []
    for start in (0.0, 511.96875, 2.0**24):
        twins = Twins(plate_before_wall((9.0, 0.0, 2.0)), view((0.0, 0.0, 4.0), (0.0, 0.0, 0.0), pixels=(16, 8)))
        for k in range(4):
            samples = hits(centres((16, 8)), (0.0, 0.1 * k, 0.0))
            samples["change"][::3] = 0.7
            twins.refresh(event_at(k, twins.seen), start + k / 64)
            twins.insert(samples, start + k / 64, event_at(k, twins.seen))
        twins.refresh(event_at(4, twins.seen), start + 4 / 64)
        twins.agree()
        images.append(twins.gpu.radiance.copy())
    for later in images[1:]:
        assert_allclose(later, images[0], rtol=ANY_ORDER, atol=0)


def test_a_contradiction_counts_at_every_refresh(opengl: Device, compiled_only: None) -> None:
    """Ever the same samples contradict the image, none more than one before: older ones lose confidence each time."""
    twins = Twins(plate_before_wall((9.0, 0.0, 2.0)), view((0.0, 0.0, 4.0), (0.0, 0.0, 0.0), pixels=(16, 8)))
    twins.insert(hits(centres((16, 8)), GREEN), START, event_at(0, twins.seen))
    for k in range(5):
        at = START + (k + 1) / 64
        contradicting = hits([(8.5, 4.5)], RED)
        contradicting["change"] = 0.4
        twins.refresh(event_at(k, twins.seen, position=(0.001 * k, 0.0, 4.0)), at)
        twins.insert(contradicting, at, event_at(k, twins.seen, position=(0.001 * k, 0.0, 4.0)))
        stored = [image.stored() for image in (twins.cpu, twins.gpu)]
        confidences = [np.sort(samples.confidence[: samples.in_use]) for samples in stored]
        twins.agree()
    assert_allclose(*confidences, atol=1e-6)
    assert confidences[1].min() == pytest.approx(0.6**4, rel=1e-5)


def test_the_eye_amid_samples_gives_finite_pixels(opengl: Device) -> None:
    twins = Twins(plate_before_wall((9.0, 0.0, 2.0)), view((0.0, 0.0, 4.0), (0.0, 0.0, 0.0), pixels=(16, 8)))
    twins.insert(hits(centres((16, 8)), GREEN), START, event_at(0, twins.seen))
    for k, z in enumerate((1.0, 1e-3, 0.0, -1e-3, -1.0)):
        twins.refresh(event_at(k, twins.seen, position=(0.0, 0.0, z)), START + 0.1 * k)
        twins.agree()


@pytest.mark.parametrize(
    ("size", "tone"),
    [((16, 8), AS_IT_IS), *(((7, 3), Tone(1.0, mapping)) for mapping in TONE_MAPPINGS)],
    ids=str,
)
def test_display_values_are_those_of_the_cpu_up_to_one_code(
    opengl: Device, random_numbers: np.random.Generator, size: tuple[int, int], tone: Tone
) -> None:
    """The square roots of two machines may differ in their last bit, and so lie on two sides of a code."""
    seen = view((0.0, 0.0, 4.0), (0.0, 0.0, 0.0), pixels=size)
    reconstruction = GpuReconstruction(seen.panel, seen.eye, plate_before_wall((9.0, 0.0, 2.0)))
    radiance = random_numbers.random((size[0] * size[1], 3)) * 1.5 - 0.1
    reconstruction.insert(hits(centres(size), radiance.astype(np.float32)), START, event_at(0, seen))
    reconstruction.refresh(event_at(0, seen), START)
    shown, wanted = (np.full((size[1], size[0], 3), 77, np.uint8) for _ in range(2))
    dirty = reconstruction.take_dirty()

    reconstruction.display(dirty, shown, tone=tone)

    update_display(reconstruction.radiance, dirty, 16, wanted, tone=tone)
    difference = np.abs(shown.astype(int) - wanted)
    assert difference.max() <= 1
    assert (difference == 0).mean() > 0.95
    assert len(np.unique(wanted)) > 20
