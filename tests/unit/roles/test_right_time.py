"""How soon images are right nearly everywhere: by the event of each pixel, or by samples that follow it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from flat_batches import TEXT, flat, plan_of

from wall.core.data import Edits, Event
from wall.roles.layer import PanelCompositor
from wall.roles.plan import first_event
from wall.roles.right_time import RightTimes, newest_in_blocks

SHAPE = (20, 20)


def second_event(event: Event, input_time: float = 10.0) -> Event:
    return replace(event, camera_event=event.camera_event + 1, input_time=input_time)


@pytest.fixture
def first() -> Event:
    return first_event(plan_of(), 0.0)


def test_an_image_is_right_once_nine_of_ten_pixels_show_the_event() -> None:
    plan = plan_of(TEXT.replace("adaptive", "frameless"))
    layer, first = PanelCompositor(plan, 0), first_event(plan, 0.0)
    newer = second_event(first)
    layer.follow(first)
    layer.insert(flat(0.5, first, adaptive=False))
    layer.follow(newer)
    batch = flat(0.5, newer, adaptive=False)
    rows = batch.samples["xy"][:, 1]

    layer.insert(replace(batch, samples=batch.samples[rows < 18]))  # three quarters
    layer.refresh(newer, 11.0)
    assert layer.right.seconds(11.0) == pytest.approx(1.0), "it waits for so long"
    layer.insert(replace(batch, samples=batch.samples[rows >= 18], sequence=2))
    layer.refresh(newer, 12.5)

    assert layer.right.seconds(99.0) == pytest.approx(2.5)


def test_samples_that_follow_the_camera_are_right_at_once_and_after_an_edit_once_traced_again(first: Event) -> None:
    layer, moved = PanelCompositor(plan_of(), 0), second_event(first)
    edited = replace(second_event(moved, 20.0), edits=Edits(number=1))
    layer.follow(first)
    layer.insert(replace(flat(0.5, first, adaptive=True), base_time=9.0))
    layer.refresh(first, 9.1)
    layer.follow(moved)
    layer.refresh(moved, 10.2)
    assert layer.right.seconds(99.0) == pytest.approx(0.2)

    layer.follow(edited)
    layer.refresh(edited, 20.5)
    assert layer.right.seconds(20.5) == pytest.approx(0.5), "it waits"
    layer.insert(replace(flat(0.5, first, adaptive=True, sequence=2), base_time=20.6))
    layer.refresh(edited, 21.0)
    assert layer.right.seconds(99.0) == pytest.approx((0.2 + 1.0) / 2)


def test_holes_are_not_right_and_the_first_event_is_not_timed(first: Event) -> None:
    times, right = np.zeros(SHAPE), RightTimes()
    weights = np.ones((5, 5), np.float32)
    right.follow(first)
    right.see_reprojected(first, weights, times, 5.0)
    assert right.seconds(5.0) == 0.0
    newer = second_event(first)
    right.follow(newer)
    weights[:, :2] = 0.0
    right.see_reprojected(newer, weights, times, 11.0)
    assert right.seconds(13.0) == pytest.approx(3.0)


def test_on_a_gpu_only_what_was_traced_since_the_input_is_known_to_be_right(first: Event) -> None:
    times, right, newer = np.full(SHAPE, 9.0), RightTimes(), second_event(first)
    right.follow(first)
    right.follow(newer)
    right.see_reprojected(newer, None, times, 10.5)
    times[:] = 10.7
    right.see_reprojected(newer, None, times, 10.9)
    assert right.seconds(99.0) == pytest.approx(0.9)


def test_a_block_is_as_new_as_the_newest_of_its_pixels_also_where_the_edge_cuts_it() -> None:
    times = np.zeros((6, 9))
    times[3, 3] = times[5, 8] = 7.0
    np.testing.assert_array_equal(newest_in_blocks(times, 1), [[7.0, 0.0, 0.0], [0.0, 0.0, 7.0]])
    np.testing.assert_array_equal(newest_in_blocks(times, 2), [[7.0, 0.0]])


def test_an_image_of_what_is_expected_shows_all_that_came(first: Event) -> None:
    right, weights = RightTimes(), np.ones((5, 5), np.float32)
    for event in (first, second_event(first), replace(second_event(first, 10.1), camera_event=2)):
        right.follow(event)
    expected = replace(first, camera_event=-2, scene_event=-2)
    right.see_reprojected(expected, weights, np.zeros(SHAPE), 10.3)
    assert right.seconds(99.0) == pytest.approx((0.3 + 0.2) / 2)
