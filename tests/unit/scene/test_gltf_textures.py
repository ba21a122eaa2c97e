"""glTF's textures, how they are looked up, alpha, and unlit materials."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from gltf_documents import TRIANGLE, data_uri, document, loaded
from numpy.typing import NDArray
from PIL import Image

from wall.core.data import Float32
from wall.scene.model import NO_TEXTURES, Source, TextureSet

IMAGES: dict[str, Any] = {
    "images": [{"uri": "red.png"}, {"uri": "rust.png"}],
    "samplers": [{"wrapS": 33071, "wrapT": 33648}],
    "textures": [{"source": 0, "sampler": 0}, {"source": 1}],
}


def with_images(folder: Path, materials: list[dict[str, Any]], **more: Any) -> Source:
    """The document with these materials, and with IMAGES."""
    write_images(folder)
    return loaded(folder, document(materials, **IMAGES, **more))


def write_images(folder: Path) -> None:
    """Texture 0 is red with a half-transparent right side and looked up by the sampler; texture 1 is 0, 128, 64."""
    red = np.zeros((4, 4, 4), np.uint8)
    red[..., 0], red[..., 3] = 200, (255, 255, 128, 128)
    Image.fromarray(red).save(folder / "red.png")
    Image.fromarray(np.full((2, 2, 3), [0, 128, 64], np.uint8)).save(folder / "rust.png")


def test_a_material_has_all_its_textures(tmp_path: Path) -> None:
    source = with_images(
        tmp_path,
        [
            {
                "name": "door",
                "pbrMetallicRoughness": {
                    "baseColorTexture": {"index": 0},
                    "metallicRoughnessTexture": {"index": 1},
                    "metallicFactor": 0.5,
                },
                "normalTexture": {"index": 1, "scale": 0.25},
                "emissiveTexture": {"index": 0},
                "emissiveFactor": [1, 1, 1],
            }
        ],
    )
    door = source.materials[0]
    base, rough, emission, normal = (source.textures[k] for k in door.textures if k is not None)
    assert (base.wrap, rough.wrap) == (("clamp", "mirror"), ("repeat", "repeat"))
    assert base is emission
    assert rough is normal
    assert (base.linear, rough.linear) == (False, True)
    assert base.alpha is None  # the material is opaque
    np.testing.assert_array_equal(base.texels[0, 0], [200, 0, 0])
    np.testing.assert_array_equal(rough.texels[0, 0], [0, 128, 64])
    assert (door.metallic, door.normal_scale) == (0.5, 0.25)
    assert source.notes == ()


@pytest.mark.parametrize(("mode", "cutoff"), [("MASK", 0.25), ("BLEND", 0.5)])
def test_alpha_is_kept_where_the_material_uses_it(tmp_path: Path, mode: str, cutoff: float) -> None:
    leaf = {
        "alphaMode": mode, "alphaCutoff": cutoff,
        "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}, "baseColorFactor": [1, 1, 1, 0.75]},
    }  # fmt: skip
    source = with_images(tmp_path, [leaf])
    found = source.materials[0]
    assert (found.alpha_mode, found.alpha, found.alpha_cutoff) == (mode.lower(), 0.75, cutoff)
    alpha = source.textures[0].alpha
    assert alpha is not None
    np.testing.assert_array_equal(alpha[0], [255, 255, 128, 128])


def test_texture_transforms_change_texture_coordinates(tmp_path: Path) -> None:
    """A quarter turn counterclockwise as one sees the image: (1, 0) goes to (0, -1), and (0, 1) to (1, 0), v down."""
    turned = {
        "index": 0,
        "extensions": {"KHR_texture_transform": {"offset": [0.5, 0.25], "rotation": math.pi / 2, "scale": [2, 3]}},
    }
    source = with_images(tmp_path, [{"pbrMetallicRoughness": {"baseColorTexture": turned}}])
    uvs = source.meshes[0].uvs
    assert uvs is not None
    down = np.array([[0.5, 0.25], [0.5, 0.25 - 2.0], [0.5 + 3.0, 0.25]])
    np.testing.assert_allclose(uvs, np.stack([down[:, 0], 1.0 - down[:, 1]], 1), atol=1e-6)


def with_second_uvs(found: dict[str, Any], uvs: NDArray[Any], kind: int, **more: Any) -> dict[str, Any]:
    """A document whose meshes have a second set of texture coordinates, v down; kind: glTF's number of its dtype."""
    found["buffers"].append({"byteLength": uvs.nbytes, "uri": data_uri(uvs.tobytes())})
    found["bufferViews"].append({"buffer": 1, "byteLength": uvs.nbytes})
    found["accessors"].append({"bufferView": 2, "componentType": kind, "count": len(uvs), "type": "VEC2", **more})
    for mesh in found["meshes"]:
        mesh["primitives"][0]["attributes"]["TEXCOORD_1"] = 2
    return found


@pytest.mark.parametrize("binary", [False, True])
def test_each_texture_has_its_own_set_and_transform(tmp_path: Path, binary: bool) -> None:
    """The extension's texCoord wins. Equal ways to look textures up are one set; u and v of each set, v up."""
    write_images(tmp_path)
    moved = {"KHR_texture_transform": {"offset": [0.5, 0.25], "texCoord": 1}}
    second = np.array([[0, 65535], [32768, 0], [65535, 16384]], np.uint16)
    sign = {
        "pbrMetallicRoughness": {
            "baseColorTexture": {"index": 0}, "metallicFactor": 0,
            "metallicRoughnessTexture": {"index": 1, "texCoord": 1},
        },
        "emissiveTexture": {"index": 0, "extensions": moved}, "emissiveFactor": [1, 1, 1],
        "normalTexture": {"index": 1, "texCoord": 1},
    }  # fmt: skip
    found = with_second_uvs(document([sign], **IMAGES), second, 5123, normalized=True)
    source = loaded(tmp_path, found, binary=binary)
    textures = source.materials[0].textures
    assert [None if k is None else source.textures[k].uv_set for k in textures] == [0, 1, 2, 1]
    assert textures.metallic_roughness == textures.normal
    down = second / 65535.0
    parts = [TRIANGLE[1], down, down + np.array([0.5, 0.25])]
    wanted = np.concatenate([np.stack([uv[:, 0], 1.0 - uv[:, 1]], 1) for uv in parts], axis=1)
    np.testing.assert_allclose(uvs_of(source), wanted, atol=1e-6)
    assert source.notes == ()


def uvs_of(source: Source) -> Float32:
    uvs = source.meshes[0].uvs
    assert uvs is not None
    return uvs


def test_a_set_that_a_mesh_lacks_is_noted(tmp_path: Path) -> None:
    sign = {"pbrMetallicRoughness": {"baseColorTexture": {"index": 0, "texCoord": 3}, "metallicFactor": 0}}
    source = with_images(tmp_path, [sign])
    assert source.notes == ("mesh 'GLTF' has no texture coordinates of set 3; those of another set are used",)
    plain = with_images(tmp_path, [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}])
    np.testing.assert_array_equal(uvs_of(source), uvs_of(plain))


def test_a_set_of_single_numbers_is_none(tmp_path: Path) -> None:
    write_images(tmp_path)
    sign = {"pbrMetallicRoughness": {"baseColorTexture": {"index": 0, "texCoord": 1}, "metallicFactor": 0}}
    found = with_second_uvs(document([sign], **IMAGES), np.zeros(3, np.float32), 5126)
    found["accessors"][2]["type"] = "SCALAR"
    source = loaded(tmp_path, found)
    assert source.notes == ("mesh 'GLTF' has no texture coordinates of set 1; those of another set are used",)


@pytest.mark.parametrize("lookup", [{"texCoord": "one"}, {"extensions": {"KHR_texture_transform": {"rotation": "x"}}}])
def test_a_lookup_that_cannot_be_read_is_noted(tmp_path: Path, lookup: dict[str, Any]) -> None:
    sign = {"name": "sign", "pbrMetallicRoughness": {"baseColorTexture": {"index": 0, **lookup}, "metallicFactor": 0}}
    source = with_images(tmp_path, [sign])
    assert any("'sign': its numbers cannot be read" in note for note in source.notes)


def test_an_unlit_material_shows_its_colour_and_reflects_nothing(tmp_path: Path) -> None:
    surface = {"baseColorTexture": {"index": 0}, "baseColorFactor": [0.5, 0.25, 1.0, 1.0]}
    source = with_images(
        tmp_path,
        [{"pbrMetallicRoughness": surface, "extensions": {"KHR_materials_unlit": {}}}],
        extensionsUsed=["KHR_materials_unlit"],
    )
    found = source.materials[0]
    assert found.emission == (0.5, 0.25, 1.0)
    assert (found.base_color, found.metallic, found.specular) == ((0.0, 0.0, 0.0), 0.0, 0.0)
    assert found.textures == TextureSet(0, None, 0, None)
    assert source.notes == ()


@pytest.mark.parametrize("sampler", [{"wrapS": 7}, {"wrapT": "clamp"}, []])
def test_a_sampler_that_cannot_be_read_is_noted(tmp_path: Path, sampler: Any) -> None:
    Image.new("RGB", (2, 2), (9, 9, 9)).save(tmp_path / "grey.png")
    materials = [{"name": "grey", "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}, "metallicFactor": 0}}]
    found = document(
        materials, images=[{"uri": "grey.png"}], samplers=[sampler], textures=[{"source": 0, "sampler": 0}]
    )
    source = loaded(tmp_path, found)
    assert len(source.notes) == 1
    assert "material 'grey': its numbers cannot be read" in source.notes[0]
    assert source.materials[0].textures == NO_TEXTURES._replace(base_color=0)


def test_what_is_not_drawn_of_materials_is_in_one_note(tmp_path: Path) -> None:
    specular = {"specularColorFactor": [1, 0.5, 1], "specularColorTexture": {"index": 0}}
    wall = {"name": "wall", "occlusionTexture": {"index": 1}, "doubleSided": False}
    source = with_images(
        tmp_path,
        [
            {**wall, "extensions": {"KHR_materials_specular": specular}},
            {"name": "floor", "occlusionTexture": {"index": 1}, "doubleSided": True},
            {"name": "plain", "extensions": {"KHR_materials_specular": {"specularColorFactor": [1, 1, 1]}}},
        ],
    )
    assert source.notes == (
        "of its materials is not drawn: occlusion texture (wall, floor); specular colour (wall); "
        "specular texture (wall); culling of back faces (wall)",
    )


@pytest.mark.parametrize(
    ("mode", "alpha", "noted"),
    [("BLEND", 0.5, True), ("MASK", 0.5, True), ("BLEND", 1.0, False), ("OPAQUE", 0.5, False)],
)
def test_alpha_of_vertex_colours_is_noted_where_the_material_uses_it(
    tmp_path: Path, mode: str, alpha: float, noted: bool
) -> None:
    found = document([{"name": "fog", "alphaMode": mode}])
    colors = np.array([[1, 0, 0, 1], [1, 0, 0, alpha], [1, 0, 0, 1]], np.float32)
    found["buffers"].append({"byteLength": colors.nbytes, "uri": data_uri(colors.tobytes())})
    found["bufferViews"].append({"buffer": 1, "byteLength": colors.nbytes})
    found["accessors"].append({"bufferView": 2, "componentType": 5126, "count": 3, "type": "VEC4"})
    found["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"] = 2
    notes = loaded(tmp_path, found).notes
    assert notes == (("of its materials is not drawn: alpha of vertex colours (fog)",) if noted else ())
