"""Scenes of a few triangles as wall measure accuracy has them, batches and keyframes for tests."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from wall.config.scene import KeyframeConfig, KeyframesConfig, RotationConfig
from wall.core.data import Batch, Event, Rect, Samples
from wall.study.accuracy.scenes import (
    BLACK,
    BLACK_SKY,
    TracedImage,
    Triple,
    View,
    directions,
    flat_wall,
    image_of,
    instance,
    material,
    moved_scene,
    quad,
    raster,
    scene_of,
    sphere_mesh,
    traced_image,
    traced_with_every_feature,
    turned,
    view,
    with_every_feature,
)

__all__ = [
    "BLACK",
    "BLACK_SKY",
    "TracedImage",
    "Triple",
    "View",
    "batch_of",
    "directions",
    "flat_wall",
    "image_of",
    "instance",
    "keyframes",
    "material",
    "moved_scene",
    "quad",
    "raster",
    "scene_of",
    "sphere_mesh",
    "traced_image",
    "traced_with_every_feature",
    "turned",
    "view",
    "with_every_feature",
]


def batch_of(samples: Samples, event: Event, rect: Rect, *, sequence: int = 1, blend: float = 1.0) -> Batch:
    """A packet's worth, as rank 1 would send it."""
    return Batch(
        view=0,
        panel=0,
        rect=rect,
        rank=1,
        sequence=sequence,
        camera_event=event.camera_event,
        scene_event=event.scene_event,
        base_time=event.input_time + sequence * 1e-3,
        samples=samples,
        blend=blend,
    )


def keyframes(
    *positions: Triple, times: Sequence[float] | None = None, loop: bool = False, **more: Any
) -> KeyframesConfig:
    """A path through positions, one a second; `degrees`: turns about y; `object` or `light`: what moves."""
    degrees = more.pop("degrees", [])
    turns = [RotationConfig(axis=(0.0, 1.0, 0.0), degrees=turn) for turn in degrees] or [None] * len(positions)
    keys = tuple(
        KeyframeConfig(time=time, position=at, rotation=turn)
        for time, at, turn in zip(times or range(len(positions)), positions, turns, strict=True)
    )
    return KeyframesConfig(type="keyframes", keyframes=keys, loop=loop, **(more or {"object": "*"}))
