"""What is wrong with a model's file, where its parser says so only in words of its own."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from pathlib import Path

from wall.scene.gltf import HEADER

SHOWN = 60  # characters of a line
WIDTHS = {"v": 3, "vt": 2, "vn": 3}  # numbers at least


def why_unreadable(path: Path) -> str:
    """The first fault in an OBJ file, with its line, or that a GLB file is cut short; "" where none is known."""
    try:
        if path.suffix.lower() == ".obj":
            return _in_obj(path.read_text(encoding="latin-1"))
        if path.suffix.lower() == ".glb":
            return _in_glb(path)
    except OSError:
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
