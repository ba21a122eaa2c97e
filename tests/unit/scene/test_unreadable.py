"""What is wrong with a model's file is told by its line or size, where a parser has words of its own for it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
import trimesh

from wall.core.errors import SceneError
from wall.scene.loading import load
from wall.scene.unreadable import as_utf8


def gltf(**lists: Any) -> bytes:
    return json.dumps({"asset": {"version": "2.0"}, **lists}).encode()


PLY = b"""ply
format ascii 1.0
comment caf\xe9
element vertex 4
property float x
property float y
property float z
element face 3
property list uchar int vertex_indices
end_header
0 0 0
1 0 0
0 1 0
0 0 1
3 0 1 2
3 0 1 3
3 0 2 3"""
STL = b"""solid caf\xe9
facet normal 0 0 1
outer loop
vertex 0 0 0
vertex 1 0 0
vertex 0 1 0
endloop
endfacet
endsolid"""


@pytest.mark.parametrize(
    ("name", "content", "told"),
    [
        ("index.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n", "line 4, 'f 1 2 9': there is no v 9; wanted: 1 to 3"),
        ("word.obj", b"v 0 x 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "line 1, 'v 0 x 0': x is no number"),
        ("node.gltf", gltf(nodes=[{}], scenes=[{"nodes": [0, 7]}]), "scenes[0].nodes = 7: it has 1 nodes"),
        ("mesh.gltf", gltf(nodes=[{"mesh": 0}], scenes=[{"nodes": [0]}]), "nodes[0].mesh = 0: it has no meshes"),
        ("loop.gltf", gltf(nodes=[{"children": [k]} for k in (1, 0, 1)]), "its nodes [0, 1] are children of"),
        ("circle.gltf", gltf(nodes=[{"children": [1]}, {"children": [0]}]), "its nodes [0, 1] are children of"),
        ("few.stl", bytes(80) + b"\x05\0\0\0" + bytes(60), "the file ends after 144 of the 334 bytes"),
        ("ends.stl", b"solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\n", "ends without its line endsolid"),
        ("cut.ply", PLY[:-8], "the file ends after 6 of the 7 lines that its header tells"),
        ("cut.glb", b"glTF\x02\0\0\0\x40\0\0\0\x08\0\0\0JSON{", "ends after 21 of the 64 bytes"),
    ],
)
def test_a_fault_is_told_with_its_place(tmp_path: Path, name: str, content: bytes, told: str) -> None:
    (tmp_path / name).write_bytes(content)
    with pytest.raises(SceneError) as caught:
        load(tmp_path / name)
    assert name in str(caught.value)
    assert told in str(caught.value)


@pytest.mark.parametrize("end", [b"\n", b"\r\n", b""])
def test_a_ply_in_text_is_whole_however_its_lines_end(tmp_path: Path, end: bytes) -> None:
    (tmp_path / "whole.ply").write_bytes(PLY.replace(b"\n", end or b"\n") + end)
    assert load(tmp_path / "whole.ply").meshes[0].triangles.shape == (3, 3)


def test_text_in_other_encodings_than_utf8_is_read(tmp_path: Path) -> None:
    """As of a name or a comment of long ago."""
    (tmp_path / "a.stl").write_bytes(STL)
    assert load(tmp_path / "a.stl").meshes[0].triangles.shape == (1, 3)
    (tmp_path / "b.mtl").write_bytes(b"# caf\xe9\nnewmtl r\xf6t\nKd 1 0 0\n")
    (tmp_path / "b.obj").write_bytes(b"mtllib b.mtl\nusemtl r\xf6t\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    assert load(tmp_path / "b.obj").materials[0].base_color == (1.0, 0.0, 0.0)


def test_only_text_is_rewritten() -> None:
    binary = trimesh.creation.box().export(file_type="stl")
    assert as_utf8(binary, "stl") is binary
    assert as_utf8(b"\xe9", "png") == b"\xe9"
    assert as_utf8("caf\u00e9".encode(), "mtl") == "caf\u00e9".encode()
    assert as_utf8(b"ply\ncomment \xe9\nend_header\n\xff", "ply") == b"ply\ncomment \xc3\xa9\nend_header\n\xff"
