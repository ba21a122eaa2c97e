"""Materials by name: who gets them, what stays, and what is said about names that fit nothing."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import pytest
from PIL import Image

from wall.config.loading import loads
from wall.core.errors import ConfigError, SceneError
from wall.scene.build import Scene, build
from wall.scene.needs import needs

HERE = Path(__file__).parent
QUAD = "v 0 0 0\nv 1 0 0\nv 1 1 0\nf 1 2 3\n"


def scene_with(*materials: str, source: str = "cornell", more: str = "", folder: Path = HERE) -> Scene:
    text = f"""\
version: 1
scene: {{source: {source}, materials: [{", ".join(materials)}]{more}}}
wall: {{grid: {{columns: 1, rows: 1, pixels: [8, 8], size: [0.1, 0.1]}}}}
views: [{{}}]
"""
    return build(loads(text, path=folder / "wall.yaml").config.scene, folder)


def look(scene: Scene, name: str) -> Any:
    instance = next(i for i in scene.instances if i.name == name)
    return scene.materials[scene.meshes[instance.mesh].material]


def test_objects_get_materials_and_the_last_one_wins() -> None:
    scene = scene_with(
        "{object: '* box', type: metal, color: [0.9, 0.8, 0.1], roughness: 0.2}", "{object: large box, type: glass}"
    )
    small, large = look(scene, "small box"), look(scene, "large box")
    assert (small.metallic, small.roughness, small.base_color) == (1.0, 0.2, (0.9, 0.8, 0.1))
    assert (large.transmission, large.metallic, large.ior, large.base_color) == (1.0, 0.0, 1.5, (1.0, 1.0, 1.0))
    assert look(scene, "floor").metallic == 0.0
    assert look(scene, "lamp").emission[0] > 10.0


def test_what_glass_absorbs_is_its_colour_after_the_distance() -> None:
    glass = "type: glass, attenuation: {color: [1.0, 0.5, 0.25], distance: 2.0}"
    scene = scene_with(f"{{object: '* box', {glass}}}", "{object: small box, type: glass}")
    small, large = look(scene, "small box"), look(scene, "large box")
    assert small.absorption == (0.0, 0.0, 0.0)
    assert large.absorption == pytest.approx((0.0, math.log(2.0) / 2.0, math.log(2.0)))
    assert (needs(scene).absorption, needs(scene).thin_glass, needs(scene).solid_glass) == (True, False, True)
    thin = needs(scene_with("{object: small box, type: glass, thin: true}"))
    assert (thin.thin_glass, thin.solid_glass) == (True, False)
    assert not needs(scene_with(f"{{object: '* box', {glass}}}", more=", integrator: {method: direct}")).absorption


def test_a_material_is_changed_wherever_it_is_worn() -> None:
    scene = scene_with("{material: white, type: plastic, roughness: 0.1}")
    assert {look(scene, name).specular for name in ("floor", "back wall", "small box")} == {1.0}
    assert look(scene, "red wall").specular == 0.0
    assert look(scene, "floor").base_color == (0.886, 0.699, 0.666)


def test_one_of_several_instances_of_a_mesh_can_be_changed_alone() -> None:
    scene = scene_with("{object: column 0, type: mirror, share: 0.5}", source="courtyard")
    assert look(scene, "column 0").mirror == 0.5
    assert look(scene, "column 1").mirror == 0.0
    assert look(scene, "column 0").base_color == look(scene, "column 1").base_color
    assert len({instance.mesh for instance in scene.instances}) == len(scene.meshes), (
        "no mesh is left that nothing shows"
    )


@pytest.mark.parametrize(
    ("entry", "said"),
    [
        (
            "{object: smal box, type: glass}",
            r"materials\[0\].object = 'smal box': no such object; did you mean 'small box'",
        ),
        ("{material: whit, type: glass}", r"materials\[0\].material = 'whit': no such material; did you mean 'white'"),
    ],
)
def test_names_that_fit_nothing_are_refused_with_the_nearest(entry: str, said: str) -> None:
    with pytest.raises(SceneError, match=r"scene\." + said):
        scene_with(entry)


@pytest.mark.parametrize(
    "entry",
    [
        "{type: glass}",
        "{object: a, material: b, type: glass}",
        "{object: a, type: glas}",
        "{object: a, type: glass, ior: 0.5}",
        "{object: a, type: metal, roughness: 2}",
        "{object: a, type: glass, thin: true, attenuation: {color: [0.5, 0.5, 0.5], distance: 1}}",
        "{object: a, type: glass, attenuation: {color: [0.5, 0.5, 0.5]}}",
        "{object: a, type: glass, attenuation: {color: [0.5, 0.5, 1.5], distance: 1}}",
        "{object: a, type: glass, attenuation: {color: [0.5, 0.5, 0.5], distance: 0}}",
        "{object: a, type: emission}",
        "{object: a, type: diffuse, color: [255, 128, 0]}",
    ],
)
def test_wrong_entries_are_refused(entry: str) -> None:
    with pytest.raises(ConfigError, match=r"scene.materials"):
        scene_with(entry)


def test_several_sources_share_a_world(tmp_path: Path) -> None:
    for name in ("left", "right"):
        (tmp_path / f"{name}.obj").write_text(QUAD, encoding="utf-8")
    text = """\
version: 1
scene: {source: [left.obj, right.obj, cornell], materials: [{object: "left*", type: diffuse, color: [1, 0, 0]}]}
wall: {grid: {columns: 1, rows: 1, pixels: [8, 8], size: [0.1, 0.1]}}
views: [{}]
"""
    scene = build(loads(text, path=tmp_path / "wall.yaml").config.scene, tmp_path)
    red = [
        i.name for i in scene.instances if scene.materials[scene.meshes[i.mesh].material].base_color == (1.0, 0.0, 0.0)
    ]
    assert len(scene.instances) == 10
    assert len(red) == 1
    assert red[0].startswith("left")
    assert scene.path_depth == 6, "the Cornell box's own"


def test_paths_are_followed_where_the_source_or_the_configuration_says_so() -> None:
    assert scene_with().path_depth == 6
    assert scene_with(more=", integrator: {method: direct}").path_depth is None
    assert scene_with(more=", integrator: {method: path, depth: 3}").path_depth == 3
    assert scene_with(source="courtyard").path_depth is None


def test_a_texture_of_the_configuration_is_put_on_by_the_mesh_s_coordinates(tmp_path: Path) -> None:
    """Of an OBJ without .mtl, as models of the net come; `color` multiplies it."""
    corners = "v 0 0 0\nv 1 0 0\nv 1 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nf 1/1 2/2 3/3\n"
    (tmp_path / "cow.obj").write_text(corners)
    (tmp_path / "post.obj").write_text(QUAD)
    Image.new("RGB", (2, 2), (10, 20, 30)).save(tmp_path / "spots.png")
    (tmp_path / "broken.png").write_bytes(b"PNG")

    def scene(of: str, name: str, more: str = "") -> Scene:
        given = f"{{object: {of}, type: plastic, texture: {name}{more}}}"
        sources = f"['{tmp_path}/cow.obj', '{tmp_path}/post.obj']"
        return scene_with(given, source=sources, folder=tmp_path)

    cow = look(made := scene("cow.obj", "spots.png"), "cow.obj")
    assert made.textures[cow.textures.base_color].texels[0, 0].tolist() == [10, 20, 30]
    assert (cow.base_color, cow.specular) == ((1.0, 1.0, 1.0), 1.0)
    assert needs(made).textures
    assert not any("names no image" in note for note in made.notes)
    assert look(made, "post.obj").textures.base_color is None
    bare = look(scene("'*.obj'", "spots.png"), "post.obj")  # which has no texture coordinates
    assert bare.base_color == look(made, "post.obj").base_color
    assert look(scene("cow.obj", "spots.png", ", color: [0.5, 1, 1]"), "cow.obj").base_color == (0.5, 1.0, 1.0)
    with pytest.raises(SceneError, match=r"materials\[0\].texture: no mesh that it is for has texture coordinates"):
        scene("post.obj", "spots.png")
    for name, why in (("none.png", "No such file"), ("broken.png", "cannot identify image file")):
        with pytest.raises(SceneError, match=rf"materials\[0\].texture = '{name}': cannot be read \(.*{why}"):
            scene("cow.obj", name)
