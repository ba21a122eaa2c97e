"""Nodes of a glTF file that place their mesh many times. Extension EXT_mesh_gpu_instancing."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from wall.core.data import Float64
from wall.scene.gltf import INSTANCING, pose_of
from wall.scene.gltf_accessors import Accessors
from wall.scene.gltf_animation import PATHS, node_numbers


def instance_poses(path: Path, header: dict[str, Any]) -> dict[str, Float64]:
    """(n, 4, 4) poses of the instances within their node, by its name as trimesh has it; nodes that place one: absent.

    Raises what Accessors raise, and ValueError for attributes of different lengths.
    """
    accessors, found = Accessors(path, header), dict[str, Float64]()
    for name, number in node_numbers(header).items():
        given = header["nodes"][number].get("extensions", {}).get(INSTANCING, {}).get("attributes", {})
        columns = {kind: accessors.values(given[kind.upper()]) for kind in PATHS if kind.upper() in given}
        if not columns:
            continue
        if len(counts := {len(rows) for rows in columns.values()}) > 1:
            raise ValueError(f"the instances of node {name!r} have {sorted(counts)} values, wanted one each")
        if "rotation" in columns:  # of integers they are not quite of unit length
            with np.errstate(invalid="ignore", divide="ignore"):  # what is no rotation gives no finite placement
                columns["rotation"] /= np.linalg.norm(columns["rotation"], axis=1, keepdims=True)
        rows = zip(*(values.tolist() for values in columns.values()), strict=True)
        found[name] = np.array([pose_of(dict(zip(columns, row, strict=True))) for row in rows]).reshape(-1, 4, 4)
    return found
