"""A scene and its view as Mitsuba 3 takes them: one shape an object, materials in Mitsuba's models, the same lights.

What has no equal there is made by plugins, materials.py and lights.py, or refused with RunError: see surfaces.py.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from wall.core.errors import RunError
from wall.roles.plan import Plan
from wall.scene.kernels.environment import look_up
from wall.scene.model import Environment
from wall.study.mitsuba.plugins import plugin
from wall.study.mitsuba.surfaces import rgb, shape_of

SKY_ROWS = 512  # of the picture of the sky
ENVIRONMENT_ROWS = 1024  # of the picture of an environment, about; more where it has more


def describe(mi: Any, plan: Plan, *, spp: int, own: bool = False) -> dict[str, Any]:
    """Mitsuba's dictionary of a one-panel wall's scene at time 0. Raises RunError for what Mitsuba cannot show.

    mi : the module, its variant chosen; own : materials are Mitsuba's own, see surfaces.py
    """
    scene, depth = plan.scene, plan.scene.path_depth
    if depth is None or scene.occlusion is not None:
        raise RunError(
            "scene.integrator: direct light and ambient occlusion have no equal in Mitsuba; wanted {method: path}"
        )
    if any(cut.enabled for cut in scene.shading(0.0).cuts):
        raise RunError("scene.cuts: Mitsuba cuts nothing open; wanted none that is enabled")
    moment, method = scene.at(0.0), "path"
    if any(material.alpha_mode != "opaque" for material in scene.materials):  # light for `path` stops there
        method = "volpath"
    if any(max(material.absorption) > 0.0 for material in scene.materials):
        method = "volpathmis"  # `volpath` finds NaN in glass that absorbs one colour more than another
    found: dict[str, Any] = {
        "type": "scene",
        "integrator": {"type": method, "max_depth": depth + 1, "rr_depth": 1000},
        "sensor": sensor(mi, plan, spp=spp),
        "sky": _sky(mi, plan) if scene.environment is None else _environment(mi, scene.environment),
    }
    for k, (light, position) in enumerate(zip(scene.point_lights, moment.point_positions, strict=True)):
        found[f"point{k}"] = {"type": "point", "position": position.tolist(), "intensity": rgb(light.intensity)}
    for k, (sun, direction) in enumerate(zip(scene.directional_lights, moment.directions, strict=True)):
        found[f"sun{k}"] = {
            "type": "directional", "direction": (-direction).tolist(), "irradiance": rgb(sun.irradiance)
        }  # fmt: skip
        if sun.angular_diameter > 0.0:
            found[f"sun{k}"] = plugin(
                mi, "wall_sun", direction=direction.tolist(), irradiance=mi.ScalarColor3f(sun.irradiance),
                angle=np.radians(0.5 * sun.angular_diameter), reach=1e3 * scene.radius,
            )  # fmt: skip
    for k, (spot, position) in enumerate(zip(scene.spot_lights, moment.spot_positions, strict=True)):
        scale, offset = spot.falloff
        found[f"spot{k}"] = plugin(
            mi, "wall_spot", position=position.tolist(), direction=list(spot.direction),
            intensity=mi.ScalarColor3f(spot.intensity), scale=scale, offset=offset,
        )  # fmt: skip
    for k in range(len(scene.instances)):
        found[f"object{k}"] = shape_of(mi, scene, k, moment.world_from_object[k], own=own)
    return found


def sensor(mi: Any, plan: Plan, *, spp: int) -> dict[str, Any]:
    """Mitsuba's camera of a one-panel wall at time 0. Raises RunError for what its camera cannot do."""
    panels, camera = plan.layout.wall.panels, plan.view.camera_at(0.0)
    if len(panels) != 1:
        raise RunError(f"wall: has {len(panels)} panels, wanted one: Mitsuba has one image")
    panel, eye = panels[0], plan.view.eye
    if max(abs(float(eye[0])), abs(float(eye[1]))) > 1e-9:
        raise RunError(f"views[0].eye: {eye.tolist()} is not before the middle of the panel, as Mitsuba's camera is")
    height = panel.pixels[1] * float(np.linalg.norm(panel.plane.per_y))
    origin, rotation = camera.origin(), camera.rotation()
    view = mi.ScalarTransform4f().look_at(
        origin.tolist(), (origin - rotation[:, 2]).tolist(), rotation[:, 1].tolist()
    )  # fmt: skip
    fov = float(2 * np.degrees(np.arctan2(height / 2, abs(float(eye[2])))))
    lens = plan.scene.shading(0.0).lens
    kind = {"type": "perspective"} if lens is None else {
        "type": "thinlens", "aperture_radius": lens.radius, "focus_distance": lens.focus
    }  # fmt: skip
    return {
        **kind, "fov": fov, "fov_axis": "y",
        "to_world": view, "near_clip": 1e-3 * plan.scene.radius, "far_clip": 1e4 * plan.scene.radius,
        "film": {
            "type": "hdrfilm", "width": panel.pixels[0], "height": panel.pixels[1], "rfilter": {"type": "box"},
            "pixel_format": "rgb", "component_format": "float32",
        },
        "sampler": {"type": "independent", "sample_count": spp},
    }  # fmt: skip


def _sky(mi: Any, plan: Plan) -> dict[str, Any]:
    """The gradient as a picture of all directions."""
    sky = plan.scene.sky
    y = np.cos(np.linspace(0.0, np.pi, SKY_ROWS))[:, None]  # its first and last rows are the poles
    horizon = np.array(sky.horizon)
    up, down = np.maximum(y, 0.0), np.maximum(-y, 0.0)
    rows = horizon + up * (np.array(sky.zenith) - horizon) + down * (np.array(sky.ground) - horizon)
    picture = np.repeat(rows[:, None], 8, axis=1).astype(np.float32)
    return {"type": "envmap", "bitmap": mi.Bitmap(picture)}


def _environment(mi: Any, environment: Environment) -> dict[str, Any]:
    """The bilinear image as a finer one: Mitsuba's rows reach from pole to pole, its columns start at -z."""
    times = max(1, ENVIRONMENT_ROWS // len(environment.texels))
    height, width = (size * times for size in environment.texels.shape[:2])
    polar, turn = np.linspace(0.0, np.pi, height + 1)[:, None], (np.arange(width) + 0.5) * (2.0 * np.pi / width)
    sine, up = np.sin(polar), np.broadcast_to(np.cos(polar), (height + 1, width))
    ways = np.stack([sine * np.sin(turn), up, -sine * np.cos(turn)], axis=-1).astype(np.float32)
    picture = np.empty_like(ways)
    look_up(environment.texels, environment.middle, ways.reshape(-1, 3), picture.reshape(-1, 3))
    return {"type": "envmap", "bitmap": mi.Bitmap(picture)}
