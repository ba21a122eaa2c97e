"""An image at rest is resolved anew while its pixels have few samples: what moved last may have left holes."""

from __future__ import annotations

from adaptive_images import GREEN, RED, SIZE, START, centres, event_at, hits, image_of, plate_before_wall

from wall.deepbuffer.deep_buffer import RestSchedule

PIXELS = 160


def test_it_is_due_after_a_sixteenth_of_a_sample_a_pixel_then_after_twice_as_many_up_to_four() -> None:
    schedule = RestSchedule(PIXELS)
    due = []
    for samples in range(1, 20 * PIXELS):
        schedule.insert(1)
        if schedule.take_due():
            due.append(samples)
    assert due == [10, 20, 40, 80, 160, 320, 640]


def test_it_begins_anew_with_a_move_and_a_large_batch_counts_once() -> None:
    schedule = RestSchedule(PIXELS)
    schedule.insert(3 * PIXELS)
    assert schedule.take_due()
    assert not schedule.take_due()
    schedule.move()
    schedule.insert(9)
    assert not schedule.take_due()
    schedule.insert(1)
    assert schedule.take_due()


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
