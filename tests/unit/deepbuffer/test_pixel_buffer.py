"""What a compositor keeps: the newest of every pixel, whatever order, repetition or loss the packets had."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np
import pytest

from wall.core.data import SAMPLE, Batch, Float32, Rect, Samples
from wall.deepbuffer.kernels import pixel_buffer as kernels
from wall.deepbuffer.pixel_buffer import PixelBuffer

QUARTERS = ((0.25, 0.25), (0.75, 0.75), (0.75, 0.25), (0.25, 0.75))


def sample(x: float, y: float, value: float, *, depth: float = 1.0, object_id: int = 1, time: float = 0.0) -> Samples:
    one = np.zeros(1, SAMPLE)
    one["xy"], one["radiance"], one["depth"], one["object_id"], one["time"] = (x, y), value, depth, object_id, time
    return one


def batch(
    samples: Samples | Sequence[Samples], *, event: int = 1, scene_event: int = 0, time: float = 10.0, **more: float
) -> Batch:
    joined = samples if isinstance(samples, np.ndarray) else np.concatenate([np.zeros(0, SAMPLE), *samples])
    whole = {"frame": 0, "frame_samples": 0, "skipped": 0, "rank": 1, "sequence": 1}
    whole |= {name: int(value) for name, value in more.items() if name in whole}
    return Batch(
        view=0,
        panel=0,
        rect=Rect(x=0, y=0, width=8, height=8),
        camera_event=event,
        scene_event=scene_event,
        base_time=time,
        samples=joined,
        blend=more.get("blend", 1.0),
        foreseen=bool(more.get("foreseen", False)),
        **whole,
    )


def buffer_of(*batches: Batch, size: tuple[int, int] = (8, 8)) -> PixelBuffer:
    deep = PixelBuffer(*size)
    for one in batches:
        deep.insert(one)
    return deep


def value(deep: PixelBuffer, x: int, y: int) -> float:
    return float(deep.radiance[y, x, 0])


def test_a_sample_is_shown_in_the_pixel_that_contains_it() -> None:
    deep = buffer_of(batch(sample(3.99, 5.0, 7.0, depth=2.5, object_id=9, time=0.25)))
    assert np.flatnonzero(deep.radiance[..., 0]).tolist() == [5 * 8 + 3]
    assert deep.records["depth"][5, 3] == 2.5
    assert deep.records["object_id"][5, 3] == 9
    assert deep.records["time"][5, 3] == 10.25


def test_late_packet_does_not_replace_newer_sample() -> None:
    deep = buffer_of(batch(sample(1, 1, 5.0), event=2), batch(sample(1, 1, 3.0), event=1, time=11.0))
    assert value(deep, 1, 1) == 5.0
    assert deep.counters == {"late": 1}
    assert deep.newest_event == (2, 0)


def test_a_newer_scene_event_is_newer_whatever_its_clock_says() -> None:
    deep = buffer_of(batch(sample(1, 1, 5.0), scene_event=1), batch(sample(1, 1, 3.0), scene_event=2, time=9.0))
    assert value(deep, 1, 1) == 3.0
    assert not deep.counters


def test_within_an_event_the_newest_sample_stays() -> None:
    deep = buffer_of(batch(sample(1, 1, 5.0), time=10.0), batch(sample(1, 1, 3.0), time=9.5))
    assert value(deep, 1, 1) == 5.0
    assert deep.counters == {"late": 1}


@pytest.mark.parametrize("blend", [1.0, 0.5])
def test_inserting_a_packet_again_changes_no_pixel(blend: float) -> None:
    first, second = batch(sample(1.25, 1.25, 5.0), blend=blend), batch(sample(1.75, 1.75, 2.0), time=10.5, blend=blend)
    once, twice = buffer_of(first, second), buffer_of(first, second, second, first, second)
    np.testing.assert_array_equal(once.radiance, twice.radiance)
    for name in ("mean", "count", "depth", "time"):
        np.testing.assert_array_equal(once.records[name], twice.records[name])


@pytest.mark.parametrize("xy", [(-0.5, 2.0), (8.0, 2.0), (2.0, 8.0), (2.0, -1.5), (1e30, 0.0), (np.nan, 0)])
def test_samples_outside_the_panel_are_counted_and_touch_nothing(xy: tuple[float, float]) -> None:
    deep = buffer_of(batch(sample(*xy, 5.0)))
    assert deep.counters == {"outside": 1}
    assert not deep.radiance.any()
    assert not deep.take_dirty().any()


def test_an_empty_batch_changes_nothing() -> None:
    deep = buffer_of(batch([]))
    assert deep.samples_shown == 0
    assert deep.newest_event == (-1, -1)
    assert not deep.counters


def test_exactly_the_tiles_with_new_samples_are_dirty_and_only_once() -> None:
    deep = buffer_of(batch([sample(0, 0, 1.0), sample(16, 15.9, 1.0), sample(39, 32, 1.0)]), size=(40, 33))
    expected = np.zeros((3, 3), bool)
    expected[0, 0] = expected[0, 1] = expected[2, 2] = True
    np.testing.assert_array_equal(deep.take_dirty(), expected)
    assert not deep.take_dirty().any()
    deep.insert(batch(sample(0, 0, 1.0), event=0))
    assert not deep.take_dirty().any(), "a late sample changed no tile"


def test_oldest_sample_is_unknown_until_every_pixel_has_one() -> None:
    deep = buffer_of(*(batch(sample(x, y, 1.0), time=10.0 + x + y) for x in range(2) for y in range(2)), size=(2, 2))
    assert deep.oldest_sample(12.5) == 2.5
    assert PixelBuffer(2, 2).oldest_sample(12.5) == float("inf")


def test_old_image_fades_exponentially_and_is_gone_with_the_fourth_sample() -> None:
    """With blend b and old image 1, after k black samples the pixel shows (1 - b)^k, and 0 after the fourth."""
    deep = buffer_of(batch([sample(1 + dx, 1 + dy, 1.0) for dx, dy in QUARTERS], blend=0.3))
    shown = []
    for k, (dx, dy) in enumerate(QUARTERS):
        deep.insert(batch(sample(1 + dx, 1 + dy, 0.0), event=2, time=11.0 + k, blend=0.3))
        shown.append(value(deep, 1, 1))
    np.testing.assert_allclose(shown, [0.7, 0.7**2, 0.7**3, 0.0], rtol=1e-6)


@pytest.mark.parametrize("order", list(itertools.permutations(range(4))))
def test_still_image_is_the_plain_mean_of_four_in_any_order_of_arrival(order: tuple[int, ...]) -> None:
    values = [1.0, 2.0, 4.0, 9.0]
    deep = buffer_of(batch(sample(1, 1, 50.0), event=0, blend=0.5))
    for k in order:
        dx, dy = QUARTERS[k]
        deep.insert(batch(sample(1 + dx, 1 + dy, values[k], depth=k), time=20.0 + k, blend=0.5))
    assert value(deep, 1, 1) == pytest.approx(4.0, rel=1e-6)
    assert deep.records["depth"][1, 1] == 3.0, "depth is that of the newest sample"
    assert not deep.counters


def test_first_samples_ever_are_not_darkened_by_the_empty_image() -> None:
    deep = PixelBuffer(8, 8)
    for k, (dx, dy) in enumerate(QUARTERS):
        deep.insert(batch(sample(1 + dx, 1 + dy, 6.0), time=10.0 + k, blend=0.5))
        assert value(deep, 1, 1) == pytest.approx(6.0)


@pytest.mark.parametrize("blend", [1.0, 0.5])
def test_samples_of_an_event_replace_those_that_were_foreseen_of_it_and_not_the_other_way_round(blend: float) -> None:
    foreseen = [batch(sample(x, y, 9.0), foreseen=True, blend=blend, time=20.0) for x, y in QUARTERS]
    own = [batch(sample(x, y, 2.0), blend=blend, time=30.0) for x, y in QUARTERS]
    deep = buffer_of(*foreseen, *own)

    assert value(deep, 0, 0) == 2.0
    deep.insert(batch(sample(0.25, 0.25, 9.0), foreseen=True, blend=blend, time=40.0))
    assert value(deep, 0, 0) == 2.0
    assert deep.counters["late"] == 1
    deep.insert(batch(sample(0.25, 0.25, 9.0), foreseen=True, event=2, time=40.0))
    assert value(deep, 0, 0) == 9.0


@pytest.mark.parametrize("count", [2**31 - 1, 2**32 - 1, 2**60 - 2])
def test_events_are_told_apart_however_long_the_run_lasts(count: int) -> None:
    first = batch(sample(0.5, 0.5, 3.0), event=count, scene_event=count)
    moved = batch(sample(0.5, 0.5, 4.0), event=count, scene_event=count + 1)
    turned = batch(sample(0.5, 0.5, 5.0), event=count + 1, scene_event=count + 1)

    assert value(buffer_of(first, moved), 0, 0) == 4.0
    assert value(buffer_of(first, moved, turned), 0, 0) == 5.0
    assert value(buffer_of(turned, moved, first), 0, 0) == 5.0


def test_switching_between_whole_and_quarter_samples_within_an_event_starts_the_pixel_over() -> None:
    deep = buffer_of(batch(sample(1.5, 1.5, 8.0)))
    for k, (dx, dy) in enumerate(QUARTERS):
        deep.insert(batch(sample(1 + dx, 1 + dy, 4.0), time=11.0 + k, blend=0.5))
    assert value(deep, 1, 1) == pytest.approx(4.0)
    deep.insert(batch(sample(1.5, 1.5, 8.0), time=20.0))
    assert value(deep, 1, 1) == 8.0


def frame_part(xs: Sequence[int], *, number: int = 1, event: int = 1, of: int = 4, **more: float) -> Batch:
    """A row of the frame that has `of` pixels, all as bright as the frame's number."""
    samples = [sample(x + 0.5, 0.5, float(number)) for x in xs]
    return batch(samples, event=event, frame=number, frame_samples=of, **more)


def test_a_framed_image_is_shown_only_when_complete() -> None:
    deep = buffer_of(frame_part([0, 1, 2], sequence=1))
    assert not deep.radiance.any()
    deep.insert(frame_part([3], sequence=2))
    assert deep.radiance[0, :4, 0].tolist() == [1.0] * 4
    assert deep.samples_shown == 4


def test_parts_of_a_frame_that_never_ends_are_not_kept_without_end() -> None:
    deep = buffer_of()
    whole = np.repeat(sample(0.5, 0.5, 1.0), 50_000)
    for k in range(4):
        deep.insert(batch(whole, event=1, frame=1, frame_samples=10**6, sequence=k))
    assert sum(len(part.samples) for part in deep._back[1].batches) == 50_000


def test_incomplete_frames_are_counted_and_never_shown() -> None:
    deep = buffer_of(frame_part([0, 1, 2]), frame_part(range(4), number=2, event=2))
    assert deep.counters == {"frame_incomplete": 3}
    assert deep.radiance[0, :4, 0].tolist() == [2.0] * 4


def test_skipped_samples_count_as_arrived() -> None:
    deep = buffer_of(frame_part([0, 1, 2], skipped=1))
    assert deep.radiance[0, :4, 0].tolist() == [1.0, 1.0, 1.0, 0.0]


def test_parts_of_an_older_frame_are_late() -> None:
    deep = buffer_of(frame_part(range(4), number=2, event=2), frame_part([0, 1], number=1, event=1))
    assert deep.counters == {"late": 2}
    assert value(deep, 0, 0) == 2.0


def test_a_repeated_packet_does_not_complete_a_frame_with_holes() -> None:
    deep = buffer_of(frame_part([0, 1], sequence=1), frame_part([0, 1], sequence=1), frame_part([0, 1], sequence=5))
    assert not deep.radiance.any(), "neither the same packet nor a second trace of its pixels fills pixels 2 and 3"
    deep.insert(frame_part([2, 3], sequence=2))
    assert deep.radiance[0, :4, 0].tolist() == [1.0] * 4


def test_a_rank_that_starts_again_counts_frames_from_one_and_is_shown() -> None:
    deep = buffer_of(frame_part(range(4), number=7, event=3), frame_part(range(4), number=1, event=4))
    assert deep.radiance[0, :4, 0].tolist() == [1.0] * 4


def test_ranks_complete_their_frames_apart() -> None:
    deep = buffer_of(frame_part([0, 1], rank=1, of=2), frame_part([4], rank=2, of=2))
    assert deep.radiance[0, :6, 0].tolist() == [1.0, 1.0, 0.0, 0.0, 0.0, 0.0]


def test_what_comes_of_a_shown_frame_is_late_and_not_an_incomplete_frame() -> None:
    deep = buffer_of(frame_part(range(4), sequence=1), frame_part([1], sequence=2))
    deep.insert(frame_part(range(4), event=2, number=2))
    assert deep.counters == {"late": 1}


def _twin(batches: Sequence[Batch], size: int) -> tuple[Float32, dict[tuple[int, int], float]]:
    """`kernels.insert` by dictionaries: what each pixel shows, and when its newest sample was taken."""
    shown: Float32 = np.zeros((size, size, 3), np.float32)
    state: dict[tuple[int, int], dict[str, object]] = {}
    for one in batches:
        for s in one.samples:
            x, y = (int(v) for v in np.floor(s["xy"]))
            if not (0 <= x < size and 0 <= y < size):
                continue
            key, time = (one.camera_event, one.scene_event), one.base_time + float(s["time"])
            pixel = state.setdefault((x, y), {"key": (-1, -1), "parts": {}, "time": -np.inf})
            part = "whole" if one.blend >= 1 else (s["xy"][0] % 1 >= 0.5, s["xy"][1] % 1 >= 0.5)
            fresh = key != pixel["key"] or ("whole" in pixel["parts"]) != (part == "whole")
            known = time < pixel["time"] if part == "whole" else part in pixel["parts"]
            if key < pixel["key"] or (known and not fresh):
                continue
            if fresh:
                history = shown[y, x].copy() if pixel["parts"] else s["radiance"].copy()
                pixel.update(key=key, parts={}, history=history, time=-np.inf)
            pixel["parts"][part] = s["radiance"].astype(np.float64)
            pixel["time"] = max(pixel["time"], time)
            n, mean = len(pixel["parts"]), np.mean(list(pixel["parts"].values()), axis=0)
            old = 0.0 if part == "whole" or n == 4 else (1 - one.blend) ** n
            shown[y, x] = mean + old * (pixel["history"] - mean)
    return shown, {place: float(pixel["time"]) for place, pixel in state.items()}


@pytest.mark.parametrize("seed", range(3))
def test_insert_equals_its_twin_on_random_packets(seed: int) -> None:
    random, batches = np.random.default_rng(seed), []
    for k in range(60):
        n = int(random.integers(0, 9))
        samples = np.zeros(n, SAMPLE)
        samples["xy"] = random.integers(-1, 5, (n, 2)) + np.array(QUARTERS)[random.integers(0, 4, n)]
        samples["radiance"], samples["time"] = random.random((n, 3)), random.random(n)
        blend = float(random.choice([1.0, 0.5, 0.25]))
        event = k // 10 + int(random.integers(0, 2))
        batches.append(batch(samples, event=event, time=float(random.integers(0, 9)), blend=blend))
    deep = buffer_of(*batches, size=(4, 4))
    shown, times = _twin(batches, 4)
    np.testing.assert_allclose(deep.radiance, shown, rtol=1e-5, atol=1e-6)
    assert {(x, y): deep.records["time"][y, x] for x, y in times} == times


def test_oldest_equals_its_twin_with_pixels_that_never_had_a_sample() -> None:
    times = np.random.default_rng(4).random((7, 5))
    times[2, 3] = times[6, 4] = -np.inf
    records = np.zeros((7, 5), kernels.PIXEL)
    records["time"] = times
    least, never = kernels.oldest(records)
    assert (least, never) == (times[np.isfinite(times)].min(), 2)
    assert kernels.oldest(records[:0]) == (np.inf, 0)
