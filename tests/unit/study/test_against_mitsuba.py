"""`wall measure reference`: what counts as noise, and, where Mitsuba is installed, that a difference is found."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
from gltf_documents import SQUARE, data_uri, document, loaded
from PIL import Image
from radiance_writer import write_hdr

from wall.core.errors import RunError
from wall.study.mitsuba.compare import BATCHES, FEWEST_PASSES, compare, passing
from wall.study.mitsuba.materials import interface_albedos
from wall.tracing.interface import interface_table

ROOM = """\
version: 1
scene: {{source: cornell, integrator: {integrator}, materials: [{materials}]}}
wall: {{grid: {{columns: 1, rows: 1, pixels: [24, 24], size: [0.24, 0.24]}}}}
views: [{{camera: {{position: [2.78, 2.73, -8], target: [2.78, 2.73, 0], fov: 39.3}}}}]
"""


def test_noise_passes_and_five_percent_do_not() -> None:
    chance = np.random.default_rng(1)
    a, b, c = chance.gamma(4.0, 0.25, (3, BATCHES, 64, 64, 3)) / 40 + 1.0
    assert passing(a, b) == 1.0
    c[:, :4] *= 1.05
    assert passing(a, c) < FEWEST_PASSES
    assert passing(a, a[:, ::-1, ::-1]) > FEWEST_PASSES


@pytest.mark.skipif(find_spec("mitsuba") is None, reason="Mitsuba is not installed")
def test_the_same_room_agrees_and_what_mitsuba_lacks_is_refused(tmp_path: Path) -> None:
    room = tmp_path / "room.yaml"
    glass = "{object: small box, type: glass}, {object: large box, type: mirror}"
    room.write_text(ROOM.format(integrator="{method: path, depth: 4}", materials=glass), encoding="utf-8")
    row = compare(room, spp=4096, out=tmp_path, say=lambda _: None)
    assert row.ok, row
    assert (tmp_path / "room.png").stat().st_size > 1000
    room.write_text(ROOM.format(integrator="{method: direct}", materials=""), encoding="utf-8")
    with pytest.raises(RunError, match="no equal in Mitsuba"):
        compare(room, spp=16, out=tmp_path, say=lambda _: None)


PLASTIC = "{object: small box, type: plastic, color: [0.7, 0.1, 0.08], roughness: %s}"
GOLD = "{object: large box, type: metal, color: [1.0, 0.77, 0.34], roughness: %s}"
FROSTED = "{object: large box, type: glass, color: [0.9, 0.8, 1], roughness: %s}"
PANE = "{object: small box, type: glass, thin: true, roughness: 0.4, color: [0.5, 0.8, 1]}"
BOTH = "{object: lamp, type: emission, radiance: [20, 16, 8]}"


@pytest.mark.skipif(find_spec("mitsuba") is None, reason="Mitsuba is not installed")
@pytest.mark.parametrize(
    ("materials", "own", "same"),
    [
        ((PLASTIC % 0.3, GOLD % 0.6, BOTH), False, True),
        ((PLASTIC % 0, GOLD % 0, BOTH), False, True),
        ((PANE, FROSTED % 0.8), False, True),
        ((GOLD % 0.1,), True, True),
        ((GOLD % 0.9,), True, False),  # Mitsuba's own loses what goes from facet to facet
        ((FROSTED % 0.8,), True, False),
    ],
)
def test_rough_and_coated_surfaces_agree_by_their_formulas(
    tmp_path: Path, materials: tuple[str, ...], own: bool, same: bool
) -> None:
    """Mitsuba's own models too where facets hardly throw light at each other: they differ by design else.

    1 % is three standard errors of both means.
    """
    room = tmp_path / "room.yaml"
    room.write_text(
        ROOM.format(integrator="{method: path, depth: 4}", materials=", ".join(materials)), encoding="utf-8"
    )
    row = compare(room, spp=4096, out=tmp_path, say=lambda _: None, own=own)
    assert bool(np.abs(np.array(row.ratio) - 1.0).max() < 0.01) is same, row
    assert row.passed > FEWEST_PASSES or not same, row


def test_what_interfaces_reflect_is_the_same_by_two_quadratures() -> None:
    """The tracer's table, which every coat and rough metal takes, against one by Gauss and Legendre."""
    ours, theirs = interface_table(), interface_albedos()
    roughness, cosine = (np.linspace(0.0, 1.0, size) for size in theirs.shape[:2])
    for k in np.flatnonzero(roughness > 0.1):
        row = round(float(roughness[k]) * (len(ours) - 1))
        if abs(roughness[k] * (len(ours) - 1) - row) < 0.05:
            found = [np.interp(cosine[4:], np.linspace(0.0, 1.0, ours.shape[1]), ours[row, :, c]) for c in range(2)]
            assert np.abs(np.stack(found, axis=-1) - theirs[k, 4:]).max() < 0.004


TEXTURED = """\
version: 1
scene:
  source: model.gltf
  integrator: {method: path, depth: 3}
  lights: [{type: directional, direction: [1, 2, 3], irradiance: [2, 2, 2]}]
wall: {grid: {columns: 1, rows: 1, pixels: [24, 24], size: [0.24, 0.24]}}
views: [{camera: {position: [0, 0.2, 5], target: [0, 0.2, 0], fov: 32}}]
"""


@pytest.mark.skipif(find_spec("mitsuba") is None, reason="Mitsuba is not installed")
def test_a_textured_model_agrees(tmp_path: Path) -> None:
    """Coloured, bumpy and coated walls, a lamp with a picture, panes with holes, blended and cut out.

    Each texture has another size, odd ones too. Beyond their edges bumps repeat, paint is mirrored, holes end; not the
    lamp's picture, as Mitsuba aims at what lies between 0 and 1 alone. Colours are sRGB.
    """
    chance = np.random.default_rng(2)
    Image.fromarray(chance.integers(0, 256, (6, 5, 3)).astype(np.uint8)).save(tmp_path / "paint.png")
    bumps = chance.integers(70, 186, (4, 4, 3)).astype(np.uint8)
    bumps[..., 2] = 240  # steeper ones turn away from a ray, where Mitsuba shows black and we the flat surface
    Image.fromarray(bumps).save(tmp_path / "bumps.png")
    Image.fromarray(chance.integers(0, 256, (3, 3, 3)).astype(np.uint8)).save(tmp_path / "picture.png")
    Image.fromarray(chance.integers(0, 256, (5, 5, 4)).astype(np.uint8)).save(tmp_path / "holes.png")
    Image.fromarray(chance.integers(60, 256, (4, 3, 3)).astype(np.uint8)).save(tmp_path / "rough.png")
    half = 0.5**0.5

    def matt(**more: int) -> dict[str, object]:
        return {"metallicFactor": 0, "baseColorFactor": [0.8, 0.6, 0.7, 0.9], "baseColorTexture": {"index": 0}, **more}

    plain = {"KHR_materials_specular": {"specularFactor": 0}}
    materials: list[dict[str, object]] = [
        {"pbrMetallicRoughness": matt(), "normalTexture": {"index": 1, "scale": 0.8}, "extensions": plain},
        {
            "pbrMetallicRoughness": {
                **matt(), "metallicFactor": 0.9, "roughnessFactor": 0.8, "metallicRoughnessTexture": {"index": 4}
            },
        },
        {
            "pbrMetallicRoughness": {"metallicFactor": 0, "baseColorFactor": [0, 0, 0, 1]},
            "emissiveTexture": {"index": 2}, "emissiveFactor": [1, 1, 0.5], "extensions": {
                **plain, "KHR_materials_emissive_strength": {"emissiveStrength": 12}
            },
        },
        {
            "pbrMetallicRoughness": {**matt(), "baseColorTexture": {"index": 3}},
            "alphaMode": "BLEND", "doubleSided": True, "extensions": plain,
        },
        {
            "pbrMetallicRoughness": {**matt(), "baseColorTexture": {"index": 3}},
            "alphaMode": "MASK", "alphaCutoff": 0.4, "doubleSided": True, "extensions": plain,
        },
    ]  # fmt: skip
    nodes = [
        {"mesh": 0},
        {"mesh": 1, "translation": [0, -1, 1], "rotation": [-half, 0, 0, half]},
        {"mesh": 2, "translation": [0, 1.6, 1], "rotation": [half, 0, 0, half], "scale": [0.5, 0.4, 1]},
        {"mesh": 3, "translation": [-0.3, 0, 0.8], "scale": [0.6, 0.6, 1]},
        {"mesh": 4, "translation": [0.6, 0.5, 0.9], "scale": [0.5, 0.5, 1]},
    ]
    found = document(
        materials, SQUARE, nodes=nodes,
        images=[{"uri": f"{name}.png"} for name in ("paint", "bumps", "picture", "holes", "rough")],
        samplers=[{"wrapS": way, "wrapT": way} for way in (33648, 10497, *[33071] * 3)],  # mirrored, repeated, clamped
        textures=[{"source": k, "sampler": k} for k in range(5)],
    )  # fmt: skip
    beyond = (2.6 * SQUARE[1] - 0.8).astype(np.float32).tobytes()
    found["buffers"].append({"byteLength": len(beyond), "uri": data_uri(beyond)})
    found["bufferViews"].append({"buffer": 1, "byteLength": len(beyond)})
    found["accessors"].append({"bufferView": 2, "componentType": 5126, "count": len(SQUARE[1]), "type": "VEC2"})
    for mesh in (0, 1, 3, 4):
        found["meshes"][mesh]["primitives"][0]["attributes"]["TEXCOORD_0"] = 2
    loaded(tmp_path, found)
    (tmp_path / "room.yaml").write_text(TEXTURED, encoding="utf-8")
    row = compare(tmp_path / "room.yaml", spp=4096, out=tmp_path, say=lambda _: None)
    assert row.ok, row


ABSORBING = """\
version: 1
scene:
  source: [cube.obj, pane.obj]
  integrator: {method: path, depth: 12}
  materials:
    - {object: "cube*", type: glass, attenuation: {color: [0.2, 0.6, 0.9], distance: 1.5}}
    - {object: "pane*", type: glass, thin: true, ior: 2.0, color: [0.9, 0.4, 0.6]}
  lights: []
  sky: {zenith: [1, 1, 1], horizon: [1, 1, 1], ground: [0.2, 0.2, 0.2]}
wall: {grid: {columns: 1, rows: 1, pixels: [24, 24], size: [0.24, 0.24]}}
views: [{camera: {position: [1.5, 2, 4], target: [0, 0, 0], fov: 32}}]
"""
CUBE = """\
v -1 -1 -1
v 1 -1 -1
v 1 1 -1
v -1 1 -1
v -1 -1 1
v 1 -1 1
v 1 1 1
v -1 1 1
f 4 3 2 1
f 5 6 7 8
f 1 2 6 5
f 3 4 8 7
f 2 3 7 6
f 4 1 5 8
"""


@pytest.mark.skipif(find_spec("mitsuba") is None, reason="Mitsuba is not installed")
def test_glass_that_absorbs_and_a_thin_pane_agree(tmp_path: Path) -> None:
    (tmp_path / "cube.obj").write_text(CUBE, encoding="utf-8")
    (tmp_path / "pane.obj").write_text("v -3 -1 1.5\nv 0 -1 2\nv 0 1 2\nf 1 2 3\n", encoding="utf-8")
    (tmp_path / "absorbing.yaml").write_text(ABSORBING, encoding="utf-8")
    row = compare(tmp_path / "absorbing.yaml", spp=1024, out=tmp_path, say=lambda _: None)
    assert row.ok, row


OPEN = """\
version: 1
scene:
  source: cornell
  integrator: {{method: path, depth: 2}}
  materials: [{{object: lamp, type: emission, radiance: [0, 0, 0]}}]
  environment: {{file: sky.hdr, rotation: 40}}
  lights: [{lights}]
wall: {{grid: {{columns: 1, rows: 1, pixels: [24, 24], size: [0.24, 0.24]}}}}
views: [{{camera: {{position: [2.78, 2.73, -12], target: [2.78, 2.73, 0], fov: 39.3}}}}]
"""


@pytest.mark.skipif(find_spec("mitsuba") is None, reason="Mitsuba is not installed")
def test_environments_and_lights_of_every_kind_agree(tmp_path: Path) -> None:
    """An image without symmetry: turned, mirrored or shifted by a texel it would light the room otherwise."""
    texels = np.random.default_rng(4).uniform(0.0, 0.5, (16, 32, 3)).astype(np.float32)
    texels[5, 3], texels[6, 12] = (40.0, 20.0, 5.0), (3.0, 9.0, 30.0)
    write_hdr(tmp_path / "sky.hdr", texels)
    room = tmp_path / "open.yaml"
    disc = "{type: disc, center: [2, 4, 3], normal: [0, -1, -1], radius: 0.4, radiance: [9, 3, 6]}"
    spot = "{type: spot, position: [2, 5, 0], direction: [0.2, -1, 0.4], intensity: [20, 30, 9], outer_angle: 30}"
    sun = "{type: directional, direction: [1, 2, -2], irradiance: [2, 1, 1], angular_diameter: 8}"
    room.write_text(OPEN.format(lights=", ".join((disc, spot, sun))), encoding="utf-8")
    row = compare(room, spp=4096, out=tmp_path, say=lambda _: None)
    assert row.ok, row
