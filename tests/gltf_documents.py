"""Small glTF files, written and loaded."""

from __future__ import annotations

import base64
import json
import struct
from pathlib import Path
from typing import Any

import numpy as np

from wall.core.data import Float32
from wall.scene.loading import load
from wall.scene.model import Source

TRIANGLE = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], np.float32), np.array([[0, 0], [1, 0], [0, 1]], np.float32)
_AROUND = np.array([[0, 1], [1, 1], [1, 0], [0, 1], [1, 0], [0, 0]], np.float32)  # texture coordinates, v down
SQUARE = (
    np.stack([2 * _AROUND[:, 0] - 1, 1 - 2 * _AROUND[:, 1], 0 * _AROUND[:, 0]], 1),
    _AROUND,
)  # of edge 2, towards +z


def data_uri(data: bytes, kind: str = "application/octet-stream") -> str:
    return f"data:{kind};base64," + base64.b64encode(data).decode()


def document(materials: list[dict[str, Any]], shape: tuple[Float32, Float32] = TRIANGLE, **more: Any) -> dict[str, Any]:
    """A mesh of one shape for each material, side by side; shape : corners, three a triangle, and where they are in
    textures, v down."""
    corners, uvs = shape
    data = corners.astype(np.float32).tobytes() + uvs.astype(np.float32).tobytes()
    number, low, high = len(corners), corners.min(axis=0).tolist(), corners.max(axis=0).tolist()
    return {
        "asset": {"version": "2.0"},
        "buffers": [{"byteLength": len(data), "uri": data_uri(data)}],
        "bufferViews": [
            {"buffer": 0, "byteLength": 12 * number},
            {"buffer": 0, "byteOffset": 12 * number, "byteLength": 8 * number},
        ],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": number, "type": "VEC3", "min": low, "max": high},
            {"bufferView": 1, "componentType": 5126, "count": number, "type": "VEC2"},
        ],
        "materials": materials,
        "meshes": [
            {"primitives": [{"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "material": k}]}
            for k in range(len(materials))
        ],
        "nodes": [{"mesh": k, "translation": [2.0 * k, 0, 0]} for k in range(len(materials))],
        "scenes": [{"nodes": list(range(len(materials)))}],
        "scene": 0,
        **more,
    }


def loaded(folder: Path, found: dict[str, Any], *, binary: bool = False) -> Source:
    """The source of a document, written to `folder` as model.gltf or model.glb."""
    text = json.dumps(found).encode()
    if not binary:
        (folder / "model.gltf").write_bytes(text)
        return load(folder / "model.gltf")
    text += b" " * (-len(text) % 4)
    head = struct.pack("<4sII", b"glTF", 2, 20 + len(text)) + struct.pack("<II", len(text), 0x4E4F534A)
    (folder / "model.glb").write_bytes(head + text)
    return load(folder / "model.glb")
