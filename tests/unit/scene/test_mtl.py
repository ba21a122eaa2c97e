"""What an MTL file says of surfaces besides their colour."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from wall.scene.loading import load
from wall.scene.model import NO_TEXTURES, Material, Source, Texture

TRIANGLE = "mtllib m.mtl\nusemtl it\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nf 1/1 2/2 3/3\n"
PLAIN = Material(name="it", base_color=(0.5, 0.5, 0.5))


def source_of(folder: Path, lines: str) -> Source:
    (folder / "m.mtl").write_text(f"newmtl it\nKd 0.5 0.5 0.5\n{lines}\n", encoding="utf-8")
    (folder / "m.obj").write_text(TRIANGLE, encoding="utf-8")
    return load(folder / "m.obj", up="y")


def material_of(folder: Path, lines: str) -> Material:
    (material,) = source_of(folder, lines).materials
    return material


@pytest.mark.parametrize(
    ("lines", "fields"),
    [
        ("", {}),
        ("Ke 4 2 1", {"emission": (4.0, 2.0, 1.0)}),
        ("Ke 0 0 0", {}),
        ("Ni 1.33", {"ior": 1.33}),
        ("Pm 1\nPr 0.2", {"metallic": 1.0, "roughness": 0.2, "specular": 1.0}),
        ("Pr 0.7\nKs 1 1 1\nNs 900", {"roughness": 0.7, "specular": 1.0}),
        ("Ks 0.5 0.5 0.5\nNs 250", {"roughness": 0.5, "specular": 1.0}),
        ("Ks 0.25 0.25 0.25\nNs 0", {"roughness": 1.0, "specular": 0.5}),
        ("Ks 0 0 0\nNs 250", {}),
        ("Ns 250", {}),
        ("Ke red\nNi many\nPm nan\nPr", {}),
        ("d 0.25", {"alpha": 0.25, "alpha_mode": "blend"}),
        ("d 1.0", {}),
        ("Tr 0.75", {"alpha": 0.25, "alpha_mode": "blend"}),
        ("d 0.5\nTr 0.25", {"alpha": 0.5, "alpha_mode": "blend"}),
        ("d -2", {"alpha": 0.0, "alpha_mode": "blend"}),
        ("d -halo 0.5", {}),
        ("Pm 7\nPr -3\nNi 0.5", {"metallic": 1.0, "roughness": 0.0, "specular": 1.0}),
    ],
)
def test_mtl_keys(tmp_path: Path, lines: str, fields: dict[str, object]) -> None:
    got = material_of(tmp_path, lines)
    assert got.alpha_mode == fields.pop("alpha_mode", "opaque")
    for name in ("emission", "ior", "metallic", "roughness", "specular", "transmission", "base_color", "alpha"):
        assert getattr(got, name) == pytest.approx(fields.get(name, getattr(PLAIN, name))), name


def saved(folder: Path, name: str, *rows: list[object]) -> NDArray[np.uint8]:
    """An image of these pixels, written to a file."""
    pixels = np.array(rows, np.uint8)
    Image.fromarray(pixels).save(folder / name)
    return pixels


def textures_of(source: Source) -> list[Texture | None]:
    """The textures of the only material, in the order of model.TextureSet."""
    (material,) = source.materials
    return [None if k is None else source.textures[k] for k in material.textures]


def test_maps_of_emission_and_normals_are_textures(tmp_path: Path) -> None:
    glow = saved(tmp_path, "my glow.png", [[255, 0, 0], [0, 9, 0]])
    bumps = saved(tmp_path, "bumps.png", [[128, 128, 255], [90, 128, 240]])
    source = source_of(tmp_path, "Ke 0 0 0\nmap_Ke my glow.png\nnorm -bm 0.25 bumps.png")
    color, surface, emission, normal = textures_of(source)
    assert color is None
    assert surface is None
    assert emission is not None
    assert normal is not None
    np.testing.assert_array_equal(emission.texels, glow)
    np.testing.assert_array_equal(normal.texels, bumps)
    assert (emission.linear, normal.linear) == (False, True)
    assert (source.materials[0].emission, source.materials[0].normal_scale) == ((1.0, 1.0, 1.0), 0.25)
    assert source.meshes[0].uvs is not None
    assert source.notes == ()
    assert material_of(tmp_path, "Ke 2 3 4\nmap_Ke my glow.png").emission == (2.0, 3.0, 4.0)


@pytest.mark.parametrize(
    ("lines", "green", "blue", "fields"),
    [
        ("map_Pr r.png", [51, 204], [255, 255], (0.0, 1.0)),
        ("map_Pm m.png", [255] * 4, [255, 0, 102, 0], (1.0, 1.0)),
        ("Pr 0.5\nPm 0.25\nmap_Pr r.png\nmap_Pm r.png", [51, 204], [51, 204], (0.25, 0.5)),
        ("map_Pm deep.png", [255, 255], [255, 1], (1.0, 1.0)),
    ],
)
def test_maps_of_roughness_and_metal_are_one_texture(
    tmp_path: Path, lines: str, green: list[int], blue: list[int], fields: tuple[float, float]
) -> None:
    saved(tmp_path, "r.png", [51, 204])
    saved(tmp_path, "m.png", [[255] * 3, [0] * 3, [102] * 3, [0] * 3])
    Image.fromarray(np.array([[65535, 256]], np.uint16)).save(tmp_path / "deep.png")
    source = source_of(tmp_path, lines)
    _, surface, _, _ = textures_of(source)
    assert surface is not None
    assert surface.linear
    np.testing.assert_array_equal(surface.texels[0, :, 1:].T, [green, blue])
    assert (source.materials[0].metallic, source.materials[0].roughness) == fields


@pytest.mark.parametrize("image", ["cut.png", "alpha.png"])
@pytest.mark.parametrize(("lines", "mode"), [("", "mask"), ("\nd 1", "mask"), ("\nd 0.5", "blend")])
def test_map_d_is_alpha(tmp_path: Path, image: str, lines: str, mode: str) -> None:
    """Of a file with alpha its alpha, else its grey; a mask, where nothing else makes the surface translucent."""
    saved(tmp_path, "leaf.png", [[9, 99, 0], [8, 88, 0]])
    saved(tmp_path, "cut.png", [255, 64])
    saved(tmp_path, "alpha.png", [[0, 0, 0, 255], [255, 255, 255, 64]])
    source = source_of(tmp_path, f"map_Kd leaf.png\nmap_d {image}{lines}")
    color, *others = textures_of(source)
    assert others == [None] * 3
    assert color is not None
    assert color.alpha is not None
    np.testing.assert_array_equal(color.texels, [[[9, 99, 0], [8, 88, 0]]])
    np.testing.assert_array_equal(color.alpha, [[255, 64]])
    assert source.materials[0].alpha_mode == mode
    assert source.notes == ()


def test_a_mask_without_a_colour_map_leaves_the_colour(tmp_path: Path) -> None:
    saved(tmp_path, "cut.png", [255, 64])
    source = source_of(tmp_path, "map_d cut.png")
    color, *_ = textures_of(source)
    assert color is not None
    assert (color.texels == 255).all()
    assert source.materials[0].base_color == (0.5, 0.5, 0.5)


@pytest.mark.parametrize("line", ["map_Ke gone.png", "map_d gone.png", "map_Pr broken.png", "norm ../m.obj"])
def test_a_map_that_cannot_be_read_is_noted(tmp_path: Path, line: str) -> None:
    (tmp_path / "broken.png").write_bytes(b"\x89PNG\r\n\x1a\n")
    source = source_of(tmp_path, line)
    (note,) = source.notes
    assert note.startswith(f"material 'it': its {line.split()[0]} cannot be read (")
    (material,) = source.materials
    assert (material.textures, material.alpha_mode, material.emission) == (NO_TEXTURES, "opaque", (0.0, 0.0, 0.0))


@pytest.mark.parametrize(
    ("lines", "left_out"),
    [
        ("map_Bump -bm 0.3 a.png\nmap_Ks a.png\nmap_Ns a.png\nillum 7",
         "map_Bump (it); map_Ks (it); map_Ns (it); illum 7 (it)"),
        ("bump a.png\ndisp a.png\nrefl -type sphere a.png", "bump (it); disp (it); refl (it)"),
        ("Tf 1 0.5 1\nPs 0.5\nPc 1\naniso 0.5", "aniso (it); Pc (it); Ps (it); Tf (it)"),
        ("map_Kd -s 2 2 1 a.png\nmap_Ke -o 0.5 a.png\nnorm -clamp on a.png",
         "-o of map_Ke (it); -clamp of norm (it); -s of map_Kd (it)"),
        ("map_Kd -s 1 1.0 1 -o 0 0 0 -clamp off -mm 0 1 a.png\nTf 1 1 1\nPs 0\nPc 0.0\naniso 0\nillum 2", ""),
        ("Ka 1 1 1\nKs 0 0 0\nNs 10\nNi 1.45\nd 1\nillum 1", ""),
    ],
)  # fmt: skip
def test_what_is_not_drawn_is_in_one_note(tmp_path: Path, lines: str, left_out: str) -> None:
    saved(tmp_path, "a.png", [[1, 2, 3]])
    expected = (f"of its materials is not drawn: {left_out}",) if left_out else ()
    source = source_of(tmp_path, lines)
    assert source.notes == expected
    if "map_Kd" in lines:
        assert source.materials[0].textures.base_color is not None
