"""What an image may take of memory, whatever comes in."""

from __future__ import annotations

import gc
from dataclasses import replace

import numpy as np
import pytest
from adaptive_images import RED, START, centres, event_at, hits, plate_before_wall
from small_scenes import View, view

from wall.config.sampling import AdaptiveSampling
from wall.core.data import Event
from wall.reconstruction.memory import Kept, reconstruction_bytes
from wall.reconstruction.reconstruction import Reconstruction
from wall.run.usage import give_memory_back, memory
from wall.scene.model import PointLight

SIZE = (256, 256)
LARGEST = 620  # bytes a pixel
SEEN = view((0.0, 0.0, 4.0), (0.0, 0.0, 0.0), pixels=SIZE)


KEPT = AdaptiveSampling().samples_per_pixel
MEASURED = 0.3  # how far what was worked out may be from what is measured; 0.02 to 0.2 were seen, up to 1920x1080


def lit_image(seen: View = SEEN) -> Reconstruction:
    """Of the dearest kind: lit anew."""
    light = PointLight(position=(0.0, 1.0, 3.0), intensity=(1.0, 1.0, 1.0))
    scene = plate_before_wall((0.0, 0.0, 2.0), (1.0, 0.0, 2.0), lights=(light,))
    return Reconstruction(seen.panel, seen.eye, scene, detects_change=True, samples_per_pixel=KEPT)


def test_a_image_stays_below_its_bytes_a_pixel_however_many_samples_come(compiled_only: None) -> None:
    image = lit_image()
    assert image.buffer.store.albedo.size
    before = image.bytes
    assert before <= LARGEST * SIZE[0] * SIZE[1]
    random, samples = np.random.default_rng(1), hits(centres(SIZE), RED)
    for k in range(12):
        event: Event = replace(event_at(k, SEEN), scene_time=0.01 * k)
        image.insert(random.permutation(samples), START + 0.01 * k, event)
        if k % 3 == 2:
            image.refresh(event, START + 0.01 * k)
        assert image.bytes == before
        assert image.count <= image.buffer.store.capacity


def test_where_samples_come_fast_refreshes_make_room_in_time_and_no_insert_has_to(compiled_only: None) -> None:
    """0.4 samples a pixel between two refreshes, room for one more than are kept: eight of them would be too many."""
    image = lit_image()
    random, samples = np.random.default_rng(2), hits(centres(SIZE), RED)
    few = int(0.4 * len(samples))
    for k in range(24):
        event: Event = replace(event_at(k, SEEN), scene_time=0.01 * k)
        before = image.count
        image.insert(random.permutation(samples)[:few], START + 0.01 * k, event)
        assert image.count == before + few
        image.refresh(event, START + 0.01 * k)


def test_an_image_takes_what_was_worked_out_before_it_was_made(compiled_only: None) -> None:
    """Resident memory of 640x360 pixels before it is made, and once it has moved, come to rest and been filled."""
    size, random = (640, 360), np.random.default_rng(3)
    kept = Kept(lit=True, detects_change=True, samples_per_pixel=KEPT)
    assert lit_image().bytes == pytest.approx(reconstruction_bytes(*SIZE, kept, room=True), rel=0.01)
    seen = view((0.0, 0.0, 4.0), (0.0, 0.0, 0.0), pixels=size)
    places = centres(size)
    gc.collect()
    give_memory_back()  # what other tests have left
    before, image = memory(), lit_image(seen)
    for k in range(20):
        event = replace(event_at(min(k // 4, 3), seen), scene_time=0.01 * min(k // 4, 3))
        image.insert(hits(places[random.integers(0, len(places), len(places) // 2)], RED), START + 0.3 * k, event)
        image.refresh(event, START + 0.3 * k)
    give_memory_back()
    assert reconstruction_bytes(*size, kept) == pytest.approx(memory() - before, rel=MEASURED)


def test_what_still_tiles_take_was_worked_out() -> None:
    scene = plate_before_wall((0.0, 0.0, 2.0), (1.0, 0.0, 2.0))
    made, expected = (
        [of(settles=settles) for settles in (False, True)]
        for of in (
            lambda settles: Reconstruction(SEEN.panel, SEEN.eye, scene, detects_change=True, settles=settles).bytes,
            lambda settles: reconstruction_bytes(*SIZE, Kept(detects_change=True, settles=settles), room=True),
        )
    )
    assert made[1] - made[0] == pytest.approx(expected[1] - expected[0], rel=0.02)
    assert made[0] == pytest.approx(expected[0], rel=0.01)
