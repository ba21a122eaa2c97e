"""What an MTL file says of surfaces besides their colour."""

from __future__ import annotations

from pathlib import Path

import pytest

from wall.scene.loading import load
from wall.scene.model import Material

TRIANGLE = "mtllib m.mtl\nusemtl it\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"
PLAIN = Material(name="it", base_color=(0.5, 0.5, 0.5))


def material_of(folder: Path, lines: str) -> Material:
    (folder / "m.mtl").write_text(f"newmtl it\nKd 0.5 0.5 0.5\n{lines}\n", encoding="utf-8")
    (folder / "m.obj").write_text(TRIANGLE, encoding="utf-8")
    (material,) = load(folder / "m.obj").materials
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
        ("Pm 7\nPr -3\nNi 0.5", {"metallic": 1.0, "roughness": 0.0, "specular": 1.0}),
    ],
)
def test_mtl_keys(tmp_path: Path, lines: str, fields: dict[str, object]) -> None:
    got = material_of(tmp_path, lines)
    for name in ("emission", "ior", "metallic", "roughness", "specular", "transmission", "base_color"):
        assert getattr(got, name) == pytest.approx(fields.get(name, getattr(PLAIN, name))), name
