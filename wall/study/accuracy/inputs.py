"""Numbers that are none in what a user gives: configurations, models, steering."""

from __future__ import annotations

import base64
import copy
import json
import math
import struct
import tempfile
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from wall.config.loading import load, loads
from wall.config.yaml_text import write
from wall.core.data import Float32
from wall.core.errors import ConfigError, RemoteProtocolError
from wall.geometry.steering import Command, Steering, parse
from wall.roles.plan import make_layout, make_plan
from wall.study.accuracy.case import Case, Found
from wall.study.accuracy.motion import START

CONFIG: dict[str, Any] = {
    "version": 1,
    "scene": {
        "source": "spheres",
        "sky": {"zenith": [0.2, 0.3, 0.5], "horizon": [0.5, 0.5, 0.5], "ground": [0.1, 0.1, 0.1]},
        "lights": [
            {"type": "directional", "direction": [1.0, 2.0, 3.0], "irradiance": [1.0, 1.0, 1.0]},
            {"type": "point", "position": [0.0, 3.0, 0.0], "intensity": [1.0, 1.0, 1.0]},
        ],
    },
    "wall": {"grid": {"columns": 1, "rows": 1, "pixels": [32, 24], "size": [0.4, 0.3], "bezel": 0.01}},
    "views": [{"camera": {"position": [0.0, 1.0, 5.0], "target": [0.0, 0.5, 0.0], "fov": 40.0}, "refresh_hz": 30.0}],
}
NO_NUMBERS = (math.nan, math.inf, -math.inf)
EXTREME = (1e-45, -1e-45, 1e300, -1e300, 5e-324)  # numbers, but hardly any field's


def configurations(most: int) -> Found:
    """Numbers of a configuration that may be NaN or infinite, or at which something else than a refusal is raised."""
    loads(write(CONFIG))  # as it is it is fine
    tries = [(path, value) for path in _numbers_in(CONFIG) for value in (*NO_NUMBERS, *EXTREME)]
    tries, wrong = tries[:: math.ceil(len(tries) / most)], []
    for path, value in tries:
        changed = copy.deepcopy(CONFIG)
        _set(changed, path, value)
        try:
            loads(write(changed))
            if not math.isfinite(value):
                wrong.append(f"{path} = {value}")
        except ConfigError:
            pass
        except Exception as error:
            wrong.append(f"{path} = {value}: {type(error).__name__}")
    return Found(figure=len(wrong), note=f"of {len(tries)} values. " + "; ".join(wrong[:5]))


def _numbers_in(value: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    if isinstance(value, dict):
        return [found for key, each in value.items() for found in _numbers_in(each, (*path, key))]
    if isinstance(value, list):
        return [found for k, each in enumerate(value) for found in _numbers_in(each, (*path, k))]
    return [path] if isinstance(value, float) else []


def _set(values: Any, path: tuple[Any, ...], value: float) -> None:
    for key in path[:-1]:
        values = values[key]
    values[path[-1]] = value


def models(most: int) -> Found:
    """Vertices of a model that are NaN, infinite, denormal or huge, and reach a scene as something not finite."""
    wrong, texts = [], ("0.5", "nan", "1e39", "inf", "-inf", "1e-45", "1e300", "-0.0")[:most]
    with tempfile.TemporaryDirectory() as folder:
        for text, (name, written) in product(texts, MODELS.items()):
            corners = [(float(text), 0.0, 0.0), *CORNERS]
            (Path(folder) / name).write_bytes(written(corners))
            changed = copy.deepcopy(CONFIG)
            changed["scene"]["source"] = name
            (Path(folder) / "wall.yaml").write_text(write(changed), encoding="utf-8")
            try:
                plan = make_plan(make_layout(load(Path(folder) / "wall.yaml")))
            except ConfigError:
                wrong += [f"{name}: {text}"] if text == "0.5" else []  # as it is it is fine
                continue
            if not all(np.isfinite(mesh.vertices).all() for mesh in plan.scene.meshes):
                wrong.append(f"{name}: {text}")
    return Found(figure=len(wrong), note=", ".join(wrong))


def _obj(corners: Corners) -> bytes:
    lines = [*(f"v {x} {y} {z}" for x, y, z in corners), *(f"f {a + 1} {b + 1} {c + 1}" for a, b, c in FACES)]
    return "\n".join(lines).encode()


def _ply(corners: Corners) -> bytes:
    head = (
        f"ply\nformat ascii 1.0\nelement vertex {len(corners)}\nproperty float x\nproperty float y\nproperty float z\n"
        f"element face {len(FACES)}\nproperty list uchar int vertex_indices\nend_header\n"
    )
    lines = [*(f"{x} {y} {z}" for x, y, z in corners), *(f"3 {a} {b} {c}" for a, b, c in FACES)]
    return (head + "\n".join(lines) + "\n").encode()


def _floats(corners: Corners) -> Float32:
    with np.errstate(over="ignore"):  # what float32 cannot hold is infinite there
        return np.array(corners, np.float64).astype(np.float32)


def _stl(corners: Corners) -> bytes:
    places = _floats(corners)
    triangles = [bytes(12) + places[list(face)].tobytes() + bytes(2) for face in FACES]
    return bytes(80) + struct.pack("<I", len(FACES)) + b"".join(triangles)


def _gltf(corners: Corners) -> bytes:
    places, faces = _floats(corners), np.array(FACES, np.uint32)
    data = places.tobytes() + faces.tobytes()
    views = [{"byteLength": places.nbytes}, {"byteOffset": places.nbytes, "byteLength": faces.nbytes}]
    accessors = [
        {"bufferView": 0, "componentType": 5126, "count": len(places), "type": "VEC3"},
        {"bufferView": 1, "componentType": 5125, "count": faces.size, "type": "SCALAR"},
    ]
    uri = "data:application/octet-stream;base64," + base64.b64encode(data).decode()
    document = {
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "accessors": accessors, "bufferViews": [{"buffer": 0, **view} for view in views],
        "buffers": [{"uri": uri, "byteLength": len(data)}],
    }  # fmt: skip
    return json.dumps(document).encode()


Corners = list[tuple[float, float, float]]
CORNERS: Corners = [(1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)]  # behind the one that is tried
FACES = ((0, 1, 2), (1, 2, 3))
MODELS = {"model.obj": _obj, "model.ply": _ply, "model.stl": _stl, "model.gltf": _gltf}


def commands(_: int) -> Found:
    """Steering commands with a number that is none and that are taken, or leave a camera that is not finite."""
    wrong = []
    for value in (*NO_NUMBERS, *EXTREME):
        for kind in ("orbit", "pan", "zoom"):
            message = {"kind": kind, "x": value} if kind == "zoom" else {"kind": kind, "x": value, "y": value}
            try:
                command: Command = parse(message)
            except RemoteProtocolError:
                continue
            camera = Steering.from_camera(START, (0.0, 0.5, 0.0)).apply(command).camera()
            if not all(map(math.isfinite, (*camera.position, *camera.world_from_wall))):
                wrong.append(f"{kind} {value}")
    return Found(figure=len(wrong), note=", ".join(wrong))


_REASON = "what is not a number is refused with the place where it stands, before the first ray"
CASES = (
    Case(
        name="not_numbers_in_configurations", family="Inputs", unit="values", bound=0.0, reason=_REASON,
        scene="NaN, infinities, denormals and 1e300 in each float of a configuration",
        measure=configurations, size=1000, small=13,
    ),
    Case(
        name="not_numbers_in_models", family="Inputs", unit="values", bound=0.0,
        reason="a vertex that is not finite leaves with its triangles, or the file is refused",
        scene="NaN, infinities, denormals and 1e300 as a vertex of OBJ, PLY, STL and glTF files", measure=models,
        size=8, small=2,
    ),
    Case(
        name="not_numbers_in_commands", family="Inputs", unit="commands", bound=0.0,
        reason="commands come from pages, so each number has a range",
        scene="The same as drags and zooms of a page", measure=commands, size=1, small=1,
    ),
)  # fmt: skip
