"""Scenes from Python: the words of configurations, their refusals, and what sources bring stays."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import wall
from wall.commands.inputs import CAMERAS
from wall.config.loading import load
from wall.core.errors import ConfigError
from wall.scene.sources import BUILT_IN
from wall.scripting.own_words import source_of

CONFIG = """\
version: 1
scene: {source: courtyard}
wall: {grid: {columns: 1, rows: 1, pixels: [40, 30], size: [0.4, 0.3]}}
views: [{}]
"""


def test_importing_wall_loads_nothing_else() -> None:
    code = (
        "import sys, wall; print(*(name for name in sys.modules if name.split('.')[0] in ('wall', 'numpy', 'numba')))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["wall"]


def test_every_built_in_scene_can_be_opened_by_its_name() -> None:
    assert CAMERAS.keys() == BUILT_IN.keys()
    scene = wall.Scene("cornell")
    assert scene.loaded.config.scene.source == "cornell"
    assert scene.loaded.config.views[0].camera.fov == 39.3


def test_what_is_neither_file_nor_scene_is_refused_with_what_there_is() -> None:
    with pytest.raises(
        ConfigError, match=r"courtyart: no such file, nor a built-in scene; .* did you mean courtyard\?"
    ):
        wall.Scene("courtyart")


def test_a_folder_hides_no_built_in_scene(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "cornell").mkdir()
    monkeypatch.chdir(tmp_path)
    assert wall.Scene("cornell").loaded.config.scene.source == "cornell"


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ({"type": "pint"}, "scene.lights[0].type = 'pint': is not known"),
        ({"type": "point", "position": (1, 2), "intensity": (1, 1, 1)}, "scene.lights[0].position[2]: is missing"),
        ({"type": "point", "position": (1, 2, 3), "intensity": "red"}, "lights[0].intensity = 'red': is no colour"),
        ({"type": "point", "position": np.ones(3), "intensity": (1, 1, 1), "size": 3}, "lights[0].size: unknown key"),
        ({"type": "point", "position": object()}, "is no value of a configuration"),
    ],
)
def test_bad_words_are_refused_as_in_a_file_and_change_nothing(words: dict[str, object], said: str) -> None:
    scene = wall.Scene("courtyard")
    scene.set(lights=[])
    before, values = scene.loaded, scene.values
    with pytest.raises(ConfigError) as refused:
        scene.add_light(**words)
    assert said in str(refused.value)
    assert (scene.loaded, scene.values) == (before, values)


def test_a_refusal_is_that_of_a_file_but_for_the_line(tmp_path: Path) -> None:
    path = tmp_path / "wall.yaml"
    path.write_text(CONFIG.replace("courtyard}", "courtyard, sky: {zenit: [1, 1, 1]}}"))
    with pytest.raises(ConfigError) as of_file:
        load(path)
    path.write_text(CONFIG)
    with pytest.raises(ConfigError) as of_python:
        wall.Scene(path).set(sky={"zenit": (1, 1, 1)})
    assert str(of_file.value).replace(f"{path}:2:34", str(path)) == str(of_python.value)


def test_what_is_added_joins_what_the_source_brings() -> None:
    scene = wall.Scene("arcade")
    own = scene.planned(scene.loaded)[0].scene
    scene.add_light(type="point", position=(1, 2, 3), intensity=(4, 5, 6))
    scene.add_animation(type="spin", object="column*", period_s=3)
    scene.add_material(type="metal", object="floor")
    scene.add_material(type="diffuse", object="beam*", color=(1, 0, 0))
    scene.add_cut(position=(0, 0, 1), normal=(0, 0, 1))
    scene.add_object("spheres")
    both = scene.planned(scene.loaded)[0].scene
    assert both.lights[:-1] == own.lights
    assert both.lights[-1].position == (1, 2, 3)
    names = [each.name for each in both.instances]
    assert {names[k].split()[0] for k in both.tracks.bodies} == {"column"}
    assert {"beam -2.6", "metal ball"} < set(names)
    look = {each.name: both.materials[both.meshes[each.mesh].material] for each in both.instances}
    assert (look["floor"].metallic, look["beam -2.6"].base_color) == (1.0, (1.0, 0.0, 0.0))
    assert len(both.cuts) == 1
    scene.set(lights=None, cuts=None)
    assert scene.planned(scene.loaded)[0].scene.lights == own.lights


def test_a_source_that_moves_goes_on_moving() -> None:
    scene = wall.Scene("courtyard")
    own = source_of(scene.loaded).animation
    scene.add_animation(type="spin", object="rock", period_s=3)
    assert (scene.loaded.config.scene.animation or ())[:-1] == own


def test_a_model_without_lights_keeps_those_that_it_was_given(tmp_path: Path) -> None:
    import trimesh

    trimesh.creation.box().export(tmp_path / "box.obj")
    scene = wall.Scene(tmp_path / "box.obj", up="z")
    scene.add_light(type="spot", position=(0, 3, 0), direction=(0, -1, 0), intensity=(1, 1, 1))
    lights = scene.planned(scene.loaded)[0].scene.lights
    assert [type(light).__name__ for light in lights] == ["DirectionalLight", "SpotLight"]
    assert scene.loaded.config.scene.up == "z"


def test_models_are_loaded_once_however_often_views_change() -> None:
    scene = wall.Scene("arcade")
    first = scene.planned(scene.with_views([0], {"integrator": {"method": "path"}}))
    second = scene.planned(scene.with_views([0], {"camera": "auto"}))
    assert first[1] is second[1]
    assert first[0].scene.path_depth == 6
    assert second[0].scene.path_depth is None
    scene.add_light(type="point", position=(1, 2, 3), intensity=(4, 5, 6))
    assert scene.planned(scene.loaded)[1] is not first[1]


def test_objects_are_listed_and_a_file_that_is_not_there_is_refused_at_once(tmp_path: Path) -> None:
    scene = wall.Scene("spheres")
    before = scene.objects
    assert len(before) > 1
    with pytest.raises(ConfigError, match=r"nofile\.glb: no such file"):
        scene.add_object(tmp_path / "nofile.glb")
    (tmp_path / "cow.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    scene.add_object(tmp_path / "cow.obj")
    assert scene.objects == (*before, "cow.obj")


def test_data_that_is_given_for_a_model_is_told_from_it(tmp_path: Path) -> None:
    (tmp_path / "field.vti").write_text("<VTKFile/>")
    with pytest.raises(ConfigError, match="is data, and no model"):
        wall.Scene(tmp_path / "field.vti")


def test_models_of_other_formats_are_no_configurations(tmp_path: Path) -> None:
    (tmp_path / "cow.fbx").write_bytes(b"Kaydara FBX Binary  ")
    with pytest.raises(ConfigError, match=r"no kind of model that is read; those are \.glb, "):
        wall.Scene(tmp_path / "cow.fbx")
