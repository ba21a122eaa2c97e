"""A ground lies under the lowest point of everything, is framed by no camera and moved by no pattern."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from wall.commands.inputs import load_any
from wall.config.loading import load, with_scene
from wall.config.scene import SceneConfig
from wall.scene.bounds import world_boxes
from wall.scene.build import build

OBJ = "v 0 2 0\nv 1 2 0\nv 0 5 0\nf 1 2 3\n"
SPIN = {"type": "spin", "object": "*", "period_s": 5}
DEMO = Path(__file__).parents[3] / "configs" / "demo.yaml"


@pytest.fixture
def model(tmp_path: Path) -> Path:
    path = tmp_path / "cow.obj"
    path.write_text(OBJ)
    return path


def test_the_ground_touches_the_lowest_point_and_changes_no_framing(model: Path) -> None:
    with_it = SceneConfig.model_validate({"source": "cow.obj", "ground": True, "animation": [SPIN]})
    one, other = (build(each, model.parent) for each in (with_it, with_it.model_copy(update={"ground": False})))
    assert [instance.name for instance in one.instances][len(other.instances) :] == ["ground plane"]
    low, high = world_boxes(one.meshes, one.instances[-1:])[0]
    assert 2.0 - 0.01 * one.radius < low[1] == high[1] < 2.0, "a floor at that height is nearer to an eye above"
    assert np.allclose(high[[0, 2]] - low[[0, 2]], 120.0 * one.radius, rtol=1e-2)
    assert (one.radius, *one.center) == (other.radius, *other.center)
    assert len(one.animated_objects) == len(other.animated_objects) == 1


def test_triangles_of_the_ground_look_up(model: Path) -> None:
    made = build(SceneConfig(source="cow.obj", ground=True), model.parent)
    mesh = made.meshes[made.instances[-1].mesh]
    a, b, c = (mesh.vertices[mesh.triangles[:, k]].astype(np.float64) for k in range(3))
    assert (np.cross(b - a, c - a)[:, 1] > 0.0).all()


def test_models_without_a_configuration_stand_on_one_and_built_in_scenes_do_not(model: Path) -> None:
    assert load_any(model).config.scene.ground
    assert with_scene(load(DEMO), model).config.scene.ground
    assert not load_any("courtyard").config.scene.ground
    assert not with_scene(load(DEMO), "courtyard").config.scene.ground
