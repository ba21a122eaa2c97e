"""Objects that are moved, turned, scaled and hidden: their poses, about middles that stay where they are."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from wall.config.scene import SceneConfig
from wall.core.data import Edits
from wall.scene.build import build
from wall.scene.object_edits import rotation_of

NAME = "knot"


@pytest.fixture(scope="module")
def scene():
    return build(SceneConfig(source="gallery"), Path())


def points(scene, time=0.0, **edits):
    """World positions of all vertices of the object, as it is edited."""
    values = tuple(sorted((f"objects.{NAME}.{what}", value) for what, value in edits.items()))
    moment = scene.at(time, Edits(1, values)) if values else scene.at(time)
    rows = [k for k, instance in enumerate(scene.instances) if instance.name == NAME]
    found = []
    for row in rows:
        vertices = scene.meshes[scene.instances[row].mesh].vertices.astype(np.float64)
        pose = moment.world_from_object[row]
        found.append(vertices @ pose[:3, :3].T + pose[:3, 3])
    return np.concatenate(found)


def middle(scene, time=0.0, **edits):
    """The mean of the middles of the bounding boxes that its meshes have in their own frames."""
    values = tuple(sorted((f"objects.{NAME}.{what}", value) for what, value in edits.items()))
    poses = scene.at(time, Edits(1, values)).world_from_object if values else scene.at(time).world_from_object
    found = []
    for instance, pose in zip(scene.instances, poses, strict=True):
        if instance.name == NAME:
            vertices = scene.meshes[instance.mesh].vertices
            found.append(pose @ [*((vertices.min(axis=0) + vertices.max(axis=0)) / 2.0), 1.0])
    return np.mean(found, axis=0)[:3]


@pytest.mark.parametrize("time", [0.0, 1.3])
def test_what_is_turned_keeps_its_shape_and_its_middle(scene, time):
    turn = {"rotation": (20.0, 30.0, 40.0)}
    before, after = points(scene, time), points(scene, time, **turn)
    apart = np.linalg.norm(before[::7] - before[3], axis=1)
    assert np.linalg.norm(after[::7] - after[3], axis=1) == pytest.approx(apart, abs=1e-9)
    assert middle(scene, time, **turn) == pytest.approx(middle(scene, time), abs=1e-9)
    assert np.abs(before - after).max() > 0.05


@pytest.mark.parametrize("factor", [1e-3, 0.5, 3.0])
def test_what_is_scaled_keeps_its_form_and_its_middle(scene, factor):
    edits = {"scale": (factor,), "rotation": (20.0, 30.0, 40.0), "offset": (0.1, 0.2, 0.3)}
    before, after = points(scene), points(scene, **edits)
    apart = np.linalg.norm(before[::7] - before[3], axis=1)
    assert np.linalg.norm(after[::7] - after[3], axis=1) == pytest.approx(factor * apart, abs=1e-9)
    assert middle(scene, **edits) == pytest.approx(middle(scene) + np.array([0.1, 0.2, 0.3]), abs=1e-9)


def test_four_quarters_are_no_turn_and_offsets_add(scene):
    assert points(scene, rotation=(0.0, 0.0, 360.0)) == pytest.approx(points(scene), abs=1e-9)
    turned = points(scene, rotation=(90.0, 0.0, 0.0))
    both = points(scene, rotation=(90.0, 0.0, 0.0), offset=(1.0, 2.0, 3.0))
    assert both - turned == pytest.approx(np.broadcast_to((1.0, 2.0, 3.0), turned.shape), abs=1e-9)


@pytest.mark.parametrize(
    ("degrees", "start", "end"),
    [
        ((90, 0, 0), (0, 1, 0), (0, 0, 1)),
        ((0, 90, 0), (0, 0, 1), (1, 0, 0)),
        ((0, 0, 90), (1, 0, 0), (0, 1, 0)),
        ((90, 90, 0), (0, 1, 0), (1, 0, 0)),  # about x first: y to z, then z to x
    ],
)
def test_turns_are_counterclockwise_and_about_x_first(degrees, start, end):
    assert rotation_of(degrees) @ np.array(start, float) == pytest.approx(np.array(end, float), abs=1e-12)
    assert np.linalg.det(rotation_of((12.0, -34.0, 200.0))) == pytest.approx(1.0)


def test_what_lies_below_an_object_goes_along(scene):
    rows = [k for k, instance in enumerate(scene.instances) if instance.name == NAME]
    other = next(k for k, instance in enumerate(scene.instances) if instance.name != NAME)
    instances = tuple(replace(each, parents=(NAME,)) if k == other else each for k, each in enumerate(scene.instances))
    built = replace(scene, instances=instances)
    before = built.at(0.0).world_from_object.copy()
    own = scene.instances[other].name
    values = ((f"objects.{NAME}.offset", (1.0, 2.0, 3.0)), (f"objects.{own}.offset", (0.0, 0.0, 1.0)))
    after = built.at(0.0, Edits(1, values)).world_from_object
    assert (after - before)[rows, :3, 3] == pytest.approx(np.tile([1.0, 2.0, 3.0], (len(rows), 1)))
    assert (after - before)[other, :3, 3] == pytest.approx([1.0, 2.0, 4.0])


@pytest.mark.parametrize("child", ["axle", "wheel"])
def test_a_part_is_moved_after_the_whole_was_turned_and_alone(scene, child):
    """Whichever name comes first: offsets are along the world's axes, and the whole turns about its own middle."""
    rows = [k for k, instance in enumerate(scene.instances) if instance.name == NAME]
    other = next(k for k, instance in enumerate(scene.instances) if instance.name != NAME)
    instances = [replace(each, name="truck") if k in rows else each for k, each in enumerate(scene.instances)]
    instances[other] = replace(instances[other], name=child, parents=("truck",))
    built = replace(scene, instances=tuple(instances))
    turn = ("objects.truck.rotation", (0.0, 90.0, 0.0))
    offset = (f"objects.{child}.offset", (1.0, 0.0, 0.0))
    turned = built.at(0.0, Edits(1, (turn,))).world_from_object.copy()
    both = built.at(0.0, Edits(2, tuple(sorted((turn, offset))))).world_from_object
    assert (both - turned)[other, :3, 3] == pytest.approx([1.0, 0.0, 0.0])
    assert (both - turned)[rows] == pytest.approx(0.0)
