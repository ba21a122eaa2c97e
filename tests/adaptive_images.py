"""Scenes and samples for images made by reprojection: a glowing wall, a plate before it, hits made by hand."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike
from small_scenes import Triple, View, instance, keyframes, quad, view

from wall.core.data import SAMPLE, Event, Float32, Float64, Samples
from wall.reconstruction.reconstruction import Ingredients, Reconstruction
from wall.scene.build import Scene, assemble
from wall.scene.model import Instance, Material, PointLight, Source
from wall.tracing.tracer import Tracer
from wall.tracing.tracer_scene import make_tracer_scene

GREEN: Triple = (0.0, 0.5, 0.0)
RED: Triple = (0.5, 0.0, 0.0)
WALL, PLATE = 1, 2  # object ids
START = 100.0  # seconds
EVENT_S = 0.1  # far more than a refresh, so that nothing is young any more
SIZE = (48, 32)
FRONT = view((0.0, 0.0, 4.0), (0.0, 0.0, 0.0), pixels=SIZE)  # the wall is 4 before the eye, the plate 2


def glowing(color: Triple) -> Material:
    return Material(name="glowing", base_color=(0.0, 0.0, 0.0), emission=color)


def plate_before_wall(*places: Triple, lights: tuple[PointLight, ...] = ()) -> Scene:
    """A green wall that fills the image, and a red plate of 1 x 1 before it, at places[k] at k seconds."""
    instances = (
        replace(instance(0), name="wall"),
        Instance(name="plate", mesh=1, world_from_object=instance(1, at=places[0]).world_from_object),
    )
    return assemble(
        Source(
            meshes=(quad(40.0, 40.0, material=0), quad(1.0, 1.0, material=1)),
            materials=(glowing(GREEN), glowing(RED)),
            instances=instances,
            lights=lights,
            animation=(keyframes(*places, object="plate"),) if len(places) > 1 else (),
        )
    )


def event_at(k: int, seen: View = FRONT, *, scene_time: float = 0.0, **camera: Triple) -> Event:
    """Event number (k, k): `camera` moves it to another position."""
    looking = replace(seen.event.camera, **camera) if camera else seen.event.camera
    return replace(
        seen.event, camera_event=k, scene_event=k, scene_time=scene_time, input_time=START + k, camera=looking
    )


def image_of(
    scene: Scene, seen: View = FRONT, *, detects_change: bool = False, kept: float = 4.0, parts: bool = True
) -> Reconstruction:
    """`parts`: where only some tiles change, only those are made anew."""
    return Reconstruction(
        seen.panel, seen.eye, scene, detects_change=detects_change, samples_per_pixel=kept,
        ingredients=Ingredients(parts=parts),
    )  # fmt: skip


def centres(size: tuple[int, int]) -> Float32:
    """(n, 2) float32, row by row."""
    x, y = np.meshgrid(np.arange(size[0]) + 0.5, np.arange(size[1]) + 0.5)
    return np.stack([x.ravel(), y.ravel()], axis=1).astype(np.float32)


def traced(scene: Scene, event: Event, xy: Float32 | None = None, seen: View = FRONT) -> Samples:
    """By the tracer; at every pixel's centre if `xy` is None. Their time is the batch's base time."""
    tracer = Tracer(make_tracer_scene(scene), seen.panel, seen.eye, coherent=False)
    tracer.set_event(event)
    samples = tracer.trace(centres(seen.panel.pixels) if xy is None else xy)[0].copy()
    samples["time"] = 0.0
    samples["change"] = 0.0
    return samples


def image(samples: Samples, size: tuple[int, int]) -> Float32:
    """(h, w, 3) radiance of samples at all pixel centres."""
    shown = np.full((size[1], size[0], 3), np.nan, np.float32)
    x, y = samples["xy"].astype(int).T
    shown[y, x] = samples["radiance"]
    return shown


def hits(
    xy: ArrayLike, color: Sequence[float] | Float64 | Float32, *, depth: float = 4.0, object_id: int = WALL
) -> Samples:
    """Samples made by hand."""
    positions = np.asarray(xy, np.float32).reshape(-1, 2)
    samples = np.zeros(len(positions), SAMPLE)
    samples["xy"], samples["radiance"], samples["depth"], samples["object_id"] = positions, color, depth, object_id
    return samples
