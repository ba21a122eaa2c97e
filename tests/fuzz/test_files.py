"""Files of every kind with some bytes changed: read, or refused with the error that is documented, within its limits.

corpus/ has inputs that once were not; NAME.KIND is one of the target NAME.
"""

from __future__ import annotations

import contextlib
import json
import os
import resource
import struct
import time
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path

import numpy as np
import OpenEXR
import pytest
import trimesh
from mutated_bytes import mutated
from PIL import Image
from radiance_writer import write_hdr

from wall.config.loading import load as load_config
from wall.core.errors import ConfigError, RemoteProtocolError, RunError, SceneError
from wall.display.steering import parse_message
from wall.importers.command import convert_file
from wall.operators.blend_mask import read_mask
from wall.operators.lut import read_lut
from wall.operators.pyramid import opened, read_descriptor
from wall.operators.warp import read_mesh
from wall.run.control_file import parse as parse_control_file
from wall.run.event_file import EventFile, EventReader
from wall.scene.data.tables import read_table
from wall.scene.environment import read_environment
from wall.scene.loading import load as load_model

ROUNDS = int(os.environ.get("WALL_FUZZ_FILES", 40))  # of each target
SEED = int(os.environ.get("WALL_FUZZ_SEED", 1))
MOST_S, MOST_BYTES = 1.0, 256 << 20  # of processor time and of memory, for one input
CORPUS = Path(__file__).with_name("corpus")
CONFIGS = Path(__file__).parents[2] / "configs"
BALL = trimesh.creation.icosphere(subdivisions=0)
RAMP = np.linspace(0.0, 2.0, 8 * 16 * 3, dtype=np.float32).reshape(8, 16, 3)


@dataclass(frozen=True)
class Target:
    """What reads a kind of file, some that are good, and how it refuses others."""

    read: Callable[[Path], object]
    good: dict[str, bytes]  # by their suffixes
    refusal: type[Exception]
    beside: dict[str, bytes] = field(default_factory=dict)


def image(kind: str, mode: str = "RGB") -> bytes:
    made = BytesIO()
    Image.fromarray((RAMP * 127.0).astype(np.uint8)).convert(mode).save(made, kind)
    return made.getvalue()


def saved(save: Callable[[Path], object], name: str) -> bytes:
    """What a library that wants to write to a file writes."""
    path = Path(os.environ.get("TMPDIR", "/tmp")) / f"wall-fuzz-{os.getpid()}-{name}"
    try:
        save(path)
        return path.read_bytes()
    finally:
        path.unlink(missing_ok=True)


def table(**columns: np.ndarray) -> bytes:
    made = BytesIO()
    np.savez(made, **columns)
    return made.getvalue()


def array(values: np.ndarray) -> bytes:
    made = BytesIO()
    np.save(made, values)
    return made.getvalue()


def events(path: Path) -> None:
    file = EventFile(path)
    file.cores(0.5)
    file.message(b"hello")
    file.time(0.25)
    file.answer(True)
    file.dropped([b"a", b"bc"])
    file.batch(1, b"packet")
    file.close()


def read_events(path: Path) -> None:
    """As a replay does, in the order of `events`."""
    file = EventReader(path)
    for each in (file.cores, file.message, file.time, file.answer, file.dropped, file.batch):
        each()


def exported(kind: str) -> bytes:
    made = BALL.export(file_type=kind)
    return made if isinstance(made, bytes) else made.encode()


def gltf() -> bytes:
    return json.dumps({
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "translation": [1, 0, 0]}],
        "materials": [{"pbrMetallicRoughness": {"metallicFactor": 0}}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1, "material": 0}]}],
        "buffers": [{"byteLength": 42, "uri": "data.bin"}],
        "bufferViews": [{"buffer": 0, "byteLength": 36}, {"buffer": 0, "byteOffset": 36, "byteLength": 6}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"},
            {"bufferView": 1, "componentType": 5123, "count": 3, "type": "SCALAR"},
        ],
    }).encode()  # fmt: skip


BUFFER = struct.pack("<9f3H", 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 1, 2)
OBJ = b"mtllib m.mtl\nusemtl a\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvn 0 0 1\nf 1/1/1 2/1/1 3/1/1\n"
MTL = b"newmtl a\nKd 1 0 0\nKs 0.5 0.5 0.5\nNs 20\nmap_Kd -s 2 2 1 skin.png\n"
CSV = b"x, y, z, heat\n0, 0, 0, 1\n1, 2, 3, 0.5\n"
XYZ = np.arange(12, dtype=np.float32).reshape(4, 3)
PVX = (
    b'<pvx><Machine Name="a" Environment="DISPLAY=:0" Geometry="300x200+3+0" LowerLeft="-1 -1 -1" '
    b'LowerRight="1 -1 -1" UpperRight="1 1 -1"/></pvx>'
)
DZI = b'<Image TileSize="256" Overlap="1" Format="png"><Size Width="3000" Height="2000"/></Image>'
CUBE = b"LUT_3D_SIZE 2\n" + b"".join(b"%d %d %d\n" % (k & 1, k >> 1 & 1, k >> 2) for k in range(8))
MESH = b"columns: 2\nrows: 2\npoints: [[0, 0], [1, 0], [0, 1], [1, 1]]\n"
TARGETS = {
    "model": Target(
        load_model,
        {f".{kind}": exported(kind) for kind in ("glb", "ply", "stl")} | {".gltf": gltf(), ".obj": OBJ},
        SceneError,
        {"data.bin": BUFFER, "m.mtl": MTL, "skin.png": image("PNG")},
    ),
    "configuration": Target(
        load_config,
        {".yaml": (CONFIGS / "demo.yaml").read_bytes(), ".yml": (CONFIGS / "two_panels.yaml").read_bytes()},
        ConfigError,
    ),
    "wall": Target(convert_file, {".pvx": PVX}, ConfigError),
    "environment": Target(
        lambda path: read_environment(path, rotation=0.0, strength=1.0),
        {
            ".hdr": saved(lambda path: write_hdr(path, RAMP), "a.hdr"),
            ".exr": saved(lambda path: OpenEXR.File({}, {"RGB": RAMP.copy()}).write(str(path)), "a.exr"),
            ".png": image("PNG"), ".jpg": image("JPEG"),
        },
        SceneError,
    ),
    "mask": Target(read_mask, {".png": image("PNG", "L")}, ConfigError),
    "picture": Target(
        opened, {".tiff": image("TIFF"), ".png": image("PNG", "RGBA"), ".jpg": image("JPEG")}, ConfigError
    ),
    "pyramid": Target(read_descriptor, {".dzi": DZI}, ConfigError),
    "lut": Target(read_lut, {".cube": CUBE}, ConfigError),
    "warp": Target(read_mesh, {".yaml": MESH}, ConfigError),
    "table": Target(
        read_table, {".csv": CSV, ".npy": array(XYZ), ".npz": table(x=XYZ[:, 0], y=XYZ[:, 1], z=XYZ[:, 2])}, SceneError
    ),
    "events": Target(read_events, {".events": saved(events, "a.events")}, RunError),
    "control": Target(
        lambda path: parse_control_file(path.read_text(encoding="utf-8", errors="replace"), path.name),
        {".json": b'{"endpoint": "tcp://127.0.0.1:5000", "key": "0123abcd", "pid": 7, "head": "", "host": "a"}'},
        RunError,
    ),
    "page": Target(
        lambda path: parse_message(path.read_text(encoding="utf-8", errors="replace")),
        {
            ".orbit": b'{"kind": "orbit", "x": 0.25, "y": -1e-3, "view": 0}',
            ".shown": b'{"kind": "shown", "number": 7}',
            ".set": b'{"kind": "set", "name": "sky.zenith", "numbers": [0.5, 0.25, 1], "id": 4}',
        },
        RemoteProtocolError,
    ),
}  # fmt: skip


@contextlib.contextmanager
def limited() -> Iterator[None]:
    """While inside, more memory than MOST_BYTES is not given; fails where it takes longer than MOST_S."""
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[0])
    soft, hard = resource.getrlimit(resource.RLIMIT_AS)
    began = time.process_time()
    resource.setrlimit(resource.RLIMIT_AS, (pages * resource.getpagesize() + MOST_BYTES, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_AS, (soft, hard))
    took = time.process_time() - began
    assert took < MOST_S, f"it took {took:.1f} s"


def check(target: Target, path: Path) -> bool:
    """Whether a file is read; anything but that and the refusal fails."""
    with limited(), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            target.read(path)
        except target.refusal:
            return False
    return True


def folder_of(target: Target, folder: Path) -> Path:
    for name, content in target.beside.items():
        (folder / name).write_bytes(content)
    return folder


@pytest.mark.parametrize("name", TARGETS)
def test_changed_files_are_read_or_refused(name: str, tmp_path: Path) -> None:
    target, rng = TARGETS[name], np.random.default_rng((SEED, 4))
    folder_of(target, tmp_path)
    for suffix, content in target.good.items():
        path = tmp_path / f"good{suffix}"
        path.write_bytes(content)
        target.read(path)  # not limited: imports, and kernels
        assert check(target, path)
    for k in range(ROUNDS):
        suffix, content = list(target.good.items())[k % len(target.good)]
        path = tmp_path / f"changed{suffix}"
        path.write_bytes(mutated(rng, content))
        try:
            check(target, path)
        except BaseException as error:
            kept = Path(os.environ.get("WALL_FUZZ_KEEP", tmp_path)) / f"{name}.{k}{suffix}"
            kept.write_bytes(path.read_bytes())
            error.add_note(f"round {k}, {kept}")
            raise


@pytest.mark.parametrize("path", sorted(CORPUS.iterdir()), ids=lambda path: path.name)
def test_files_that_once_were_neither_read_nor_refused(path: Path, tmp_path: Path) -> None:
    target = TARGETS[path.name.split(".")[0]]
    (folder_of(target, tmp_path) / path.name).write_bytes(path.read_bytes())
    check(target, tmp_path / path.name)
