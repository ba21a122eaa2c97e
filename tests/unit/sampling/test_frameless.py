"""Bishop's properties: random order without replacement, each batch under the newest input, complete and idle."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable

import numpy as np
import pytest
from sampler_runs import positions, samples_at, until_idle

from wall.core.data import Event, Float32, Rect
from wall.sampling.frameless import FramelessSampler
from wall.sampling.kernels import permutation as kernels

RECT = Rect(x=3, y=9, width=21, height=14)
Path = Callable[[int], Event]


def frameless(
    *, batch: int = 32, seed: int = 1, worker: int = 0, workers: int = 1, rect: Rect = RECT
) -> FramelessSampler:
    return FramelessSampler(rect, batch=batch, seed=seed, worker=worker, workers=workers)


def pixels_of(rect: Rect) -> set[tuple[int, int]]:
    return {(x, y) for x in range(rect.x, rect.x + rect.width) for y in range(rect.y, rect.y + rect.height)}


def test_a_sweep_is_a_permutation_every_pixel_centre_exactly_once(camera_path: Path) -> None:
    xy = positions(until_idle(frameless(), camera_path(0)))
    assert len(xy) == RECT.area
    assert (xy % 1 == 0.5).all()
    assert {(int(x), int(y)) for x, y in xy} == pixels_of(RECT)


def test_complete_after_exactly_all_pixels_under_a_static_event_and_then_idle(camera_path: Path) -> None:
    sampler = frameless(batch=25)
    sizes = [len(targets.xy) for targets in until_idle(sampler, camera_path(0))]
    assert sum(sizes) == RECT.area
    assert max(sizes) == 25
    assert sampler.choose(camera_path(0)) is None


def test_each_batch_is_traced_under_the_newest_event(camera_path: Path) -> None:
    sampler = frameless()
    events = [targets.event.camera_event for k in range(6) if (targets := sampler.choose(camera_path(k)))]
    assert events == list(range(6))


def test_under_a_moving_camera_no_pixel_is_sampled_twice_before_all_were_once(camera_path: Path) -> None:
    """294 pixels in batches of 32: after every 294 positions each pixel was sampled exactly once more."""
    sampler = frameless(batch=21)
    xy = positions([targets for k in range(4 * RECT.area // 21) if (targets := sampler.choose(camera_path(k)))])
    for sweep in xy.reshape(4, RECT.area, 2).astype(int):
        assert {(x, y) for x, y in sweep.tolist()} == pixels_of(RECT)


def test_sweeps_differ_and_a_seed_repeats_them(camera_path: Path) -> None:
    def two_sweeps(seed: int) -> Float32:
        sampler = frameless(seed=seed)
        return positions([*until_idle(sampler, camera_path(0)), *until_idle(sampler, camera_path(1))])

    first, again, other = two_sweeps(1), two_sweeps(1), two_sweeps(2)
    np.testing.assert_array_equal(first, again)
    assert (first[: RECT.area] != first[RECT.area :]).any()
    assert (first != other).any()


def test_which_pixels_a_batch_takes_has_no_structure(camera_path: Path, compiled_only: None) -> None:
    """The screen cut in 4 x 4 cells, 65,536 pixels dealt to 64 batches of 1,024: 64 expected of each cell in a batch.

    Independence of batch and cell has 63 * 15 = 945 degrees of freedom; 99 % quantile 1049.0 (Wilson and Hilferty).
    """
    sampler = frameless(batch=1024, rect=Rect(x=0, y=0, width=256, height=256))
    xy = positions([targets for _ in range(64) if (targets := sampler.choose(camera_path(0)))])
    cell = (xy[:, 1] // 64 * 4 + xy[:, 0] // 64).astype(int)
    table = np.bincount(np.arange(65536) // 1024 * 16 + cell, minlength=1024)
    assert ((table - 64.0) ** 2 / 64.0).sum() < 1049.0


def test_every_pixel_is_equally_likely_at_every_place_of_the_order() -> None:
    """4,000 shuffles of 8 numbers: 64 cells of expectation 500, 49 degrees of freedom, 99 % quantile 74.9."""
    table = np.zeros((8, 8))
    for sweep in range(4000):
        order = np.arange(8, dtype=np.int32)
        kernels.shuffle(order, 7, sweep)
        table[np.arange(8), order] += 1
    assert ((table - 500.0) ** 2 / 500.0).sum() < 74.9


@pytest.mark.parametrize("n", [0, 1, 2])
def test_shuffle_of_almost_nothing_is_still_a_permutation(n: int) -> None:
    order = np.arange(n, dtype=np.int32)
    kernels.shuffle(order, 1, 1)
    assert sorted(order.tolist()) == list(range(n))


@pytest.mark.parametrize("workers", [1, 2, 3, 7])
def test_threads_share_the_pixels_without_overlap_or_gap(camera_path: Path, workers: int) -> None:
    team = [frameless(worker=k, workers=workers) for k in range(workers)]
    found = Counter((int(x), int(y)) for s in team for x, y in positions(until_idle(s, camera_path(0))))
    assert set(found) == pixels_of(RECT)
    assert set(found.values()) == {1}


def test_forgotten_pixels_and_only_they_are_sampled_again(camera_path: Path) -> None:
    sampler = frameless()
    lost = until_idle(sampler, camera_path(0))[2].xy
    sampler.forget(samples_at(lost), 0.0)
    again = positions(until_idle(sampler, camera_path(0)))
    assert sorted(again.tolist()) == sorted(lost.tolist())


def test_forgetting_what_an_older_event_showed_does_not_ask_for_more_pixels_than_there_are(camera_path: Path) -> None:
    """Pixels of the old event are missing anyway: counted twice, the sampler would search for them for ever."""
    sampler = frameless()
    old = positions(until_idle(sampler, camera_path(0)))
    begun = sampler.choose(camera_path(1))
    assert begun is not None
    sampler.forget(samples_at(old), 0.0)
    rest = positions(until_idle(sampler, camera_path(1)))
    assert len(rest) == RECT.area, "those of the first batch were forgotten too"
    assert sampler.choose(camera_path(1)) is None


def test_forgetting_pixels_of_another_thread_changes_nothing(camera_path: Path) -> None:
    sampler, other = frameless(worker=0, workers=2), frameless(worker=1, workers=2)
    until_idle(sampler, camera_path(0))
    sampler.forget(samples_at(positions(until_idle(other, camera_path(0)))), 0.0)
    assert sampler.choose(camera_path(0)) is None


def test_restart_samples_everything_again(camera_path: Path) -> None:
    sampler = frameless()
    until_idle(sampler, camera_path(0))
    sampler.restart()
    assert len(positions(until_idle(sampler, camera_path(0)))) == RECT.area


def test_a_thread_without_pixels_is_idle_from_the_start(camera_path: Path) -> None:
    assert frameless(rect=Rect(x=0, y=0, width=9, height=4), worker=1, workers=2).choose(camera_path(0)) is None
