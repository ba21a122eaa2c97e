"""What an event places, what it builds, and that trees apart from each other show what one tree shows."""

from __future__ import annotations

import gc
from dataclasses import replace

import numpy as np
import pytest
from small_scenes import image_of, instance, material, quad, scene_of, sphere_mesh, view, with_every_feature

from wall.core.data import NO_EDITS, Edits, Event
from wall.scene.model import PointLight
from wall.tracing import embree, instance_trees
from wall.tracing.tracer import Tracer
from wall.tracing.tracer_scene import make_tracer_scene

SEEN = view((0.0, 1.2, 4.0), (0.0, 0.0, 0.0), pixels=(48, 32))
LIGHT = PointLight(position=(1.5, 3.0, 1.0), intensity=(9.0, 9.0, 9.0))
PLACED = {
    "floor": instance(0, at=(0.0, -0.6, 0.0), turn=("x", -90.0)),
    "mirror": instance(1, at=(0.0, 0.4, -2.0)),
    "ball": instance(2, at=(-0.6, 0.0, 0.0), scale=0.5),
    "pane": instance(1, at=(0.9, 0.2, 0.4), scale=0.3),
}
BALL = 3  # its number in samples
NEXT = (("objects.ball.offset", (0.5, 0.1, 0.3)),)
LAST = (("objects.ball.offset", (0.7, 0.0, 0.3)), ("objects.pane.rotation", (0.0, 40.0, 0.0)))


def tracer() -> Tracer:
    meshes = [quad(8.0, 8.0, material=0), quad(4.0, 2.0, material=1), sphere_mesh(2, segments=12)]
    materials = [material(0.5, 0.5, 0.5), material(0.0, 0.0, 0.0, mirror=1.0), material(0.8, 0.2, 0.2)]
    placed = [replace(own, name=name) for name, own in PLACED.items()]
    scene = with_every_feature(scene_of(meshes, placed, materials=materials, lights=[LIGHT]))
    return Tracer(make_tracer_scene(scene), SEEN.panel, SEEN.eye, coherent=True)


def edited(*values: tuple[str, tuple[float, ...]]) -> Event:
    return replace(SEEN.event, edits=Edits(number=len(values), values=values))


def done(tracer: Tracer, event: Event) -> tuple[int, int]:
    """Instances placed and trees built for an event."""
    trees = tracer.instances
    placed, built = trees.placed, trees.built
    tracer.set_event(event)
    return trees.placed - placed, trees.built - built


@pytest.fixture
def parted(monkeypatch: pytest.MonkeyPatch) -> None:
    """What moves has a tree of its own in scenes as small as these."""
    monkeypatch.setattr(instance_trees, "LEAST_APART", 2)


def test_an_event_places_only_what_moved_and_builds_nothing_where_nothing_did() -> None:
    one = tracer()
    every = len(one.instances.placements)
    assert done(one, SEEN.event) == (every, 1)
    assert done(one, replace(SEEN.event, scene_event=2, scene_time=3.0)) == (0, 0)
    assert done(one, edited(*NEXT)) == (1, 1)
    assert done(one, edited(*LAST)) == (2, 1)
    elsewhere = view((0.0, 1.3, 4.0), (0.0, 0.0, 0.0), pixels=(48, 32)).event.camera
    assert done(one, replace(edited(*LAST), camera=elsewhere)) == (every, 1)
    assert done(one, SEEN.event) == (every, 1)


@pytest.mark.parametrize("apart", [False, True])
def test_rays_pass_what_is_hidden_without_a_look_at_its_mesh(apart: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """Under a matrix of zeros every ray visited every triangle: hiding a large model stopped its renderer."""
    masks: list[tuple[int, int]] = []
    own = embree.Device.mask
    monkeypatch.setattr(
        embree.Device, "mask", lambda self, of, mask: (masks.append((of, mask)), own(self, of, mask))[1]
    )
    if apart:
        monkeypatch.setattr(instance_trees, "LEAST_APART", 2)
    one = tracer()
    done(one, SEEN.event)
    before = image_of(one, SEEN)
    for number, hidden in enumerate([True, True, False, True, False], start=1):
        masks.clear()
        values = (("objects.ball.visible", (0.0,)), *NEXT[: number % 2]) if hidden else ()
        done(one, replace(SEEN.event, scene_event=number, edits=Edits(number=number, values=values)))
        ball = int(one.instances._geometries[BALL - 1])
        assert [mask for geometry, mask in masks if geometry == ball] in ([[0], []] if hidden else [[1], [2**32 - 1]])
    assert (image_of(one, SEEN).radiance == before.radiance).all()


def test_of_many_the_one_that_moves_goes_over_to_a_tree_of_its_own_once(parted: None) -> None:
    one = tracer()
    done(one, SEEN.event)
    assert done(one, edited(*NEXT)) == (1, 2)  # out of one tree, into the other
    assert done(one, edited((NEXT[0][0], (0.6, 0.1, 0.3)))) == (1, 1)
    assert one.instances.trees.objects.tolist() == [BALL - 1]
    assert done(one, replace(SEEN.event, edits=NO_EDITS)) == (1, 1)


def test_trees_apart_show_what_one_tree_shows(
    parted: None, monkeypatch: pytest.MonkeyPatch, compiled_only: None
) -> None:
    apart = tracer()
    for event in (SEEN.event, edited(*NEXT), edited(*LAST)):  # the ball alone has gone over, then both have
        apart.set_event(event)
        monkeypatch.setattr(instance_trees, "LEAST_APART", 100)
        whole = tracer()
        monkeypatch.setattr(instance_trees, "LEAST_APART", 2)
        whole.set_event(event)
        assert whole.instances.trees.moving == 0
        shown, wanted = (image_of(each, SEEN) for each in (apart, whole))
        assert (wanted.objects == BALL).sum() > 20
        for name in ("radiance", "depth", "objects"):
            np.testing.assert_array_equal(getattr(shown, name), getattr(wanted, name), err_msg=name)
        assert shown.cost == wanted.cost
    assert len(apart.instances.trees.objects) == 2


def test_instances_go_with_their_tracer_though_the_scene_stays(monkeypatch: pytest.MonkeyPatch) -> None:
    one = tracer()
    kept, trees = one._tracer_scene, one.instances.trees
    released: list[int] = []
    monkeypatch.setattr(embree._library, "rtcReleaseScene", released.append)
    del one
    gc.collect()
    assert trees.at_rest in released
    assert kept.meshes
