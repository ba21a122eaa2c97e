"""Stored samples that lie where a scene is cut away go at once, whatever moved: the cut, an object, or time."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from adaptive_images import EVENT_S, FRONT, GREEN, PLATE, RED, SIZE, START, centres, event_at, hits, image_of
from adaptive_images import plate_before_wall as wall_and_plate
from small_scenes import Triple, instance

from wall.core.data import Edits, Event, Samples
from wall.deepbuffer.cuts import planes_in_objects
from wall.deepbuffer.kernels.cuts import NEAR, reject_cut_away
from wall.deepbuffer.store import SampleStore
from wall.reconstruction.reconstruction import Reconstruction
from wall.scene.build import Scene
from wall.scene.cuts import planes_of
from wall.scene.model import Cut

BEFORE_THE_WALL = Cut(position=(0.0, 0.0, 1.0), normal=(0.0, 0.0, 1.0), enabled=False)  # the plate stands at z = 2
RIGHT = Cut(position=(0.2, 0.0, 0.0), normal=(1.0, 0.0, 0.0))


def plate_before_wall(*places: Triple, cut: Cut = BEFORE_THE_WALL) -> Scene:
    return replace(wall_and_plate(*places), cuts=(cut,))


def on_wall() -> Samples:
    return hits(centres(SIZE), GREEN)


def on_plate(x: float = 24.0) -> Samples:
    """In the middle of the image, or about another column."""
    return hits(np.array([(x + 0.3 * k % 2, 15.2 + 0.1 * k) for k in range(12)]), RED, depth=2.0, object_id=PLATE)


def cutting(event: Event, enabled: float = 1.0) -> Event:
    return replace(event, edits=Edits(event.scene_event, (("cuts.0.enabled", (enabled,)),)))


def red(image: Reconstruction) -> float:
    return float(image.radiance[..., 0].max())


def kept_of_plate(image: Reconstruction) -> int:
    """Samples of the plate that were not rejected."""
    store, count = image.buffer.store, image.count
    return int(((store.object_id[:count] == PLATE) & (store.confidence[:count] > 0.0)).sum())


def shown(scene: Scene) -> Reconstruction:
    """An image of the plate before the wall."""
    image = image_of(scene)
    image.insert(on_wall(), START, event_at(0))
    image.insert(on_plate(), START, event_at(0))
    image.refresh(event_at(0), START + EVENT_S)
    assert red(image) > 0.3
    return image


@pytest.mark.parametrize("cuts", [1, 3])
def test_the_kernel_is_its_twin_and_objects_frames_are_the_world(
    random_numbers: np.random.Generator, cuts: int
) -> None:
    """Points are brought to the world in float64 and compared with the planes there."""
    placed = np.stack([
        instance(0, at=(3.0, -1.0, 0.5), turn=("y", 40.0), scale=(2.0, 1.0, 0.5)).world_from_object,
        instance(0, at=(-1.0, 0.0, 0.0), turn=("x", -70.0)).world_from_object,
    ])  # fmt: skip
    scene = wall_and_plate((0.0, 0.0, 2.0))
    all_cuts = RIGHT, Cut(position=(0.0, 0.3, 0.0), normal=(0.5, -2.0, 1.0)), replace(RIGHT, enabled=False)
    shading = replace(scene.shading(0.0), cuts=all_cuts[:cuts])
    moment = replace(scene.at(0.0), world_from_object=placed, shading=shading)
    store = SampleStore.of(500, lit=False)
    store.position[:] = random_numbers.normal(size=(3, 500))
    store.object_id[:], store.confidence[:] = random_numbers.integers(0, 3, 500), 1.0
    planes = planes_of(shading.cuts, np.zeros(3))
    matrices = placed[np.maximum(store.object_id, 1) - 1]
    world = (matrices[:, :3, :3] @ store.position.T[:, :, None])[:, :, 0] + matrices[:, :3, 3]
    beyond = (world @ planes[:, :3].T - planes[:, 3]).max(axis=1)
    sure, gone = np.abs(beyond) > 20 * NEAR, (beyond > 0.0) & (store.object_id > 0)
    rejected = reject_cut_away(store, 490, planes_in_objects(moment))
    assert rejected == (store.confidence == 0.0).sum() > 100
    np.testing.assert_array_equal(store.confidence[:490][sure[:490]], np.where(gone, 0.0, 1.0)[:490][sure[:490]])
    assert (store.confidence[490:] == 1.0).all()


def test_what_an_edit_cuts_away_goes_with_the_next_image_and_late_samples_of_it_too() -> None:
    image, after = shown(plate_before_wall((0.0, 0.0, 2.0))), cutting(event_at(1))
    for k in range(1, 4):
        image.refresh(after, START + k * EVENT_S)
        assert red(image) == 0.0
        assert kept_of_plate(image) == 0, "nor does it show in depth and object ids"
        image.insert(on_plate(), START + k * EVENT_S, event_at(0))  # traced before the edit
        image.insert(on_wall(), START + k * EVENT_S, after)
    assert image.nothing_moves


def test_samples_that_are_ahead_of_the_image_wait_for_it() -> None:
    """What the newer edit brings back is traced before the image shows that edit."""
    image, before, after = shown(plate_before_wall((0.0, 0.0, 2.0))), cutting(event_at(1)), cutting(event_at(2), 0.0)
    image.refresh(before, START + EVENT_S)
    image.refresh(before, START + 2 * EVENT_S)
    image.insert(on_plate(), START + 2 * EVENT_S, after)
    image.refresh(after, START + 3 * EVENT_S)
    assert red(image) > 0.3


def test_samples_that_move_with_their_object_go_where_it_is_cut() -> None:
    """The plate moves from x = -0.4 to 1.2, through a plane at 0.2 that stands still: half of it goes, then all."""
    scene = plate_before_wall((-0.4, 0.0, 2.0), (0.2, 0.0, 2.0), (1.2, 0.0, 2.0), cut=RIGHT)
    image, plate = image_of(scene), on_plate(16.0)
    plate["xy"][:, 0] = np.linspace(7.0, 20.0, len(plate))  # x = -0.88 to -0.2
    image.insert(on_wall(), START, event_at(0))
    image.insert(plate, START, event_at(0))
    left = []
    for k in range(3):
        image.refresh(event_at(k, scene_time=float(k)), START + (k + 1) * EVENT_S)
        left.append(kept_of_plate(image))
    assert left == [12, 8, 0]
    assert red(image) == 0.0


def test_the_sky_and_what_lies_in_a_plane_itself_stay() -> None:
    scene = plate_before_wall((0.0, 0.0, 2.0), cut=replace(BEFORE_THE_WALL, position=(0.0, 0.0, 0.0)))
    image = image_of(scene)
    sky = hits(centres(SIZE)[::2], (0.0, 0.0, 1.0), depth=np.inf, object_id=0)
    image.insert(sky, START, event_at(0))
    image.insert(on_wall()[1::2], START, event_at(0))  # at z = 0, in the plane
    for k in range(2):
        image.refresh(cutting(event_at(k + 1)), START + k * EVENT_S)
    assert (image.buffer.store.confidence[: image.count] > 0.0).all()
    assert FRONT.panel.pixels == SIZE
