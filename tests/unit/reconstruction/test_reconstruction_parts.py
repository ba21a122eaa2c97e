"""While the camera stands only tiles where something changes are made anew: there as in an image made anew whole."""

from __future__ import annotations

import numpy as np
import pytest
from adaptive_images import RED, START, event_at, hits, image_of, plate_before_wall, traced
from numpy.testing import assert_array_equal
from numpy.typing import NDArray
from small_scenes import view

from wall.core.data import Float32, Samples
from wall.deepbuffer.kernels.pixel_buffer import TILE
from wall.reconstruction.reconstruction import Reconstruction

SIZE = (200, 120)  # 13 by 8 tiles, the last ones cut
SEEN = view((0.0, 0.0, 4.0), (0.0, 0.0, 0.0), pixels=SIZE)
SCENE = plate_before_wall((-0.2, 0.1, 1.0), (0.6, 0.1, 1.0))
REFRESH_S = 1.0 / 60.0


@pytest.fixture
def samples(random_numbers: np.random.Generator) -> Samples:
    """Three a pixel at random places, at time 0."""
    xy = (random_numbers.random((3 * SIZE[0] * SIZE[1], 2)) * SIZE).astype(np.float32)
    return traced(SCENE, event_at(0, SEEN), np.minimum(xy, np.nextafter(np.float32(SIZE), 0)), SEEN)


def shown(samples: Samples, *, parts: bool) -> Reconstruction:
    image = image_of(SCENE, SEEN, detects_change=True, parts=parts)
    image.insert(samples.copy(), START, event_at(0, SEEN))
    image.refresh(event_at(0, SEEN), START)
    image.take_dirty()
    return image


def plate_moves(image: Reconstruction) -> NDArray[np.bool_]:
    """Returns the tiles that the refresh changed."""
    image.refresh(event_at(1, SEEN, scene_time=0.1), START + REFRESH_S)
    return image.take_dirty()


def pixels_of(tiles: NDArray[np.bool_]) -> NDArray[np.bool_]:
    return np.kron(tiles, np.ones((TILE, TILE), np.bool_))[: SIZE[1], : SIZE[0]]


def test_where_something_moved_sums_are_those_of_an_image_made_whole_and_elsewhere_those_before(
    samples: Samples, compiled_only: None
) -> None:
    part, whole = shown(samples, parts=True), shown(samples, parts=False)
    before: Float32 = part.splat_sums[1:-1, 1:-1].copy()

    dirty = plate_moves(part)

    assert plate_moves(whole).all()
    assert 0.1 < dirty.mean() < 0.5
    redone = (part.splat_sums[1:-1, 1:-1] != before).any(axis=2)
    assert redone.any()
    assert (redone <= pixels_of(dirty)).all(), "all that changes is shown"
    assert_array_equal(part.splat_sums[1:-1, 1:-1][redone], whole.splat_sums[1:-1, 1:-1][redone])
    after = whole.splat_sums[1:-1, 1:-1]
    moved = (
        np.abs(
            after[..., :3] / np.maximum(after[..., 3:], 1e-6) - before[..., :3] / np.maximum(before[..., 3:], 1e-6)
        ).max(axis=2)
        > 0.05
    )
    assert moved.any()
    assert (moved <= redone).all(), "nothing that moved is left out"


def test_samples_that_weighing_rejects_leave_the_store(samples: Samples, compiled_only: None) -> None:
    part, whole = shown(samples, parts=True), shown(samples, parts=False)
    for image in (part, whole):
        for k in range(1, 60):  # the plate covers wall: what it hides is rejected after half a second
            image.refresh(event_at(k, SEEN, scene_time=0.1 + 1e-6 * k), START + k * REFRESH_S)
    assert_array_equal(part.buffer.count, whole.buffer.count)
    assert part.buffer.count < len(samples)


def test_a_plate_that_leaves_leaves_nothing_behind(samples: Samples, compiled_only: None) -> None:
    image = shown(samples, parts=True)
    for k in range(1, 11):
        event = event_at(k, SEEN, scene_time=0.1 * k)
        image.refresh(event, START + k * REFRESH_S)
        image.insert(traced(SCENE, event, seen=SEEN), START + k * REFRESH_S, event)
    image.refresh(event_at(11, SEEN, scene_time=1.0), START + 11 * REFRESH_S)

    ideal = traced(SCENE, event_at(11, SEEN, scene_time=1.0), seen=SEEN)["radiance"].reshape(SIZE[1], SIZE[0], 3)
    wrong = np.abs(image.radiance - ideal).max(axis=2) > 0.3
    assert wrong.mean() < 0.002, "edges of the plate at most"


def test_with_empty_tiles_all_is_made_anew(compiled_only: None) -> None:
    """They are filled from afar, so every sample may show in them."""
    image = image_of(SCENE, SEEN)
    image.refresh(event_at(0, SEEN), START)
    image.insert(hits([(3.5, 3.5)], RED), START, event_at(0, SEEN))
    image.refresh(event_at(1, SEEN), START + REFRESH_S)
    assert (image.radiance[..., 0] > 0.1).all()
