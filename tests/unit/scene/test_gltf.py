"""glTF's materials and lights: what trimesh leaves out."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from gltf_documents import document, loaded

from wall.config.loading import load as load_configuration
from wall.config.scene import SceneConfig
from wall.core.errors import ConfigError, SceneError
from wall.roles.plan import Plan, make_layout, make_plan
from wall.scene.build import build
from wall.scene.loading import load
from wall.scene.model import DirectionalLight, Material, PointLight, Source, SpotLight


def material(source: Source, name: str) -> Material:
    return next(material for material in source.materials if material.name == name)


@pytest.mark.parametrize("binary", [False, True])
def test_scalars_of_materials_and_their_extensions_are_read(tmp_path: Path, binary: bool) -> None:
    source = loaded(
        tmp_path,
        document(
            [
                {"name": "plain"},
                {"name": "same", "pbrMetallicRoughness": {"metallicFactor": 0.0, "roughnessFactor": 0.25}},
                {"name": "same2", "pbrMetallicRoughness": {"metallicFactor": 0.5}, "doubleSided": True},
                {
                    "name": "lamp", "emissiveFactor": [1.0, 0.5, 0.25],
                    "extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": 8.0}},
                },
                {
                    "name": "window", "pbrMetallicRoughness": {"metallicFactor": 0.0},
                    "extensions": {
                        "KHR_materials_transmission": {"transmissionFactor": 0.9},
                        "KHR_materials_ior": {"ior": 1.33},
                        "KHR_materials_specular": {"specularFactor": 0.5},
                    },
                },
            ]
        ),
        binary=binary,
    )  # fmt: skip
    plain, same, other = material(source, "plain"), material(source, "same"), material(source, "same2")
    assert (plain.metallic, plain.roughness, plain.specular, plain.ior) == (1.0, 1.0, 1.0, 1.5), "glTF's defaults"
    assert (same.metallic, same.roughness, same.emits_behind) == (0.0, 0.25, False)
    assert (other.metallic, other.roughness, other.emits_behind) == (0.5, 1.0, True)
    assert material(source, "lamp").emission == (8.0, 4.0, 2.0)
    window = material(source, "window")
    assert (window.transmission, window.ior, window.specular, window.thin) == (0.9, 1.33, 0.5, True)
    assert not plain.thin


@pytest.mark.parametrize(
    ("volume", "absorption"),
    [
        ({"attenuationColor": [1.0, 0.5, 0.25], "attenuationDistance": 0.5}, (0.0, 2.0, 4.0)),
        ({"attenuationColor": [1.0, 0.5, 0.25]}, (0.0, 0.0, 0.0)),
        ({"attenuationColor": [1.0, 0.5, 0.25], "attenuationDistance": 0.0}, (0.0, 0.0, 0.0)),
        ({"attenuationDistance": 3.0}, (0.0, 0.0, 0.0)),
    ],
)
def test_volumes_absorb(tmp_path: Path, volume: dict[str, Any], absorption: tuple[float, ...]) -> None:
    found = {
        "pbrMetallicRoughness": {"metallicFactor": 0.0},
        "extensions": {
            "KHR_materials_transmission": {"transmissionFactor": 1.0},
            "KHR_materials_volume": {"thicknessFactor": 1.0, **volume},
        },
    }
    source = loaded(tmp_path, document([found], extensionsUsed=["KHR_materials_volume"]))
    np.testing.assert_allclose(source.materials[0].absorption, np.multiply(absorption, math.log(2.0)), atol=1e-12)
    assert not source.materials[0].thin
    assert source.notes == ()
    found["extensions"]["KHR_materials_volume"]["thicknessFactor"] = 0.0
    found["extensions"]["KHR_materials_transmission"]["transmissionTexture"] = {"index": 0}
    source = loaded(tmp_path, document([{"name": "pane", **found}]))
    assert source.materials[0].thin
    assert source.materials[0].absorption == (0.0, 0.0, 0.0)
    assert source.notes == ("material 'pane': its transmission texture is not read; its factor holds everywhere",)


@pytest.mark.parametrize("scale", [1e-6, 1e9])
def test_a_model_of_extreme_size_absorbs_as_before(tmp_path: Path, scale: float) -> None:
    """Its attenuation distance, in world units, is scaled with it."""
    found = document(
        [
            {
                "extensions": {"KHR_materials_volume": {"attenuationDistance": 3.0 * scale}},
            }
        ]
    )
    found["nodes"][0]["scale"] = [scale] * 3
    source = loaded(tmp_path, found)
    smaller = source.instances[0].world_from_object[0, 0] / scale
    assert source.materials[0].attenuation_distance == pytest.approx(3.0 * scale * smaller)
    assert any("everything is scaled" in note for note in source.notes)


def test_materials_of_one_name_are_told_apart(tmp_path: Path) -> None:
    twins = [{"name": "twin", "pbrMetallicRoughness": {"roughnessFactor": r}} for r in (0.1, 0.9)]
    source = loaded(tmp_path, document(twins))
    by_place = {i.world_from_object[0, 3]: source.materials[source.meshes[i.mesh].material] for i in source.instances}
    assert {place: m.roughness for place, m in by_place.items()} == {0.0: 0.1, 2.0: 0.9}
    assert {m.name for m in by_place.values()} == {"twin"}


def test_lights_stand_where_their_nodes_do(tmp_path: Path) -> None:
    half = 0.5**0.5
    lights = [
        {"type": "point", "color": [1.0, 0.5, 0.25], "intensity": 40.0},
        {"type": "directional", "intensity": 3.0},
        {"type": "spot", "name": "torch", "intensity": 7.0, "spot": {}},
    ]

    def light(number: int, **pose: Any) -> dict[str, Any]:
        return {"extensions": {"KHR_lights_punctual": {"light": number}}, **pose}

    found = document([{"name": "plain"}])
    found["extensionsUsed"] = ["KHR_lights_punctual"]
    found["extensions"] = {"KHR_lights_punctual": {"lights": lights}}
    found["nodes"] += [
        {"translation": [0, 10, 0], "scale": [2, 2, 2], "children": [2]},
        light(0, translation=[1, 2, 3]),
        light(1, rotation=[-half, 0, 0, half]),  # -z becomes -y: straight down
        light(2, matrix=[1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 5, 6, 7, 1]),
    ]
    found["scenes"][0]["nodes"] = [0, 1, 3, 4]
    source = loaded(tmp_path, found)
    assert source.lights is not None
    points = [light for light in source.lights if isinstance(light, PointLight)]
    (sun,) = (light for light in source.lights if isinstance(light, DirectionalLight))
    assert {point.position: point.intensity for point in points} == {
        (2.0, 14.0, 6.0): (40.0, 20.0, 10.0),
    }
    np.testing.assert_allclose(sun.direction, (0.0, 1.0, 0.0), atol=1e-12)
    assert sun.irradiance == (3.0, 3.0, 3.0)
    (torch,) = (light for light in source.lights if isinstance(light, SpotLight))
    assert (torch.position, torch.direction, torch.intensity) == ((5.0, 6.0, 7.0), (0.0, 0.0, -1.0), (7.0, 7.0, 7.0))
    assert (torch.inner_angle, torch.outer_angle) == (0.0, 45.0)  # glTF's defaults
    assert not any("'torch'" in note for note in source.notes)


@pytest.mark.parametrize("scale", [7e-7, 4e9])
def test_a_model_of_extreme_size_keeps_its_lights_about_it(tmp_path: Path, scale: float) -> None:
    """Irradiance is intensity over distance squared: what stands k times as far away shines k^2 as brightly."""
    kinds = [{"type": "point", "intensity": 40.0}, {"type": "spot", "intensity": 9.0}, {"type": "directional"}]
    found = document([{"name": "plain"}])
    found["extensions"] = {"KHR_lights_punctual": {"lights": kinds}}
    found["nodes"][0]["scale"] = [scale] * 3
    for k in range(3):
        lamp = {"extensions": {"KHR_lights_punctual": {"light": k}}, "translation": [0, 0, (k + 2) * scale]}
        found["nodes"].append(lamp)
        found["scenes"][0]["nodes"].append(k + 1)
    source = loaded(tmp_path, found)
    assert any("everything is scaled" in note for note in source.notes)
    larger = source.instances[0].world_from_object[0, 0] / scale
    assert source.lights is not None
    by_kind = {type(light): light for light in source.lights}
    point, spot, sun = by_kind[PointLight], by_kind[SpotLight], by_kind[DirectionalLight]
    assert isinstance(point, PointLight)
    assert isinstance(spot, SpotLight)
    np.testing.assert_allclose(point.position, (0.0, 0.0, 2.0 * scale * larger))
    np.testing.assert_allclose(spot.position, (0.0, 0.0, 3.0 * scale * larger))
    np.testing.assert_allclose(point.intensity, 40.0 * larger**2)
    np.testing.assert_allclose(spot.intensity, 9.0 * larger**2)
    assert sun == DirectionalLight(direction=(0.0, 0.0, 1.0), irradiance=(1.0, 1.0, 1.0))


@pytest.mark.parametrize(
    ("written", "angles", "noted"),
    [
        ({"innerConeAngle": 0.5, "outerConeAngle": 1.0}, (28.6479, 57.2958), False),
        ({"innerConeAngle": 0.9, "outerConeAngle": 0.5}, (28.5979, 28.6479), True),
        ({"innerConeAngle": -1.0, "outerConeAngle": 3.0}, (0.0, 90.0), True),
        ({"outerConeAngle": 0.0}, (0.0, 0.1), True),
    ],
)
def test_cones_of_spots_are_read_and_wrong_ones_mended(
    tmp_path: Path, written: dict[str, float], angles: tuple[float, float], noted: bool
) -> None:
    found = document([{"name": "plain"}])
    found["extensions"] = {"KHR_lights_punctual": {"lights": [{"type": "spot", "name": "torch", "spot": written}]}}
    found["nodes"][0]["extensions"] = {"KHR_lights_punctual": {"light": 0}}
    source = loaded(tmp_path, found)
    assert source.lights is not None
    (torch,) = source.lights
    assert isinstance(torch, SpotLight)
    np.testing.assert_allclose((torch.inner_angle, torch.outer_angle), angles, atol=1e-4)
    assert any("'torch' has a cone from" in note for note in source.notes) == noted


def test_without_lights_the_file_does_not_say(tmp_path: Path) -> None:
    assert loaded(tmp_path, document([{"name": "plain"}])).lights is None


def test_sparse_accessors_of_meshes_are_refused(tmp_path: Path) -> None:
    sparse = document([{}])
    sparse["accessors"][0]["sparse"] = {"count": 1, "indices": {"bufferView": 0}, "values": {"bufferView": 0}}
    with pytest.raises(SceneError, match=r"its accessors \[0\] are sparse, wanted a file with all of their values"):
        loaded(tmp_path, sparse)
    unused = document([{}])
    unused["accessors"].append(sparse["accessors"][0])
    assert loaded(tmp_path, unused).instances


def test_what_is_not_read_is_noted(tmp_path: Path) -> None:
    found = document([{"name": "plain"}], skins=[{}])
    found["extensionsUsed"] = ["KHR_materials_ior", "EXT_unheard_of", "EXT_meshopt_compression"]
    found["extensionsRequired"] = ["EXT_meshopt_compression"]
    notes = " ".join(loaded(tmp_path, found).notes)
    for said in ("skins are not read", "not read: EXT_unheard_of", "requires and that are not read, so that"):
        assert said in notes


@pytest.mark.parametrize(
    "surface",
    [
        {"metallicFactor": "much"},
        {"roughnessFactor": None},
        {"roughnessFactor": [1.0]},
        {"roughnessFactor": math.nan},
        [],
        "shiny",
    ],
)
def test_a_material_of_wrong_numbers_is_refused_or_noted(tmp_path: Path, surface: Any) -> None:
    refused, notes = "", tuple[str, ...]()
    try:
        notes = loaded(tmp_path, document([{"name": "odd", "pbrMetallicRoughness": surface}])).notes
    except SceneError as error:
        refused = str(error)
    assert "model.gltf" in refused or any("'odd': its numbers cannot be read" in note for note in notes)


@pytest.mark.parametrize(
    "lights",
    [
        [],
        [{}],
        [{"type": "point", "color": "red"}],
        [{"type": "point", "intensity": [2]}],
        [{"type": "point", "intensity": math.inf}],
        7,
        ["sun"],
    ],
)
def test_wrong_lights_are_refused(tmp_path: Path, lights: Any) -> None:
    found = document([{"name": "plain"}])
    found["extensions"] = {"KHR_lights_punctual": {"lights": lights}}
    found["nodes"][0]["extensions"] = {"KHR_lights_punctual": {"light": 0}}
    with pytest.raises(SceneError, match=r"model.gltf: cannot be read as glTF"):
        loaded(tmp_path, found)


@pytest.mark.parametrize(
    ("material", "noted"),
    [
        ({"extensions": {"KHR_materials_transmission": {"transmissionFactor": 1.0}}}, True),
        ({"emissiveFactor": [1, 1, 1]}, True),
        ({"emissiveFactor": [1, 1, 1], "extensions": {"KHR_materials_unlit": {}}}, False),
        ({}, False),
    ],
)
def test_what_direct_light_shows_as_other_is_noted(tmp_path: Path, material: dict[str, Any], noted: bool) -> None:
    found = {"name": "lamp", "pbrMetallicRoughness": {"metallicFactor": 0}, **material}
    loaded(tmp_path, document([found]))
    notes = build(SceneConfig(source="model.gltf"), tmp_path).notes
    assert any("1 material is metal, glass or shining (lamp)" in note for note in notes) == noted


def test_old_glossy_materials_are_no_metal(tmp_path: Path) -> None:
    gloss = {"KHR_materials_pbrSpecularGlossiness": {"glossinessFactor": 0.75, "diffuseFactor": [0.5, 0.5, 0.5, 1.0]}}
    found = document([{"name": "paint", "extensions": gloss}])
    paint = material(loaded(tmp_path, found), "paint")
    assert (paint.metallic, paint.roughness) == (0.0, 0.25)


def test_a_sun_whose_node_is_scaled_to_nothing_is_noted(tmp_path: Path) -> None:
    found = document([{"name": "plain"}])
    found["extensions"] = {"KHR_lights_punctual": {"lights": [{"type": "directional", "name": "off"}]}}
    found["nodes"].append({"scale": [0, 0, 0], "extensions": {"KHR_lights_punctual": {"light": 0}}})
    found["scenes"][0]["nodes"].append(1)
    source = loaded(tmp_path, found)
    assert source.lights is None
    assert any("'off' has no direction" in note for note in source.notes)


def test_a_material_called_by_an_odd_digit_is_a_name(tmp_path: Path) -> None:
    (tmp_path / "m.mtl").write_text("newmtl \u00b2\nKd 1 0 0\n", encoding="utf-8")
    (tmp_path / "m.obj").write_text(
        "mtllib m.mtl\nusemtl \u00b2\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", encoding="utf-8"
    )
    assert [m.name for m in load(tmp_path / "m.obj").materials] == ["\u00b2"]


def with_cameras(folder: Path) -> Path:
    """A camera at (0, 0, 4) that looks along -x, on a scaled node, and one that cannot be read."""
    half = 0.5**0.5
    found = document([{"name": "plain"}])
    found["cameras"] = [
        {"type": "perspective", "perspective": {"yfov": math.radians(40), "znear": 0.1}},
        {"type": "orthographic", "name": "plan", "orthographic": {"xmag": 1, "ymag": 1, "zfar": 9, "znear": 0.1}},
    ]
    found["nodes"] += [
        {"name": "side", "camera": 0, "translation": [0, 0, 4], "rotation": [0, half, 0, half], "scale": [2, 3, 4]},
        {"camera": 1},
    ]
    found["scenes"][0]["nodes"] = [0, 1, 2]
    loaded(folder, found)
    return folder / "model.gltf"


def test_cameras_are_named_by_their_nodes(tmp_path: Path) -> None:
    source = load(with_cameras(tmp_path))
    (side,) = source.cameras
    assert (side.name, side.fov) == ("side", pytest.approx(40.0))
    np.testing.assert_allclose(side.world_from_camera[:3, 3], [0, 0, 4])
    np.testing.assert_allclose(-side.world_from_camera[:3, 2], [-1, 0, 0], atol=1e-12)
    np.testing.assert_allclose(side.world_from_camera[:3, :3] @ side.world_from_camera[:3, :3].T, np.eye(3), atol=1e-12)
    assert any("camera 'plan' is not read: it is orthographic" in note for note in source.notes)


def viewed(folder: Path, camera: str) -> Plan:
    with_cameras(folder)
    text = f"""\
version: 1
scene: {{source: model.gltf}}
wall: {{grid: {{columns: 1, rows: 1, pixels: [40, 30], size: [0.4, 0.3]}}}}
views: [{{camera: {camera}}}]
"""
    (folder / "view.yaml").write_text(text, encoding="utf-8")
    return make_plan(make_layout(load_configuration(folder / "view.yaml")))


@pytest.mark.parametrize(("camera", "fov"), [("{name: side}", 40.0), ("{name: side, fov: 25}", 25.0)])
def test_a_view_through_a_camera_of_the_file(tmp_path: Path, camera: str, fov: float) -> None:
    plan = viewed(tmp_path, camera)
    seen = plan.view.camera_at(0.0)
    np.testing.assert_allclose(seen.origin(), [0, 0, 4])
    np.testing.assert_allclose(seen.rotation() @ [0, 0, -1], [-1, 0, 0], atol=1e-12)
    assert math.degrees(2 * math.atan(0.15 / plan.view.eye[2])) == pytest.approx(fov)


def test_a_camera_that_the_file_does_not_have_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"views\[0\].camera.name = 'sied': there is no such camera; accepted: side"):
        viewed(tmp_path, "{name: sied}")
    with pytest.raises(ConfigError, match="one of name, position"):
        viewed(tmp_path, "{name: side, position: [0, 0, 1], target: [0, 0, 0]}")


@pytest.mark.parametrize("name", ["truck", None])
def test_all_meshes_of_a_node_are_one_object(tmp_path: Path, name: str | None) -> None:
    """Else whoever moves it would tear its windows off."""
    found = document([{"name": "paint"}, {"name": "glass"}, {"name": "tyre"}])
    body, window, wheel = (mesh["primitives"][0] for mesh in found["meshes"])
    found["meshes"] = [{"name": "body", "primitives": [body, window]}, {"name": "wheel", "primitives": [wheel]}]
    found["nodes"] = [{"mesh": 0, "children": [1]} | ({"name": name} if name else {}), {"mesh": 1, "name": "wheel 0"}]
    found["scenes"] = [{"nodes": [0]}]
    source = loaded(tmp_path, found)
    names = [instance.name for instance in source.instances]
    assert sorted(names) == sorted([name or "body", name or "body", "wheel 0"])
    assert len({instance.mesh for instance in source.instances}) == 3
    assert [instance.parents for instance in source.instances if instance.name == "wheel 0"] == [(name or "body",)]
