"""An image at rest is resolved anew while its pixels have few samples: what moved last may have left holes."""

from __future__ import annotations

import numpy as np
from adaptive_images import GREEN, RED, SIZE, START, centres, event_at, hits, image_of, plate_before_wall
from numpy.testing import assert_allclose, assert_array_equal

from wall.deepbuffer.kernels.pixel_buffer import TILE
from wall.deepbuffer.rest import RestSchedule

PIXELS = 160


def test_a_tile_is_due_after_a_sixteenth_of_a_sample_a_pixel_then_after_twice_as_many_up_to_four() -> None:
    arrived = np.zeros((2, 3), np.int32)
    schedule = RestSchedule(arrived, PIXELS)
    due = []
    for samples in range(1, 20 * PIXELS):
        arrived[1, 2] += 1
        if (tiles := schedule.take_due(float(samples))).any():
            due.append(samples)
            assert np.argwhere(tiles).tolist() == [[1, 2]]
    assert due == [10, 20, 40, 80, 160, 320, 640]


def test_it_begins_anew_where_something_moves_and_a_large_batch_counts_once() -> None:
    arrived = np.full((1, 2), 3 * PIXELS, np.int32)
    schedule = RestSchedule(arrived, PIXELS)
    assert schedule.take_due(0.0).all()
    assert not schedule.take_due(1.0).any()
    schedule.move(np.array([[True, False]]))
    arrived += 19
    assert not schedule.take_due(2.0).any()
    arrived += 1
    assert schedule.take_due(3.0).tolist() == [[True, False]]
    schedule.move()
    arrived += 10
    assert schedule.take_due(4.0).all()


def test_between_two_times_there_is_a_pause() -> None:
    arrived = np.full((1, 1), 10, np.int32)
    schedule = RestSchedule(arrived, PIXELS)
    assert schedule.take_due(5.0).all()
    arrived += 10
    assert not schedule.take_due(5.0 + 0.9 * RestSchedule.INTERVAL_S).any()
    assert schedule.take_due(5.0 + 1.1 * RestSchedule.INTERVAL_S).all()


def test_an_image_is_not_made_again_of_nothing() -> None:
    image = image_of(plate_before_wall((9.0, 0.0, 2.0)))
    image.insert(hits(centres(SIZE), RED), START, event_at(1))
    image.refresh(event_at(1), START)
    image.refresh(event_at(1), START + 0.1)
    shown = image.radiance.copy()
    image.buffer.count = 0
    image.buffer.history.arrived[:] = 4 * TILE * TILE
    image.refresh(event_at(1), START + 0.2)
    assert_array_equal(image.radiance, shown)


def test_a_pixel_at_rest_keeps_its_mean_when_its_samples_have_left_the_store() -> None:
    image = image_of(plate_before_wall((9.0, 0.0, 2.0)), kept=1.0)
    everywhere = centres(SIZE)
    image.refresh(event_at(1), START)
    image.refresh(event_at(1), START + 0.01)
    for k in range(12):  # more than the store has room for
        image.insert(hits(everywhere, GREEN), START + 0.02 * k, event_at(1))
        image.refresh(event_at(1), START + 0.02 * k)
    assert image.count < 12 * len(everywhere)
    assert_array_equal(image.accumulated_counts(), 12.0)
    assert_allclose(image.radiance, np.broadcast_to(np.float32(GREEN), image.radiance.shape), rtol=1e-6)


def test_new_samples_fill_the_holes_between_them_at_rest() -> None:
    """A view that has red samples only: green ones in every fourth pixel change those between them, too."""
    image = image_of(plate_before_wall((9.0, 0.0, 2.0)))
    everywhere = centres(SIZE)
    image.insert(hits(everywhere[::97], RED), START, event_at(1))
    image.refresh(event_at(1), START)
    image.refresh(event_at(1), START + 0.1)
    red = image.radiance.copy()
    assert (red[..., 0] > red[..., 1]).all()

    few = everywhere[(everywhere % 4 == 0.5).all(axis=1)]
    image.insert(hits(few, GREEN), START + 0.2, event_at(1))
    image.refresh(event_at(1), START + 0.2)

    greener = (image.radiance[..., 1] > red[..., 1]).mean()
    assert greener > 0.9, "not only the pixels that the samples fell in, which are a sixteenth"
    assert image.take_dirty().all()
