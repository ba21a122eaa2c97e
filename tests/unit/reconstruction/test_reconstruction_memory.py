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


def test_a_image_stays_below_its_bytes_a_pixel_however_many_samples_come(compiled_only: None) -> None:
    light = PointLight(position=(0.0, 1.0, 3.0), intensity=(1.0, 1.0, 1.0))
    scene = plate_before_wall((0.0, 0.0, 2.0), (1.0, 0.0, 2.0), lights=(light,))
    kept = AdaptiveSampling().samples_per_pixel
    image = Reconstruction(SEEN.panel, SEEN.eye, scene, detects_change=True, samples_per_pixel=kept)
    assert image.buffer.store.albedo.size, "the dearest kind: lit anew"
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
