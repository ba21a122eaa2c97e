"""20,000 moving objects: a sample that came by packet moves with its own object, not with one of a shorter id."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from adaptive_images import GREEN, RED, START, event_at, glowing, hits, image_of
from small_scenes import instance, keyframes, quad, view

from wall.config.scene import KeyframesConfig
from wall.core.data import Batch, Rect
from wall.packets.samples import decode, encode
from wall.scene.build import Scene, assemble
from wall.scene.model import Source

COUNT, LAST = 20_000, 20_000  # objects that move right; index of the one that moves left, object id 20,001
SIZE = (48, 32)
SEEN = view((0.0, 0.0, 4.0), (0.0, 0.0, 0.0), pixels=SIZE)


def motion(x: float, name: str) -> KeyframesConfig:
    """By x units to the right in the first second."""
    return keyframes((0.0, 0.0, 0.0), (x, 0.0, 0.0), object=name)


@pytest.fixture(scope="module")
def scene() -> Scene:
    many = tuple(replace(instance(0), name="many") for _ in range(COUNT))
    return assemble(
        Source(
            meshes=(quad(1.0, 1.0, material=0),),
            materials=(glowing(GREEN),),
            instances=(*many, replace(instance(0), name="last")),
            animation=(motion(1.0, "many"), motion(-1.0, "last")),
        )
    )


@pytest.mark.parametrize("adaptive", [False, True])
def test_a_sample_of_object_20001_moves_with_it(scene: Scene, adaptive: bool) -> None:
    xy = np.stack(np.meshgrid(np.arange(22.5, 26), np.arange(14.5, 18)), axis=2).reshape(-1, 2)
    samples = hits(xy, RED, object_id=LAST + 1)
    event = event_at(0, SEEN)
    packet = encode(
        Batch(
            view=0, panel=0, rect=Rect(x=0, y=0, width=SIZE[0], height=SIZE[1]), rank=1, sequence=1, camera_event=0,
            scene_event=0, base_time=START, samples=samples, camera=event.camera, adaptive=adaptive,
        )
    )  # fmt: skip
    came = decode(packet)
    assert (came.samples["object_id"] == LAST + 1).all()

    image = image_of(scene, SEEN)
    image.refresh(event, START)
    image.insert(came.samples, came.base_time, event)
    image.refresh(event_at(1, SEEN, scene_time=1.0), START + 0.1)

    stored = image.stored()
    assert stored.in_use == len(samples)
    assert (stored.screen_position[0, : stored.in_use] < 20).all(), "they moved right, with the others"
