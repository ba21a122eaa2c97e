"""glTF's materials and lights: what trimesh leaves out."""

from __future__ import annotations

import base64
import json
import math
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from wall.core.errors import SceneError
from wall.scene.loading import load
from wall.scene.model import DirectionalLight, Material, PointLight, Source, SpotLight

CORNERS = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], np.float32).tobytes()


def data_uri(data: bytes, kind: str = "application/octet-stream") -> str:
    return f"data:{kind};base64," + base64.b64encode(data).decode()


def document(materials: list[dict[str, Any]], **more: Any) -> dict[str, Any]:
    """A triangle for each material, side by side."""
    return {
        "asset": {"version": "2.0"},
        "buffers": [{"byteLength": len(CORNERS), "uri": data_uri(CORNERS)}],
        "bufferViews": [{"buffer": 0, "byteLength": len(CORNERS)}],
        "accessors": [
            {
                "bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 0],
            }
        ],
        "materials": materials,
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "material": k}]} for k in range(len(materials))],
        "nodes": [{"mesh": k, "translation": [2.0 * k, 0, 0]} for k in range(len(materials))],
        "scenes": [{"nodes": list(range(len(materials)))}],
        "scene": 0,
        **more,
    }  # fmt: skip


def loaded(folder: Path, found: dict[str, Any], *, binary: bool = False) -> Source:
    text = json.dumps(found).encode()
    if not binary:
        (folder / "model.gltf").write_bytes(text)
        return load(folder / "model.gltf")
    text += b" " * (-len(text) % 4)
    head = struct.pack("<4sII", b"glTF", 2, 20 + len(text)) + struct.pack("<II", len(text), 0x4E4F534A)
    (folder / "model.glb").write_bytes(head + text)
    return load(folder / "model.glb")


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
    assert (window.transmission, window.ior, window.specular) == (0.9, 1.33, 0.5)


def test_materials_of_one_name_are_told_apart(tmp_path: Path) -> None:
    twins = [{"name": "twin", "pbrMetallicRoughness": {"roughnessFactor": r}} for r in (0.1, 0.9)]
    source = loaded(tmp_path, document(twins))
    by_place = {i.world_from_object[0, 3]: source.materials[source.meshes[i.mesh].material] for i in source.instances}
    assert {place: m.roughness for place, m in by_place.items()} == {0.0: 0.1, 2.0: 0.9}
    assert {m.name for m in by_place.values()} == {"twin"}


def test_textures_of_roughness_and_emission_are_taken_as_their_means(tmp_path: Path) -> None:
    Image.fromarray(np.full((4, 4, 3), [0, 128, 64], np.uint8)).save(tmp_path / "rust.png")
    source = loaded(
        tmp_path,
        document(
            [
                {
                    "name": "door",
                    "pbrMetallicRoughness": {"metallicRoughnessTexture": {"index": 0}, "roughnessFactor": 0.5},
                }
            ],
            images=[{"uri": "rust.png"}],
            textures=[{"source": 0}],
        ),
    )
    door = material(source, "door")
    assert door.roughness == pytest.approx(0.5 * 128 / 255)
    assert door.metallic == pytest.approx(64 / 255)
    assert any("1 material shows a texture's mean (metal, emission) (door)" in note for note in source.notes)


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


def test_what_is_not_read_is_noted(tmp_path: Path) -> None:
    found = document([{"name": "plain"}], cameras=[{"type": "perspective"}], animations=[{}], skins=[{}])
    found["extensionsUsed"] = ["KHR_materials_ior", "EXT_unheard_of"]
    notes = " ".join(loaded(tmp_path, found).notes)
    for said in ("skins are not read", "animations are not read", "cameras are not read", "not read: EXT_unheard_of"):
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
