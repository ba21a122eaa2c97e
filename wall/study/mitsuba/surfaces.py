"""Objects of a scene as Mitsuba 3 takes them: meshes, materials, textures.

Diffuse surfaces, smooth glass and smooth white metal are Mitsuba's own, all else are materials.py's, which evaluate the
published formulas. With `own` Mitsuba's nearest models take their place, which differ by design: they lose the light
that goes from facet to facet, hide facets from either side by themselves, and let light to and fro below coats.

Refused: points and curves, vertex colours, textures of the roughness of glass, textures that end otherwise along u than
along v, several sets of texture coordinates.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from wall.core.colour import srgb_decoded
from wall.core.data import Float64
from wall.core.errors import RunError
from wall.scene.build import Scene
from wall.scene.model import Material, Texture
from wall.study.mitsuba.materials import SMOOTHEST
from wall.study.mitsuba.plugins import plugin


def rgb(values: tuple[float, ...]) -> dict[str, Any]:
    """A colour that is the same everywhere."""
    return {"type": "rgb", "value": [float(v) for v in values]}


def shape_of(mi: Any, scene: Scene, k: int, pose: Float64, *, own: bool) -> Any:
    """Mitsuba's shape of instance k, placed by `pose` (4, 4), world; mi : the module, its variant chosen."""
    instance = scene.instances[k]
    mesh, called = scene.meshes[instance.mesh], instance.name
    material = scene.materials[mesh.material]
    if mesh.spheres is not None:
        raise RunError(f"object {called!r}: points are not handed to Mitsuba; wanted triangles")
    if mesh.colors is not None:
        raise RunError(f"object {called!r}: vertex colours are not handed to Mitsuba")
    if mesh.uvs is None:
        textures: list[Texture | None] = [None] * 4
    else:
        textures = [None if number is None else scene.textures[number] for number in material.textures]
    if any(texture is not None and texture.uv_set > 0 for texture in textures):
        raise RunError(f"object {called!r}: has several sets of texture coordinates; wanted one, as in Mitsuba")
    properties = mi.Properties()
    properties["bsdf"] = mi.load_dict(_bsdf(mi, material, textures, called, own=own))
    if (most := max(material.absorption)) > 0.0:
        shares = rgb(tuple(part / most for part in material.absorption))
        properties["interior"] = mi.load_dict({"type": "homogeneous", "albedo": 0.0, "sigma_t": shares, "scale": most})
    if max(material.emission) > 0.0:
        radiance = _colour(mi, material.emission, textures[2], called)
        shines = plugin(mi, "wall_lamp") if material.emits_behind else {"type": "area"}
        properties["emitter"] = mi.load_dict({**shines, "radiance": radiance})
    shape = mi.Mesh(
        f"object{k}", len(mesh.vertices), len(mesh.triangles),
        has_vertex_normals=mesh.normals is not None, has_vertex_texcoords=mesh.uvs is not None, props=properties,
    )  # fmt: skip
    parameters = mi.traverse(shape)
    world = mesh.vertices.astype(np.float64) @ pose[:3, :3].T + pose[:3, 3]
    parameters["vertex_positions"] = np.ascontiguousarray(world, np.float32).ravel()
    parameters["faces"] = mesh.triangles.astype(np.uint32).ravel()
    if mesh.normals is not None:
        normals = mesh.normals @ np.linalg.inv(pose[:3, :3])
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        parameters["vertex_normals"] = np.ascontiguousarray(normals, np.float32).ravel()
    if mesh.uvs is not None:
        down = np.stack([mesh.uvs[:, 0], 1.0 - mesh.uvs[:, 1]], 1)
        parameters["vertex_texcoords"] = np.ascontiguousarray(down, np.float32).ravel()
    parameters.update()
    return shape


def _bsdf(mi: Any, material: Material, textures: list[Texture | None], called: str, *, own: bool) -> dict[str, Any]:
    """Mitsuba's material with bumps and alpha: of the shares of glass, of a mirror and of what is opaque."""
    base, rough, _, normal = textures
    through, mirror = material.transmission, (1.0 - material.transmission) * material.mirror
    parts = []
    if through > 0.0:
        glass = _sheet if material.thin else _glass
        if rough is not None:
            raise RunError(f"object {called!r}: a texture of the roughness of glass is not handed to Mitsuba")
        parts.append((through, glass(mi, material, _colour(mi, material.base_color, base, called), own=own)))
    if mirror > 0.0:
        parts.append((mirror, {"type": "conductor", "material": "none"}))
    if through + mirror < 1.0:
        parts.append((1.0 - through - mirror, _opaque(mi, material, base, rough, called, own=own)))
    if normal is not None:
        turned = (np.asarray(normal.texels / 255.0) - 0.5) * [material.normal_scale, material.normal_scale, 1.0] + 0.5
        bumps = {
            "type": "normalmap", "normalmap": _bitmap(mi, turned, normal, called),
            "use_shadowing_function": False, "flip_invalid_normals": False,
        }  # fmt: skip
        parts = [(share, {**bumps, "bsdf": part}) for share, part in parts]
    first = 1 if through > 0.0 else 0  # glass knows its sides
    parts = parts[:first] + [(share, {"type": "twosided", "bsdf": part}) for share, part in parts[first:]]
    share, found = parts[0]
    for other, part in parts[1:]:
        share += other
        found = {"type": "blendbsdf", "weight": other / share, "first": found, "second": part}
    if material.alpha_mode == "opaque":
        return found
    opacity: Any = {"type": "uniform", "value": material.alpha}
    if base is not None and base.alpha is not None:
        opacity = _bitmap(mi, np.asarray(base.alpha[..., None] * (material.alpha / 255.0)), base, called)
    if material.alpha_mode == "mask":
        opacity = plugin(mi, "wall_cutoff", values=opacity, least=material.alpha_cutoff)
    return {"type": "mask", "opacity": opacity, "bsdf": found}


def _glass(mi: Any, material: Material, color: dict[str, Any], *, own: bool) -> dict[str, Any]:
    """A body of glass; alpha of GGX is the roughness squared."""
    if own or material.roughness < SMOOTHEST:
        kind = {"type": "dielectric"} if material.roughness < SMOOTHEST else {
            "type": "roughdielectric", "distribution": "ggx", "alpha": material.roughness**2
        }  # fmt: skip
        index = {"int_ior": material.ior, "ext_ior": 1.0}
        return {**kind, **index, "specular_reflectance": color, "specular_transmittance": color}
    return plugin(mi, "wall_walk", color=color, roughness=material.roughness, ior=material.ior)


def _sheet(mi: Any, material: Material, color: dict[str, Any], *, own: bool) -> dict[str, Any]:
    """A sheet of glass; Mitsuba has no rough one."""
    if material.roughness < SMOOTHEST:
        index = {"int_ior": material.ior, "ext_ior": 1.0}
        return {"type": "thindielectric", **index, "specular_transmittance": color}
    return plugin(mi, "wall_sheet", color=color, roughness=material.roughness, ior=material.ior)


def _opaque(
    mi: Any, material: Material, base: Texture | None, rough: Texture | None, called: str, *, own: bool
) -> dict[str, Any]:
    """Diffuse light, a coat over it, metal, and what lies between them."""
    color = _colour(mi, material.base_color, base, called)
    if max(material.metallic, material.specular) == 0.0:
        return {"type": "diffuse", "reflectance": color}
    white = min(material.base_color) == 1.0 and base is None
    smooth = material.roughness < SMOOTHEST and rough is None
    if material.metallic == 1.0 and white and smooth and rough is None:
        return {"type": "conductor", "material": "none"}
    roughness, metallic = (
        {"type": "uniform", "value": factor} if rough is None
        else _bitmap(mi, np.asarray(rough.texels[..., [channel]] * (factor / 255.0)), rough, called)
        for channel, factor in ((1, material.roughness), (2, material.metallic))
    )  # fmt: skip
    if not own:
        return plugin(
            mi, "wall_opaque", base_color=color, roughness=roughness, metallic=metallic, specular=material.specular,
            ior=material.ior,
        )  # fmt: skip
    if material.metallic == 1.0 and white and rough is None:
        return {"type": "roughconductor", "distribution": "ggx", "alpha": material.roughness**2, "material": "none"}
    if material.metallic == 0.0 and material.specular == 1.0 and rough is None:
        kind = {"type": "plastic"} if smooth else {
            "type": "roughplastic", "distribution": "ggx", "alpha": material.roughness**2
        }  # fmt: skip
        return {**kind, "diffuse_reflectance": color, "int_ior": material.ior, "ext_ior": 1.0}
    edge = ((material.ior - 1.0) / (material.ior + 1.0)) ** 2
    specular = 0.5 if material.metallic == 1.0 else min(1.0, material.specular * edge / 0.08)  # of metal: any but 0
    return {
        "type": "principled", "base_color": color, "roughness": roughness, "metallic": metallic, "specular": specular
    }  # fmt: skip


def _colour(mi: Any, factor: tuple[float, ...], texture: Texture | None, called: str) -> dict[str, Any]:
    """A colour times a texture, in linear light."""
    if texture is None:
        return rgb(factor)
    return _bitmap(mi, srgb_decoded(texture.texels / 255.0) * np.array(factor), texture, called)


def _bitmap(mi: Any, values: Float64, texture: Texture, called: str) -> dict[str, Any]:
    """Values (h, w, c) looked up as a texture is."""
    if texture.wrap[0] != texture.wrap[1]:
        raise RunError(f"object {called!r}: a texture ends otherwise along u than along v, which Mitsuba does not know")
    picture = mi.Bitmap(np.ascontiguousarray(values, np.float32))
    return {"type": "bitmap", "bitmap": picture, "raw": True, "wrap_mode": texture.wrap[0], "filter_type": "bilinear"}
