"""What an image may take of memory, whatever comes in."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from adaptive_images import RED, START, centres, event_at, hits, plate_before_wall
from small_scenes import view

from wall.config.sampling import AdaptiveSampling
from wall.core.data import Event
from wall.reconstruction.reconstruction import Reconstruction
from wall.scene.model import PointLight

SIZE = (256, 256)
LARGEST = 620  # bytes a pixel
SEEN = view((0.0, 0.0, 4.0), (0.0, 0.0, 0.0), pixels=SIZE)


def lit_image() -> Reconstruction:
    """Of the dearest kind: lit anew."""
    light = PointLight(position=(0.0, 1.0, 3.0), intensity=(1.0, 1.0, 1.0))
    scene = plate_before_wall((0.0, 0.0, 2.0), (1.0, 0.0, 2.0), lights=(light,))
    kept = AdaptiveSampling().samples_per_pixel
    return Reconstruction(SEEN.panel, SEEN.eye, scene, detects_change=True, samples_per_pixel=kept)


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
