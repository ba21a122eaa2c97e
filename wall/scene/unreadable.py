"""What is wrong with a model's file, where its parser says so only in words of its own, or not at all."""

from __future__ import annotations

import re
import struct
from collections import Counter
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from wall.scene.gltf import HEADER, MALFORMED, renamed

PLY_END = b"end_header"
STL_HEADER = struct.Struct("<80xI")  # how many triangles
STL_TRIANGLE_BYTES = 50
TEXT = ("mtl", "ply", "stl")  # of these kinds, trimesh wants UTF-8, or a package that guesses
SHOWN = 60  # characters of a line
REFERENCES = {  # of glTF: the list that each member of a list's entries counts in
    "scenes": {"nodes": "nodes"},
    "nodes": {"children": "nodes", "mesh": "meshes", "camera": "cameras", "skin": "skins"},
    "accessors": {"bufferView": "bufferViews"},
    "bufferViews": {"buffer": "buffers"},
    "images": {"bufferView": "bufferViews"},
    "textures": {"source": "images", "sampler": "samplers"},
}
WIDTHS = {"v": 3, "vt": 2, "vn": 3}  # numbers at least


def text_of(data: bytes) -> str:
    """Text of a model's file; what is not UTF-8 is taken for Latin-1."""
    try:
        return data.decode("utf-8")
    except UnicodeDecodeError:
        return data.decode("latin-1")


def as_utf8(data: bytes, kind: str) -> bytes:
    """A model's file with its text in UTF-8, see text_of. Binary files come back as they are; of a PLY only the header
    is text."""
    binary = kind == "stl" and len(data) >= STL_HEADER.size and len(data) == _stl_size(data)
    if kind not in TEXT or binary:
        return data
    end = data.find(PLY_END) if kind == "ply" else len(data)
    text = text_of(data[:end]).encode()
    return data if text == data[:end] else text + data[end:]


def check_ply(data: bytes) -> None:
    """Raise ValueError for a PLY file in text that has fewer lines than its header tells; of binary ones its parser
    counts the bytes."""
    end = data.find(PLY_END)
    head = data[:end]
    if not re.search(rb"^format\s+ascii", head, re.MULTILINE):
        return
    told = sum(int(count) for count in re.findall(rb"^element\s+\S+\s+(\d+)", head, re.MULTILINE))
    there = data.count(b"\n", end) - 1 + (not data.endswith(b"\n"))  # the first ends the header
    if there < told:
        raise ValueError(f"the file ends after {max(there, 0)} of the {told} lines that its header tells")


def _stl_size(data: bytes) -> int:
    """Bytes of a binary STL file, as its header tells."""
    (triangles,) = STL_HEADER.unpack_from(data)
    return STL_HEADER.size + STL_TRIANGLE_BYTES * int(triangles)


def why_unreadable(path: Path) -> str:
    """The first fault in an OBJ file, with its line, a reference of a glTF file to nothing, or that a GLB or STL file
    is cut short; "" where none is known."""
    try:
        if path.suffix.lower() == ".obj":
            return _in_obj(path.read_text(encoding="latin-1"))
        if path.suffix.lower() == ".glb":
            return _in_glb(path) or _in_gltf(renamed(path)[1])
        if path.suffix.lower() == ".gltf":
            return _in_gltf(renamed(path)[1])
        if path.suffix.lower() == ".stl":
            return _in_stl(path.read_bytes())
    except (OSError, *MALFORMED):
        pass
    return ""


def _in_obj(text: str) -> str:
    lines = [line.partition("#")[0].split() or [""] for line in text.splitlines()]
    counts = Counter(kind for kind, *_ in lines if kind in WIDTHS)
    for number, (kind, *words) in enumerate(lines, start=1):
        why = ""
        if wanted := WIDTHS.get(kind, 0):
            why = next((f"{word} is no number" for word in words if not _is_number(word)), "")
            why = why or (f"{len(words)} numbers; wanted: {wanted} at least" if len(words) < wanted else "")
        elif kind == "f":
            why = next(filter(None, (_of_corner(word, counts) for word in words)), "")
            why = why or (f"{len(words)} corners; wanted: 3 at least" if len(words) < 3 else "")
        if why:
            return f"line {number}, {' '.join((kind, *words))[:SHOWN]!r}: {why}"
    return ""


def _of_corner(word: str, counts: Mapping[str, int]) -> str:
    """What is wrong with a face's corner, v/vt/vn, each a number from 1 or backwards; "" if nothing is."""
    for kind, text in zip(WIDTHS, word.split("/"), strict=False):
        if not text:
            continue
        if not text.lstrip("-").isdecimal():
            return f"{text} is no whole number"
        if not 0 < abs(int(text)) <= counts[kind]:
            return f"there is no {kind} {text}; wanted: 1 to {counts[kind]}"
    return ""


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True


def _in_glb(path: Path) -> str:
    size = path.stat().st_size
    with path.open("rb") as file:
        head = file.read(HEADER.size)
    if len(head) < HEADER.size:
        return f"the file ends after {size} bytes; wanted: a header of {HEADER.size}"
    _, _, wanted = HEADER.unpack(head)
    return f"the file ends after {size} of the {wanted} bytes that its header tells" if size < wanted else ""


def _in_stl(data: bytes) -> str:
    if data[:5].lower() == b"solid" and b"facet" in data:
        return "" if b"endsolid" in data else "the file ends without its line endsolid"
    if len(data) < STL_HEADER.size:
        return f"the file ends after {len(data)} bytes; wanted: a header of {STL_HEADER.size}"
    wanted = _stl_size(data)
    return f"the file ends after {len(data)} of the {wanted} bytes that its header tells" if len(data) < wanted else ""


def _in_gltf(header: dict[str, Any]) -> str:
    for where, kind, number in _references(header):
        count = len(header.get(kind, []))
        if not 0 <= number < count:
            return f"{where} = {number}: it has {count or 'no'} {kind}"
    return ""


def _references(header: dict[str, Any]) -> Iterator[tuple[str, str, int]]:
    """Where a glTF file names an entry of one of its lists, by its number: the place, the list, and the number."""
    for kind, members in REFERENCES.items():
        for k, entry in enumerate(header.get(kind, [])):
            for member, other in members.items():
                found = entry.get(member, [])
                for number in found if isinstance(found, list) else [found]:
                    yield f"{kind}[{k}].{member}", other, number
    for k, mesh in enumerate(header.get("meshes", [])):
        for n, primitive in enumerate(mesh["primitives"]):
            at = f"meshes[{k}].primitives[{n}]"
            yield from ((f"{at}.{name}", "accessors", number) for name, number in primitive["attributes"].items())
            for name, other in (("indices", "accessors"), ("material", "materials")):
                if name in primitive:
                    yield f"{at}.{name}", other, primitive[name]
