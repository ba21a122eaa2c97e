"""The double-buffered baseline: whole frames of one event, shared by threads."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable

import numpy as np
from sampler_runs import samples_at, until_idle

from wall.core.data import Event, Rect
from wall.sampling.base import Targets
from wall.sampling.framed import FrameCounter, FramedSampler

RECT = Rect(x=5, y=3, width=19, height=13)
Path = Callable[[int], Event]


def samplers(workers: int = 1, *, batch: int = 64, rect: Rect = RECT) -> list[FramedSampler]:
    counter = FrameCounter(workers)
    return [FramedSampler(rect, counter, batch=batch, worker=k, workers=workers) for k in range(workers)]


def centres(batches: list[Targets]) -> list[tuple[float, float]]:
    return [(x, y) for targets in batches for x, y in targets.xy.tolist()]


def all_centres(rect: Rect) -> list[tuple[float, float]]:
    xs, ys = range(rect.x, rect.x + rect.width), range(rect.y, rect.y + rect.height)
    return sorted((x + 0.5, y + 0.5) for x in xs for y in ys)


def test_every_pixel_centre_once_a_frame_and_then_idle(camera_path: Path) -> None:
    (sampler,) = samplers()
    batches = until_idle(sampler, camera_path(0))
    assert sorted(centres(batches)) == all_centres(RECT)
    assert {targets.frame for targets in batches} == {1}
    assert {targets.frame_samples for targets in batches} == {RECT.area}
    assert sampler.choose(camera_path(0)) is None


def test_a_frame_keeps_its_event_and_the_next_one_takes_the_newest(camera_path: Path) -> None:
    (sampler,) = samplers()
    batches = [sampler.choose(camera_path(k)) for k in range(4)]
    assert [targets.event.camera_event for targets in batches if targets] == [0, 0, 0, 0]
    after = sampler.choose(camera_path(9))
    assert after is not None
    assert (after.frame, after.event.camera_event) == (2, 9)


def test_sixteen_positions_in_a_row_are_a_block_of_four_by_four() -> None:
    from wall.sampling.ownership import block_order

    order = block_order(Rect(x=8, y=4, width=16, height=8), worker=0, workers=1).reshape(-1, 16, 2)
    assert (np.ptp(order, axis=1) == 3).all()


def test_threads_share_a_frame_without_overlap_and_wait_for_each_other(camera_path: Path) -> None:
    first, second, third = samplers(3)
    parts = [until_idle(first, camera_path(0)), until_idle(first, camera_path(1))]
    assert parts[1] == [], "the first thread may not begin frame 2 before the others are through frame 1"
    parts += [until_idle(second, camera_path(1)), until_idle(second, camera_path(1))]
    begun = third.choose(camera_path(1))
    assert begun is not None
    assert begun.event.camera_event == 0, "the third finishes frame 1 under the event that it began with"
    rest = []
    while (targets := third.choose(camera_path(1))) is not None and targets.frame == 1:
        rest.append(targets)
    assert sorted(centres([*parts[0], *parts[2], begun, *rest])) == all_centres(RECT)
    assert targets is not None
    assert (targets.frame, targets.event.camera_event) == (2, 1)
    joining = first.choose(camera_path(5))
    assert joining is not None
    assert (joining.frame, joining.event.camera_event) == (2, 1), "joins the frame under way, not the newest event"


def test_more_threads_than_rows_of_blocks_still_make_frames(camera_path: Path) -> None:
    rect = Rect(x=0, y=0, width=6, height=4)
    team = samplers(3, rect=rect)
    for number in (1, 2):
        batches = [targets for sampler in team for targets in until_idle(sampler, camera_path(number))]
        assert sorted(centres(batches)) == all_centres(rect)
        assert {targets.frame for targets in batches} == {number}


def test_forgotten_positions_are_traced_again_in_their_frame(camera_path: Path) -> None:
    (sampler,) = samplers()
    batches = [sampler.choose(camera_path(0)) for _ in range(2)]
    assert batches[0] is not None
    sampler.forget(samples_at(batches[0].xy), 0.0)
    rest = until_idle(sampler, camera_path(0))
    seen = Counter(centres([*(b for b in batches if b), *rest]))
    assert Counter(seen.values())[2] == len(batches[0].xy)
    assert {targets.frame for targets in rest} == {1}


def test_forgetting_after_the_last_batch_reopens_the_frame(camera_path: Path) -> None:
    first, second = samplers(2)
    lost = until_idle(first, camera_path(0))[-1]
    until_idle(second, camera_path(0))
    first.forget(samples_at(lost.xy), 0.0)
    assert second.choose(camera_path(1)) is None, "frame 1 is not through"
    again = first.choose(camera_path(1))
    assert again is not None
    assert (again.frame, again.event.camera_event) == (1, 0)
    np.testing.assert_array_equal(again.xy, lost.xy)
    begun = second.choose(camera_path(1))
    assert begun is not None
    assert begun.frame == 2


def test_restart_shows_a_still_view_again(camera_path: Path) -> None:
    (sampler,) = samplers()
    until_idle(sampler, camera_path(0))
    sampler.restart()
    again = until_idle(sampler, camera_path(0))
    assert sorted(centres(again)) == all_centres(RECT)
    assert {targets.frame for targets in again} == {2}
