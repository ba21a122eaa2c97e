"""Parts of the objects: primary rays pass through the others, which shade and are mirrored all the same."""

from __future__ import annotations

import numpy as np
import pytest
from small_scenes import TracedImage, instance, material, quad, raster, scene_of, sphere_mesh, view, with_every_feature

from wall.core.data import Rect
from wall.sampling.ownership import block_order
from wall.scene.model import DirectionalLight
from wall.tracing.tracer import Tracer
from wall.tracing.tracer_scene import TracerScene, make_tracer_scene

FLOOR, MIRROR, BALL, SMALL = range(4)
LIGHT = DirectionalLight(direction=(0.6, 0.8, 0.0), irradiance=(2.0, 2.0, 2.0))
SEEN_FROM = view((0.0, 3.0, 6.0), (0.0, 0.6, 0.0), pixels=(64, 48))
PLACED = [
    instance(0, turn=("x", -90.0)),
    instance(1, at=(0.0, 1.0, -2.0)),
    instance(2, at=(0.0, 0.8, 0.0), scale=0.8),
    instance(2, at=(-1.3, 0.4, 0.6), scale=0.4),
]


@pytest.fixture(scope="module")
def tracer_scene() -> TracerScene:
    return tracer_scene_of(4)


def tracer_scene_of(objects: int) -> TracerScene:
    meshes = [quad(8.0, 8.0, material=0), quad(4.0, 2.0, material=1), sphere_mesh(2, segments=24)]
    materials = [material(0.5, 0.5, 0.5), material(0.0, 0.0, 0.0, mirror=1.0), material(0.8, 0.2, 0.2)]
    scene = scene_of(meshes, PLACED[:objects], materials=materials, lights=[LIGHT])
    return make_tracer_scene(with_every_feature(scene))


def traced(tracer_scene: TracerScene, *, without: tuple[int, ...] = (), coherent: bool) -> TracedImage:
    seen = np.array([k not in without for k in range(len(tracer_scene.meshes))]) if without else None
    tracer = Tracer(tracer_scene, SEEN_FROM.panel, SEEN_FROM.eye, coherent=coherent, seen=seen)
    tracer.set_event(SEEN_FROM.event)
    width, height = SEEN_FROM.panel.pixels
    pixels = block_order(Rect(x=0, y=0, width=width, height=height), worker=0, workers=1)
    samples, cost = tracer.trace((pixels + 0.5).astype(np.float32))
    return raster(samples, SEEN_FROM.panel.pixels, cost)


@pytest.mark.parametrize("coherent", [False, True])
def test_what_is_unseen_is_not_hit_but_shades_and_is_mirrored(
    tracer_scene: TracerScene, coherent: bool, compiled_only: None
) -> None:
    whole = traced(tracer_scene, coherent=coherent)
    part = traced(tracer_scene, without=(SMALL,), coherent=coherent)
    gone = traced(tracer_scene_of(3), coherent=coherent)
    hidden = whole.objects == SMALL + 1

    assert hidden.sum() > 20
    assert not (part.objects == SMALL + 1).any()
    np.testing.assert_array_equal(part.objects[hidden], gone.objects[hidden])
    for name in ("radiance", "depth", "objects"):
        np.testing.assert_array_equal(getattr(part, name)[~hidden], getattr(whole, name)[~hidden], err_msg=name)
    differs = np.abs(part.radiance - gone.radiance).max(axis=-1) > 0.05
    assert (differs & (gone.objects == FLOOR + 1)).sum() > 10, "its shadow"
    assert (differs & (gone.objects == MIRROR + 1)).sum() > 3, "its mirror image"


@pytest.mark.parametrize("coherent", [False, True])
def test_the_nearest_of_parts_is_the_whole(tracer_scene: TracerScene, coherent: bool, compiled_only: None) -> None:
    whole = traced(tracer_scene, coherent=coherent)
    parts = [traced(tracer_scene, without=without, coherent=coherent) for without in ((FLOOR, MIRROR), (BALL, SMALL))]
    nearest = np.argmin([part.depth for part in parts], axis=0)
    assert 0.05 < nearest.mean() < 0.95
    for name in ("radiance", "depth", "objects"):
        first, second = (getattr(part, name) for part in parts)
        chosen = np.where((nearest == 0)[..., None] if first.ndim == 3 else nearest == 0, first, second)
        np.testing.assert_array_equal(chosen, getattr(whole, name), err_msg=name)


def test_object_ids_do_not_wrap_at_sixteen_bits(compiled_only: None) -> None:
    """70,000 panes of which all but the last stand far aside: that one has id 70,000, not 70,000 - 65,536."""
    count = 70_000
    aside = instance(0, at=(0.0, -1e3, 0.0))
    scene = make_tracer_scene(scene_of([quad(4.0, 4.0)], [aside] * (count - 1) + [instance(0)], lights=[LIGHT]))
    seen = view((0.0, 0.0, 3.0), (0.0, 0.0, 0.0), pixels=(16, 16))
    tracer = Tracer(scene, seen.panel, seen.eye, coherent=False)
    tracer.set_event(seen.event)
    samples, _ = tracer.trace(np.array([[8.5, 8.5]], np.float32))
    assert samples["object_id"].tolist() == [count]
