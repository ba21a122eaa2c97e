"""Parker's properties: chunks of a curve, dealt and permuted; camera every p percent; four positions in two visits."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable

import numpy as np
import pytest
from sampler_runs import positions, samples_at, until_idle
from small_scenes import batch_of

from wall.core.data import Event, Float32, Rect
from wall.deepbuffer.pixel_buffer import PixelBuffer
from wall.sampling.base import Targets
from wall.sampling.hilbert import STATISTICS_WINDOW, HilbertSampler
from wall.sampling.ownership import hilbert_chunks

RECT = Rect(x=4, y=2, width=24, height=20)
CHUNK = 16
Path = Callable[[int], Event]
LUMINANCE = np.array([0.2126, 0.7152, 0.0722])


def hilbert(
    *, batch: int = 2 * CHUNK, seed: int = 1, percent: float = 5.0, worker: int = 0, workers: int = 1
) -> HilbertSampler:
    return HilbertSampler(
        RECT, batch=batch, seed=seed, chunk=CHUNK, camera_update_percent=percent, worker=worker, workers=workers
    )


def chunk_of(targets: Targets, chunks: list[np.ndarray[tuple[int, ...], np.dtype[np.int32]]]) -> int:
    """Which chunk a batch of one chunk visits."""
    pixels = {(int(x), int(y)) for x, y in targets.xy}
    return next(k for k, chunk in enumerate(chunks) if {(x, y) for x, y in chunk.tolist()} == pixels)


@pytest.mark.parametrize("workers", [1, 2, 3, 5])
def test_chunks_follow_the_curve_and_are_dealt_round_robin(workers: int) -> None:
    whole = hilbert_chunks(RECT, chunk=CHUNK, worker=0, workers=1)
    shares = [hilbert_chunks(RECT, chunk=CHUNK, worker=k, workers=workers) for k in range(workers)]
    for k, chunk in enumerate(whole):
        np.testing.assert_array_equal(chunk, shares[k % workers][k // workers])
    assert len(np.unique(np.concatenate(whole), axis=0)) == RECT.area
    steps = np.abs(np.diff(np.concatenate(whole), axis=0)).max(axis=1)
    assert (steps <= 2).all(), "neighbours on the curve are neighbours on the screen"


def test_a_chunk_is_compact() -> None:
    """16 pixels in a row of a Hilbert curve lie within 8 x 8; 16 of a raster row of 24 would span up to 24."""
    assert max(int(np.ptp(c, axis=0).max()) for c in hilbert_chunks(RECT, chunk=CHUNK, worker=0, workers=1)) < 9


def test_pixels_are_complete_after_exactly_two_visits_of_two_positions(camera_path: Path) -> None:
    sampler = hilbert()
    xy = positions(until_idle(sampler, camera_path(0)))
    assert len(xy) == 4 * RECT.area
    offsets = Counter(tuple(p) for p in (xy % 1).tolist())
    assert offsets == Counter({(a, b): RECT.area for a in (0.25, 0.75) for b in (0.25, 0.75)})
    assert len(np.unique(xy, axis=0)) == 4 * RECT.area
    assert sampler.choose(camera_path(0)) is None


def test_a_visit_renews_one_diagonal_of_a_pixel_and_the_next_visit_the_other(camera_path: Path) -> None:
    sampler, visits = hilbert(), {}
    for targets in until_idle(sampler, camera_path(0)):
        for (x, y), (u, v) in targets.xy.reshape(-1, 2, 2).tolist():
            assert (int(x), int(y)) == (int(u), int(v)), "two positions of one pixel stand together"
            visits.setdefault((int(x), int(y)), []).append({(x % 1, y % 1), (u % 1, v % 1)})
    diagonals = [{(0.25, 0.25), (0.75, 0.75)}, {(0.75, 0.25), (0.25, 0.75)}]
    assert all(visit == diagonals for visit in visits.values())


def test_each_worker_permutes_its_chunks_and_anew_every_sweep(camera_path: Path) -> None:
    chunks = hilbert_chunks(RECT, chunk=CHUNK, worker=1, workers=2)
    sampler = hilbert(worker=1, workers=2)
    visited = [chunk_of(targets, chunks) for targets in until_idle(sampler, camera_path(0))]
    first, second = visited[: len(chunks)], visited[len(chunks) :]
    assert sorted(first) == sorted(second) == list(range(len(chunks)))
    assert first != second
    assert first != sorted(first)


@pytest.mark.parametrize("percent", [1.0, 5.0, 20.0, 100.0])
def test_camera_is_taken_every_p_percent_of_the_pixels_and_not_between(camera_path: Path, percent: float) -> None:
    """480 pixels in chunks of 16: p percent are 4.8 p pixels, reached after ceil(4.8 p / 16) chunks."""
    sampler = hilbert(percent=percent)
    events = [t.event.camera_event for k in range(60) if (t := sampler.choose(camera_path(k)))]
    stride = int(np.ceil(round(RECT.area * percent / 100) / CHUNK))
    assert events == [k // stride * stride for k in range(60)]


def test_a_batch_ends_where_a_camera_update_is_due(camera_path: Path) -> None:
    sampler = hilbert(batch=40 * CHUNK, percent=10.0)
    sizes = [len(targets.xy) // 2 for k in range(8) if (targets := sampler.choose(camera_path(k)))]
    assert sizes == [48] * 8, "10 % of 480 pixels are three chunks"


def test_under_a_moving_camera_every_chunk_is_visited_equally_often(camera_path: Path) -> None:
    chunks = hilbert_chunks(RECT, chunk=CHUNK, worker=0, workers=1)
    sampler = hilbert(percent=1.0)
    visits = Counter(chunk_of(t, chunks) for k in range(5 * len(chunks)) if (t := sampler.choose(camera_path(k))))
    assert set(visits.values()) == {5}


def test_forgotten_positions_are_visited_again_and_others_are_not(camera_path: Path) -> None:
    sampler = hilbert()
    lost = until_idle(sampler, camera_path(0))[3].xy
    sampler.forget(samples_at(lost), 0.0)
    again = positions(until_idle(sampler, camera_path(0)))
    assert {(int(x), int(y)) for x, y in again} == {(int(x), int(y)) for x, y in lost}
    assert set(map(tuple, lost.tolist())) <= set(map(tuple, again.tolist()))


def test_forgetting_pixels_of_another_thread_changes_nothing(camera_path: Path) -> None:
    sampler, other = hilbert(worker=0, workers=2), hilbert(worker=1, workers=2)
    until_idle(sampler, camera_path(0))
    sampler.forget(samples_at(positions(until_idle(other, camera_path(0)))), 0.0)
    assert sampler.choose(camera_path(0)) is None


def test_restart_samples_everything_again(camera_path: Path) -> None:
    sampler = hilbert()
    until_idle(sampler, camera_path(0))
    sampler.restart()
    assert len(positions(until_idle(sampler, camera_path(0)))) == 4 * RECT.area


def test_a_thread_without_chunks_is_idle_from_the_start(camera_path: Path) -> None:
    assert hilbert(worker=30, workers=31).choose(camera_path(0)) is None


def one_pixel(values: Float32) -> HilbertSampler:
    sampler = hilbert()
    for value in values:
        sampler.observe(samples_at(np.float32([[5.25, 3.25]]), value), 0.0)
    return sampler


def owned(sampler: HilbertSampler) -> int:
    return int(np.flatnonzero(sampler.count)[0])


@pytest.mark.parametrize("n", [1, 2, 7, int(STATISTICS_WINDOW)])
def test_running_mean_and_variance_are_exact_within_the_window(random_numbers: np.random.Generator, n: int) -> None:
    values = random_numbers.random((n, 3)).astype(np.float32)
    sampler = one_pixel(values)
    luminance = values.astype(np.float64) @ LUMINANCE
    assert sampler.mean[owned(sampler)] == pytest.approx(luminance.mean(), rel=1e-5)
    assert sampler.variance[owned(sampler)] == pytest.approx(luminance.var(), rel=1e-4, abs=1e-9)


def test_beyond_the_window_old_samples_fade_exponentially(random_numbers: np.random.Generator) -> None:
    """West's update at constant weight 1 / w.

    With d = x - mean before the update: mean' = mean + d / w, and the second moment about it becomes
    (1 - 1/w) var + d (x - mean') / w.
    """
    values = random_numbers.random((60, 3)).astype(np.float32)
    sampler, luminance, w = one_pixel(values), values.astype(np.float64) @ LUMINANCE, STATISTICS_WINDOW
    mean, variance = luminance[:16].mean(), luminance[:16].var()
    for x in luminance[16:]:
        d = x - mean
        mean += d / w
        variance = (1 - 1 / w) * variance + d * (x - mean) / w
    assert sampler.mean[owned(sampler)] == pytest.approx(mean, rel=1e-5)
    assert sampler.variance[owned(sampler)] == pytest.approx(variance, rel=1e-4)


def test_variance_keeps_its_digits_beside_a_large_mean() -> None:
    """Deviations of 1 around 4,096: E[x^2] - E[x]^2 in float32 would be off by whole units, Welford's is not."""
    values = np.array([[4095.0] * 3, [4097.0] * 3] * 8, np.float32)
    sampler = one_pixel(values)
    assert sampler.variance[owned(sampler)] == pytest.approx(1.0, rel=5e-3)


def test_statistics_leave_foreign_samples_out(camera_path: Path) -> None:
    sampler, other = hilbert(worker=0, workers=2), hilbert(worker=1, workers=2)
    foreign = positions(until_idle(other, camera_path(0)))
    sampler.observe(samples_at(np.concatenate([foreign, np.float32([[-9, -9], [3.5, 2], [900, 3]])]), 1.0), 0.0)
    sampler.observe(samples_at(np.zeros((0, 2), np.float32), 1.0), 0.0)
    assert not sampler.count.any()


def test_a_still_view_converges_to_the_plain_mean_of_its_four_samples(camera_path: Path) -> None:
    """Old image 9 everywhere; the new one is x + 2 y at a position: the mean of four is that of the centre."""
    sampler, deep = hilbert(), PixelBuffer(32, 24)
    old, event = samples_at(np.float32([[x, y] for x in range(32) for y in range(24)]), 9.0), camera_path(1)
    deep.insert(batch_of(old, camera_path(0), RECT))
    for number, targets in enumerate(until_idle(sampler, event)):
        values = targets.xy @ np.float32([[1, 1, 1], [2, 2, 2]])
        deep.insert(batch_of(samples_at(targets.xy, values), event, RECT, sequence=number, blend=targets.blend))
    y, x = np.mgrid[RECT.y : RECT.y + RECT.height, RECT.x : RECT.x + RECT.width] + 0.5
    shown = deep.radiance[RECT.y : RECT.y + RECT.height, RECT.x : RECT.x + RECT.width, 0]
    np.testing.assert_allclose(shown, x + 2 * y, rtol=1e-6)
