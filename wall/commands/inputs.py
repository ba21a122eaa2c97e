"""What commands and scripts are given to show: a configuration, a model file, or the name of a built-in scene."""

from __future__ import annotations

import copy
from pathlib import Path
from typing import Any

from wall.config.loading import Loaded, default_for_model, load, load_values, nearest
from wall.core.errors import ConfigError
from wall.scene.loader_process import MODEL_SUFFIXES
from wall.scene.sources import BUILT_IN, is_built_in

EXAMPLES = Path(__file__).resolve().parents[1] / "configs"  # those of the clone, which are packaged too
DEMO = EXAMPLES / "demo.yaml"
DATA_SUFFIXES = (".vti", ".vtp", ".vtu", ".vtk", ".csv", ".npy", ".npz", ".mhd")
OTHER_MODELS = (
    *(".3dm", ".3ds", ".3mf", ".abc", ".blend", ".c4d", ".dae", ".dxf", ".e57", ".fbx", ".iges", ".igs", ".las"),
    *(".laz", ".lwo", ".max", ".off", ".pcd", ".pts", ".skp", ".step", ".stp", ".usd", ".usda", ".usdc", ".usdz"),
    *(".vrml", ".wrl", ".x3d", ".xyz"),
)

# of built-in scenes: from where they were made to be seen; position, target, degrees
CAMERAS = {
    "arcade": ((0.0, 1.64, 8.2), (0.3, 1.35, 3.2), 55.0),
    "cornell": ((2.78, 2.73, -8.0), (2.78, 2.73, 0.0), 39.3),
    "courtyard": ((7.4, 3.6, 9.4), (0.0, 0.9, 0.0), 38.0),
    "forest": ((20.0, 13.0, 30.0), (0.0, 2.0, 0.0), 32.0),
    "gallery": ((2.599, 3.0, 7.142), (0.0, 0.6, -0.3), 45.0),
    "gallery_mirrors": ((2.599, 3.0, 7.142), (0.0, 0.6, -0.3), 45.0),
    "museum": ((1.1, 1.55, 5.0), (-0.3, 1.4, -1.0), 44.0),
    "spheres": ((0.0, 2.2, 7.5), (0.0, 0.9, 0.0), 36.0),
}


def load_any(what: str | Path) -> Loaded:
    """A configuration; or the default one around a model, or around a built-in scene. Raises ConfigError."""
    path = Path(what)
    if is_built_in(what):
        return _of_built_in(str(what))
    if path.suffix.lower() in MODEL_SUFFIXES:
        return default_for_model(path)
    if not path.suffix and path.name == str(what) and not path.exists():
        near = nearest(str(what), BUILT_IN)
        accepted = f"a configuration, a model file, or one of {', '.join(BUILT_IN)}"
        raise ConfigError(f"{what}: no such file, nor a built-in scene; accepted: {accepted}{near}")
    if path.suffix.lower() in DATA_SUFFIXES and path.is_file():
        raise ConfigError(
            f"{what}: is data, and no model or configuration; wanted a configuration with "
            f"scene: {{data: [{{type: points, file: {path.name}}}]}}, or another type: docs/guide/data.md"
        )
    if path.suffix.lower() in OTHER_MODELS:
        raise ConfigError(f"{what}: is no kind of model that is read; those are {', '.join(MODEL_SUFFIXES)}")
    return load(path)


def _of_built_in(name: str) -> Loaded:
    """The wall of models around a built-in scene, seen from where it was made to be seen, by a camera that stands."""
    values: dict[str, Any] = copy.deepcopy(default_for_model(name).document.values)
    position, target, fov = CAMERAS[name]
    values["views"][0]["camera"] = {"position": list(position), "target": list(target), "fov": fov}
    del values["views"][0]["path"]
    return load_values(values, name=name, path=Path(name))
