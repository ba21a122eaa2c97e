"""All ranks of a run have the same program, configuration and models, or the run is refused before it begins.

Each rank reads its own host's files. Where they differ every rank does its work, and the picture is wrong. A file of
the scene that a host lacks is sent there by the head.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import suppress
from importlib.metadata import version
from pathlib import Path
from typing import Any, Protocol

from wall.config.loading import dump
from wall.config.scene_data import DataConfig, SeriesConfig
from wall.core.errors import ConfigError, SceneError
from wall.core.files import read_file
from wall.roles.plan import HEAD, Layout
from wall.scene.data.samples import BUILT_IN_DATA
from wall.scene.data.steps import steps_of
from wall.scene.data.vtk_files import files_of_header
from wall.scene.gltf import MOST_BYTES
from wall.scene.materials import texture_of
from wall.scene.mtl import DRAWN_MAPS, options_of
from wall.scene.sources import BUILT_IN, sources_of

PROGRAM = Path(__file__).parents[1]
MISSING = "missing"
FILE = "file "  # before the name of one of the scene's
MAPS = re.compile(rf"^[ \t]*(?:map_Kd|{'|'.join(DRAWN_MAPS)})[ \t]+(\S.*?)\s*$", re.MULTILINE | re.IGNORECASE)


class Gathers(Protocol):
    """Ranks that can tell each other a text."""

    rank: int

    def allgather(self, text: str) -> list[str]:
        """Every rank's text, in rank order."""
        ...


class Shares(Gathers, Protocol):
    """Ranks that the first one can send files to."""

    def shared(self, data: bytes | None) -> Iterator[bytes]:
        """The bytes of rank 0, which alone has them, at every rank, part after part."""
        ...


def check_same(ranks: Shares, layout: Layout, machines: Sequence[str]) -> list[str]:
    """Compare files with those of the head, together with all other ranks; `machines`: their names, by rank.

    Files of the scene that a machine lacks are written where they are looked for. Returns notes of these. Raises
    ConfigError at the head, which names what differs and where; SystemExit at the others.
    """
    notes: list[str] = []
    before: dict[str, list[int]] = {}
    while True:  # what was sent may name others
        prints = [json.loads(text) for text in ranks.allgather(json.dumps(fingerprints(layout)))]
        lacking = _lacking(prints, machines)
        if not lacking or lacking == before or _differ(prints):
            break
        for name, targets in lacking.items():
            _send(ranks, layout, name, targets)
            whom = ", ".join(dict.fromkeys(machines[rank] for rank in targets))
            notes.append(f"{name.removeprefix(FILE)} was sent to {whom}")
        before = lacking
    found = differences(prints, machines)
    if found and ranks.rank != HEAD:
        raise SystemExit(2)
    if found:
        raise ConfigError("\n".join(found))
    return notes


def _differ(prints: Sequence[dict[str, str]]) -> bool:
    """Whether anything is another one somewhere, so that nothing is to be sent before the refusal."""
    return any(each.get(name) not in (None, MISSING, own) for name, own in prints[HEAD].items() for each in prints)


def _lacking(prints: Sequence[dict[str, str]], machines: Sequence[str]) -> dict[str, list[int]]:
    """Files that the head has: the first rank of each machine that lacks one."""
    found: dict[str, list[int]] = {}
    for name, own in prints[HEAD].items():
        there: dict[str, int] = {}  # by machine, its first rank
        for rank, each in enumerate(prints):
            if each.get(name) == MISSING:
                there.setdefault(machines[rank], rank)
        if name.startswith(FILE) and own != MISSING and there:
            found[name] = list(there.values())
    return found


def _send(ranks: Shares, layout: Layout, name: str, targets: Sequence[int]) -> None:
    """Write a file of the head's at some ranks, in no other one's place; where that fails it stays missing."""
    path = (layout.loaded.folder / name.removeprefix(FILE)).resolve()
    data = (_bytes_of(path) or b"") if ranks.rank == HEAD else None
    part = _new_file_beside(path) if ranks.rank in targets else None
    for piece in ranks.shared(data):  # all of it, whatever becomes of it: the others wait
        if part is not None and not part.write(piece):
            part.drop()
            part = None
    if part is not None:
        part.keep()


class _NewFile:
    """A file beside the place that it is for."""

    def __init__(self, path: Path) -> None:
        """Raises OSError."""
        self._path = path
        self._file = tempfile.NamedTemporaryFile(dir=path.parent, delete=False)  # noqa: SIM115  # closed below

    def write(self, data: bytes) -> bool:
        """Whether that was possible."""
        try:
            self._file.write(data)
            self._file.flush()
        except OSError:
            return False
        return True

    def keep(self) -> None:
        """Give it its name, unless there is a file of that name by now."""
        with suppress(OSError):
            mask = os.umask(0)
            os.umask(mask)
            os.chmod(self._file.name, 0o666 & ~mask)
            os.link(self._file.name, self._path)
        self.drop()

    def drop(self) -> None:
        """Leave nothing of it."""
        with suppress(OSError):
            self._file.close()
        with suppress(OSError):
            os.unlink(self._file.name)


def _new_file_beside(path: Path) -> _NewFile | None:
    """None where there can be none."""
    with suppress(OSError):
        path.parent.mkdir(parents=True, exist_ok=True)
        return _NewFile(path)
    return None


def differences(prints: Sequence[dict[str, str]], machines: Sequence[str], who: Sequence[str] = ()) -> list[str]:
    """A line for each file that is not the same everywhere; hosts are named once, with their first rank.

    prints : of each rank, its fingerprints
    who : their names, where they are no ranks yet
    """
    who = who or [f"rank {rank}" for rank in range(len(prints))]
    lines: list[str] = []
    for name in dict.fromkeys(name for each in prints for name in each):
        own = prints[HEAD].get(name)
        others: dict[str, str] = {}  # by machine
        for rank, each in enumerate(prints):
            if (found := each.get(name)) != own:
                what = "is missing" if found in (None, MISSING) else "differs"
                others.setdefault(machines[rank], f"{what} on {machines[rank]} ({who[rank]})")
        if others:
            differs = any(each.get(name) not in (None, MISSING, own) for each in prints)
            there = "it is not there" if own in (None, MISSING) else "it is another one" if differs else "there is one"
            head = f"on {machines[HEAD]} ({who[HEAD]}) {there}"
            lines.append(f"{name}: {', '.join(others.values())}; {head}; wanted: the same on all hosts")
    return lines


def fingerprints(layout: Layout) -> dict[str, str]:
    """By name, what tells the program, the configuration as it is run, and the files of its scene from others."""
    loaded, scene = layout.loaded, layout.config.scene
    files = [name for name in sources_of(scene) if name not in BUILT_IN]
    files += [data.file for data in scene.data if data.file not in BUILT_IN_DATA and data.series is None]
    files += [] if scene.environment is None else [scene.environment.file]
    files += [name for material in scene.materials if (name := texture_of(material)) is not None]
    prints = {
        f"the program (wall {version('wall')})": _of_program(),
        f"configuration {loaded.name}": _print_of(dump(layout.config).encode()),
    }
    for data in scene.data:
        if data.series is not None and data.file not in BUILT_IN_DATA:
            prints[f"names and sizes of the steps of {data.file}"] = _of_steps(data, data.series, loaded.folder)
    for name in files:
        path = loaded.folder / name
        content = _bytes_of(path)
        prints[f"{FILE}{_named(path, loaded.folder)}"] = _print_of(content)
        for each in _named_in(path, content):
            more = _bytes_of(each)
            prints[f"{FILE}{_named(each, loaded.folder)}"] = _print_of(more)
            for image in _named_in(each, more):
                prints[f"{FILE}{_named(image, loaded.folder)}"] = _print_of(_bytes_of(image))
    return prints


def _named(path: Path, folder: Path) -> str:
    return str(path.relative_to(folder) if path.is_relative_to(folder) else path)


def _of_program() -> str:
    total = hashlib.blake2b(digest_size=16)
    for path in sorted(PROGRAM.rglob("*.py")):
        total.update(str(path.relative_to(PROGRAM)).encode() + b"\0" + path.read_bytes() + b"\0")
    return total.hexdigest()


def _of_steps(data: DataConfig, series: SeriesConfig, folder: Path) -> str:
    """Of a series, which is not read whole for this: the names and the sizes of its files."""
    try:
        parts = steps_of(data, series, folder / data.file, "").parts
        sizes = {part.path.name: part.path.stat().st_size for part in parts}
    except (SceneError, OSError):  # which is said elsewhere
        return MISSING
    return _print_of(json.dumps([len(parts), sizes]).encode())


def _bytes_of(path: Path) -> bytes | None:
    """None for a file that cannot be read, which is said elsewhere."""
    try:
        return read_file(path, MOST_BYTES)
    except (OSError, ValueError):  # ValueError: a name with a NUL
        return None


def _print_of(data: bytes | None) -> str:
    return MISSING if data is None else hashlib.blake2b(data, digest_size=16).hexdigest()


def _named_in(path: Path, data: bytes | None) -> list[Path]:
    """The files that a .gltf, .obj, .mtl or .mhd names; none of one that makes no sense, which is said elsewhere."""
    suffix, text = path.suffix.lower(), (data or b"").decode("utf-8-sig", "replace")
    if suffix == ".obj":
        words = (line.split(None, 1) for line in text.splitlines() if line.startswith("mtllib "))
        return [path.parent / both[1].strip() for both in words if len(both) == 2]
    if suffix == ".mtl":
        return [path.parent / options_of(words.split())[1] for words in MAPS.findall(text)]
    if suffix == ".mhd":
        return [path.parent / name for name in files_of_header(text)]
    try:
        header: dict[str, Any] = json.loads(text) if suffix == ".gltf" else {}
        parts = [*header.get("buffers", []), *header.get("images", [])]
        uris = [part["uri"] for part in parts if not part.get("uri", "data:").startswith("data:")]
        return [path.parent / uri for uri in uris]
    except (ValueError, KeyError, TypeError, AttributeError):
        return []
