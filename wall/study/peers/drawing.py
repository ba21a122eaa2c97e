"""A scene as every renderer of the comparison draws it: triangles whose corners have a colour, and no light.

The light on a diffuse surface under one directional light and an even one from everywhere is the same from wherever it
is seen. So it is worked out here, once, and all that is left for renderers is to find which triangle a pixel shows:
the same work for rasterisers and ray tracers, in which no two of them could differ by how they shade.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from wall.config.loading import Loaded
from wall.config.scene import SceneConfig, SkyConfig
from wall.config.views import CameraConfig, OrbitPathConfig, ViewConfig
from wall.core.colour import srgb_codes
from wall.core.data import Float32, Float64
from wall.core.errors import RunError
from wall.display.files import replaced
from wall.geometry.cameras import View
from wall.roles.plan import make_layout, make_plan
from wall.scene.build import Scene
from wall.scene.model import Mesh
from wall.scene.normals import face_normals
from wall.study.live.rewriting import ORBIT_PERIOD_S
from wall.study.quality.trial import on_one_panel

FILE = "triangles.ply"
TOWARDS_LIGHT = np.array([0.48, 0.64, 0.6])  # unit
DIRECT, AMBIENT = 0.75, 0.25  # radiance of a white surface that faces the light, and of one in its own shadow
WHITE = (1.0, 1.0, 1.0)  # of the sky: it is seen as this, and gives a surface its colour
CORNER = np.dtype([("position", "<f4", 3), ("color", "u1", 3)])
TRIANGLE = np.dtype([("count", "u1"), ("corners", "<i4", 3)])

Codes: TypeAlias = NDArray[np.uint8]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Triangles:
    """All that is drawn."""

    positions: Float32  # (v, 3) world
    corners: NDArray[np.int32]  # (t, 3)
    codes: Codes  # (v, 3) sRGB, between corners in straight lines

    def write(self, path: Path) -> None:
        """A binary PLY file."""
        vertices, faces = np.empty(len(self.positions), CORNER), np.empty(len(self.corners), TRIANGLE)
        vertices["position"], vertices["color"] = self.positions, self.codes
        faces["count"], faces["corners"] = 3, self.corners
        lines = ["ply", "format binary_little_endian 1.0", f"element vertex {len(vertices)}"]
        lines += [f"property float {axis}" for axis in "xyz"]
        lines += [f"property uchar {color}" for color in ("red", "green", "blue")]
        lines += [f"element face {len(faces)}", "property list uchar int vertex_indices", "end_header", ""]
        with replaced(path) as part:
            part.write_bytes("\n".join(lines).encode("ascii") + vertices.tobytes() + faces.tobytes())


def triangles_of(scene: Scene) -> Triangles:
    """All objects where they are at time 0, in their base colours; textures count as white.

    Raises RunError where something is no triangle mesh.
    """
    poses = scene.at(0.0).world_from_object
    parts, first = [], 0
    for k, instance in enumerate(scene.instances):
        mesh = scene.meshes[instance.mesh]
        if mesh.spheres is not None:
            raise RunError(f"object {instance.name!r}: points are not drawn by every renderer; wanted triangles")
        base = np.array(scene.materials[mesh.material].base_color)
        positions, corners, codes = _lit(mesh, base, poses[k])
        parts.append((positions, corners + first, codes))
        first += len(positions)
    positions, corners, codes = (np.concatenate(part) for part in zip(*parts, strict=True))
    return Triangles(positions=positions.astype(np.float32), corners=corners.astype(np.int32), codes=codes)


def _lit(mesh: Mesh, base: Float64, pose: Float64) -> tuple[Float64, NDArray[np.int64], Codes]:
    """Positions (v, 3), corners (t, 3) and colours (v, 3) of a mesh: flat ones get three corners a triangle."""
    positions = mesh.vertices.astype(np.float64) @ pose[:3, :3].T + pose[:3, 3]
    corners = mesh.triangles.astype(np.int64)
    colors = base * np.ones((len(positions), 3)) if mesh.colors is None else base * mesh.colors
    if mesh.normals is None:
        normals = np.repeat(face_normals(positions, corners), 3, axis=0)
        positions, colors = positions[corners.ravel()], colors[corners.ravel()]
        corners = np.arange(len(positions)).reshape(-1, 3)
    else:
        normals = mesh.normals @ np.linalg.inv(pose[:3, :3])
    length = np.linalg.norm(normals, axis=1)
    facing = np.maximum(normals @ TOWARDS_LIGHT, 0.0) / np.where(length > 0.0, length, 1.0)
    return positions, corners, srgb_codes(colors * (AMBIENT + DIRECT * facing)[:, None])


def drawn(loaded: Loaded, size: tuple[int, int], folder: Path) -> tuple[Loaded, Triangles]:
    """Write the triangles of a configuration's scene into `folder`, and return a configuration that shows them.

    That has one panel of `size` pixels and the camera of the first view, which circles if it has no path of its own.
    Raises ConfigError, RunError.
    """
    one = on_one_panel(loaded, size)
    plan = make_plan(make_layout(one))
    triangles = triangles_of(plan.scene)
    triangles.write(folder / FILE)
    config, view = one.config, loaded.config.views[0]
    scene = SceneConfig(
        source=str((folder / FILE).absolute()), up="y", lights=(), animation=(),
        sky=SkyConfig(zenith=WHITE, horizon=WHITE, ground=WHITE),
    )  # fmt: skip
    path = view.path or OrbitPathConfig(type="orbit", period_s=ORBIT_PERIOD_S)
    shown = ViewConfig(camera=_camera(plan.view), path=path, refresh_hz=view.refresh_hz)
    return one.with_config(config.model_copy(update={"scene": scene, "views": (shown,)})), triangles


def at_rest(loaded: Loaded, time: float) -> Loaded:
    """A configuration of `drawn` whose camera stays where it is at `time`, seconds of its path."""
    view = make_plan(make_layout(loaded)).view
    camera, config = view.camera_at(time), loaded.config
    ahead = (camera.origin() - camera.rotation()[:, 2]).tolist()
    still = config.views[0].camera.model_copy(
        update={"position": tuple(camera.origin().tolist()), "target": tuple(ahead), "up": _up(camera.rotation())}
    )
    shown = config.views[0].model_copy(update={"camera": still, "path": None})
    return loaded.with_config(config.model_copy(update={"views": (shown,)}))


def fov_of(view: View) -> float:
    """Degrees that the wall spans from top to bottom."""
    return math.degrees(2.0 * math.atan(view.spread / 2.0))


def _camera(view: View) -> CameraConfig:
    position, target = (tuple(point.tolist()) for point in (view.still.origin(), view.target))
    return CameraConfig(position=position, target=target, up=tuple(view.up.tolist()), fov=fov_of(view))


def _up(rotation: Float64) -> tuple[float, ...]:
    return tuple(rotation[:, 1].tolist())
