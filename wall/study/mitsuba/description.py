"""A scene and its view as Mitsuba 3 takes them: one shape an object, materials in Mitsuba's models, the same lights.

What has no equal there is refused: a coat over diffuse light, metal whose reflectance grows at grazing angles and is
not white, coloured glass, surfaces that emit on both sides, textures, spots, suns with an angular diameter. Rough white
metal differs by the light that goes from facet to facet, which Mitsuba's loses.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from wall.core.errors import RunError
from wall.roles.plan import Plan
from wall.scene.kernels.environment import look_up
from wall.scene.model import Environment, Material, Mesh
from wall.tracing.kernels.ggx import FLATTEST_ROUGHNESS

SKY_ROWS = 512  # of the picture of the sky
ENVIRONMENT_ROWS = 1024  # of the picture of an environment, about; more where it has more


def describe(mi: Any, plan: Plan, *, spp: int) -> dict[str, Any]:
    """Mitsuba's dictionary of a one-panel wall's scene at time 0. Raises RunError for what Mitsuba cannot show.

    mi : the module, its variant chosen
    """
    scene, depth = plan.scene, plan.scene.path_depth
    if depth is None:
        raise RunError("scene.integrator: direct light has no equal in Mitsuba; wanted {method: path}")
    if scene.spot_lights:
        raise RunError("scene.lights: Mitsuba's spots fade otherwise than glTF's; wanted points, directions, surfaces")
    if any(light.angular_diameter > 0.0 for light in scene.directional_lights):
        raise RunError("scene.lights: Mitsuba's directions have no angular diameter; wanted 0")
    moment = scene.at(0.0)
    found: dict[str, Any] = {
        "type": "scene",
        "integrator": {"type": "path", "max_depth": depth + 1, "rr_depth": 1000},
        "sensor": sensor(mi, plan, spp=spp),
        "sky": _sky(mi, plan) if scene.environment is None else _environment(mi, scene.environment),
    }
    for k, (light, position) in enumerate(zip(scene.point_lights, moment.point_positions, strict=True)):
        found[f"point{k}"] = {"type": "point", "position": position.tolist(), "intensity": _rgb(light.intensity)}
    for k, (sun, direction) in enumerate(zip(scene.directional_lights, moment.directions, strict=True)):
        found[f"sun{k}"] = {
            "type": "directional", "direction": (-direction).tolist(), "irradiance": _rgb(sun.irradiance)
        }  # fmt: skip
    for k, instance in enumerate(scene.instances):
        mesh = scene.meshes[instance.mesh]
        material = scene.materials[mesh.material]
        found[f"object{k}"] = _shape(mi, f"object{k}", mesh, moment.world_from_object[k], material, instance.name)
    return found


def _rgb(values: tuple[float, ...]) -> dict[str, Any]:
    return {"type": "rgb", "value": [float(v) for v in values]}


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
    return {
        "type": "perspective", "fov": fov, "fov_axis": "y",
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
    y = np.cos((np.arange(SKY_ROWS) + 0.5) / SKY_ROWS * np.pi)[:, None]
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


def _shape(mi: Any, name: str, mesh: Mesh, pose: Any, material: Material, called: str) -> Any:
    if material.texture is not None or mesh.colors is not None:
        raise RunError(f"object {called!r}: textures and vertex colours are not handed to Mitsuba")
    properties = mi.Properties()
    properties["bsdf"] = mi.load_dict(_bsdf(material, called))
    if max(material.emission) > 0.0:
        if material.emits_behind:
            raise RunError(f"object {called!r}: emits on both sides; wanted sides: front, as Mitsuba's surfaces do")
        properties["emitter"] = mi.load_dict({"type": "area", "radiance": _rgb(material.emission)})
    shape = mi.Mesh(
        name, len(mesh.vertices), len(mesh.triangles), has_vertex_normals=mesh.normals is not None, props=properties
    )
    parameters = mi.traverse(shape)
    world = mesh.vertices.astype(np.float64) @ pose[:3, :3].T + pose[:3, 3]
    parameters["vertex_positions"] = np.ascontiguousarray(world, np.float32).ravel()
    parameters["faces"] = mesh.triangles.astype(np.uint32).ravel()
    if mesh.normals is not None:
        normals = mesh.normals @ np.linalg.inv(pose[:3, :3])
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        parameters["vertex_normals"] = np.ascontiguousarray(normals, np.float32).ravel()
    parameters.update()
    return shape


def _bsdf(material: Material, called: str) -> dict[str, Any]:
    """Mitsuba's material; alpha of GGX is the roughness squared."""
    smooth, alpha = material.roughness < float(FLATTEST_ROUGHNESS), material.roughness**2
    if material.transmission == 1.0 and min(material.base_color) == 1.0:
        index = {"int_ior": material.ior, "ext_ior": 1.0}
        if smooth:
            return {"type": "dielectric", **index}
        return {"type": "roughdielectric", "distribution": "ggx", "alpha": alpha, **index}
    if material.mirror == 1.0:
        return {"type": "twosided", "bsdf": {"type": "conductor", "material": "none"}}
    if material.metallic == 1.0 and min(material.base_color) == 1.0:
        kind = {"type": "conductor"} if smooth else {"type": "roughconductor", "distribution": "ggx", "alpha": alpha}
        return {"type": "twosided", "bsdf": {**kind, "material": "none"}}
    if max(material.metallic, material.specular, material.mirror, material.transmission) > 0.0:
        raise RunError(f"object {called!r}: has no equal in Mitsuba; wanted diffuse, white metal, glass, or a mirror")
    return {"type": "twosided", "bsdf": {"type": "diffuse", "reflectance": _rgb(material.base_color)}}
