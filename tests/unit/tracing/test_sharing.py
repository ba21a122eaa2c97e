"""Batches whose rays several threads share."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from small_scenes import BLACK_SKY, instance, material, quad, scene_of, sphere_mesh, view, with_every_feature

from wall.core.data import Samples
from wall.scene.build import Scene
from wall.scene.model import AmbientOcclusion, PointLight
from wall.tracing.tracer import RAYS_A_THREAD, Traced, Tracer
from wall.tracing.tracer_scene import make_tracer_scene

SEEN = view((0.0, 0.0, 4.0), (0.0, 0.0, 0.0), pixels=(48, 32))
TWICE = 2 * 48 * 32  # rays: each pixel's twice, far from each other in the batch


def ball_and_squares(blue: float = math.nan) -> Scene:
    """A ball that mirrors a square behind the eye, a corner of which is broken, before a small square."""
    colors = [[1, 1, 1], [1, 1, 1], [1, 1, 1], [1, 1, blue]]
    return scene_of(
        [sphere_mesh(segments=24), quad(9.0, 9.0, material=1, colors=colors), quad(3.0, 3.0, material=1)],
        [instance(0), instance(1, at=(0.13, 0.31, 9.0), turn=("y", 170.0)), instance(2, at=(0.5, 0.2, -1.1))],
        materials=[material(0.2, 0.4, 0.6, mirror=0.5), material(1, 1, 1)],
        lights=[PointLight(position=(3.0, 0.0, 4.0), intensity=(100.0, 100.0, 100.0))],
    )


def occluded() -> Scene:
    """A ball before a square; the same features as in test_ambient.py."""
    scene = scene_of([sphere_mesh(), quad(9.0, 9.0)], [instance(0), instance(1, at=(0, 0, -1.1))], sky=BLACK_SKY)
    return replace(scene, path_depth=1, occlusion=AmbientOcclusion(distance=1e4, colors=False))


SCENES = {
    "direct": lambda: with_every_feature(ball_and_squares()),
    "paths": lambda: with_every_feature(replace(ball_and_squares(), path_depth=3)),
    "ambient": occluded,
}


def traced(scene: Scene, threads: int) -> tuple[Samples, Traced]:
    tracer = Tracer(make_tracer_scene(scene), SEEN.panel, SEEN.eye, coherent=False, threads=threads)
    tracer.set_event(SEEN.event)
    y, x = np.mgrid[0:32, 0:48]
    xy = np.tile(np.stack([x.ravel(), y.ravel()], axis=1).astype(np.float32) + np.float32(0.5), (2, 1))
    tracer.trace(xy[:100])  # less than a thread's: one thread traces it
    return tracer.trace(xy)


@pytest.mark.parametrize("kind", SCENES)
def test_samples_are_the_same_bit_for_bit_however_many_threads_share_them(compiled_only: None, kind: str) -> None:
    """A pixel's samples are numbered before they are shared: its second is no copy of its first."""
    assert TWICE >= 8 * RAYS_A_THREAD
    scene = SCENES[kind]()
    alone, cost = traced(scene, 1)
    assert cost.primary == TWICE
    for threads in (2, 3, 8):
        shared, other = traced(scene, threads)
        assert other == cost
        np.testing.assert_array_equal(shared, alone)
    assert len(alone) == TWICE - cost.bad
    if kind == "direct":
        assert cost.bad >= 20
        whole, _ = traced(with_every_feature(ball_and_squares(1.0)), 3)
        assert np.isinf(alone["depth"]).sum() == np.isinf(whole["depth"]).sum(), "rays into the sky lost nothing"
    else:
        first, second = alone["radiance"].reshape(2, -1, 3)
        hit = np.isfinite(alone["depth"][: len(first)])
        assert (first != second).any(axis=1)[hit].mean() > 0.05


def test_no_rays_give_no_samples(compiled_only: None) -> None:
    tracer = Tracer(make_tracer_scene(with_every_feature(ball_and_squares())), SEEN.panel, SEEN.eye, coherent=False)
    tracer.set_event(SEEN.event)
    samples, cost = tracer.trace(np.empty((0, 2), np.float32))
    assert len(samples) == cost.primary == 0
