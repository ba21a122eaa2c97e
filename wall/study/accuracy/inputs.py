"""Numbers that are none in what a user gives: configurations, models, steering."""

from __future__ import annotations

import copy
import math
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from wall.config.loading import load, loads
from wall.config.yaml_text import write
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
    wrong = []
    with tempfile.TemporaryDirectory() as folder:
        for value in ("0.5", "nan", "1e39", "inf", "-inf", "1e-45", "1e300", "-0.0")[:most]:
            (Path(folder) / "model.obj").write_text(
                f"v {value} 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\nf 2 3 4\n", encoding="utf-8"
            )
            changed = copy.deepcopy(CONFIG)
            changed["scene"]["source"] = "model.obj"
            (Path(folder) / "wall.yaml").write_text(write(changed), encoding="utf-8")
            try:
                plan = make_plan(make_layout(load(Path(folder) / "wall.yaml")))
            except ConfigError:
                wrong += [value] if value == "0.5" else []  # as it is it is fine
                continue
            if not all(np.isfinite(mesh.vertices).all() for mesh in plan.scene.meshes):
                wrong.append(value)
    return Found(figure=len(wrong), note=", ".join(wrong))


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
        scene="NaN, infinities, denormals and 1e300 as a vertex of an OBJ file", measure=models, size=8, small=2,
    ),
    Case(
        name="not_numbers_in_commands", family="Inputs", unit="commands", bound=0.0,
        reason="commands come from pages, so each number has a range",
        scene="The same as drags and zooms of a page", measure=commands, size=1, small=1,
    ),
)  # fmt: skip
