"""Values of a glTF file's accessors that trimesh leaves alone: of animations and of instances.

glTF 2.0 specification, 3.6.
"""

from __future__ import annotations

import base64
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np

from wall.core.data import Float64
from wall.core.files import read_file
from wall.scene.gltf import BINARY_CHUNK, CHUNK, HEADER, MOST_BYTES

COMPONENTS = {5120: np.int8, 5121: np.uint8, 5122: np.int16, 5123: np.uint16, 5126: np.float32}
WIDTHS = {"SCALAR": 1, "VEC3": 3, "VEC4": 4}


@dataclass(frozen=True, slots=True, eq=False)
class Accessors:
    """The accessors of a file; each of its buffers is read once. Raises what malformed files raise, see gltf.MALFORMED,
    OSError and struct.error."""

    path: Path
    header: dict[str, Any]  # its JSON
    _buffers: dict[int, bytes] = field(default_factory=dict)

    def values(self, number: int) -> Float64:
        """(n, width) numbers of an accessor; integers are normalised, as rotations may be."""
        found = self.header["accessors"][number]
        view = self.header["bufferViews"][found["bufferView"]]
        kind: np.dtype[Any] = np.dtype(COMPONENTS[found["componentType"]]).newbyteorder("<")
        width = WIDTHS[found["type"]]
        start = view.get("byteOffset", 0) + found.get("byteOffset", 0)
        stride = view.get("byteStride", width * kind.itemsize)
        data = self._buffer(view["buffer"])
        rows = np.ndarray((found["count"], width), kind, data, start, (stride, kind.itemsize)).astype(np.float64)
        return rows if kind.kind == "f" else np.maximum(rows / np.iinfo(kind).max, -1.0)

    def _buffer(self, number: int) -> bytes:
        """Bytes of a buffer: of the file itself, of a data URI, or of a file beside it."""
        if number not in self._buffers:
            uri = self.header["buffers"][number].get("uri")
            if uri is None:
                self._buffers[number] = _binary_chunk(self.path)
            elif uri.startswith("data:"):
                self._buffers[number] = base64.b64decode(uri.partition(",")[2])
            else:
                self._buffers[number] = read_file(self.path.parent / unquote(uri), MOST_BYTES)
        return self._buffers[number]


def _binary_chunk(path: Path) -> bytes:
    """The binary data of a .glb file."""
    data = read_file(path, MOST_BYTES)
    start = HEADER.size + CHUNK.size + CHUNK.unpack_from(data, HEADER.size)[0]
    length, kind = CHUNK.unpack_from(data, start)
    if kind != BINARY_CHUNK:
        raise ValueError("it has no chunk of binary data")
    return data[start + CHUNK.size : start + CHUNK.size + length]
