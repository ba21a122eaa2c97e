"""Objects of a scene as Mitsuba 3 takes them: meshes, materials in its own models, textures.

What has no equal there is refused: a coat over diffuse light, metal whose reflectance grows at grazing angles and is
not white, coloured glass that is not thin, rough thin glass, surfaces that emit on both sides, textures of roughness
and metalness, masks by a texture, textures that end otherwise along u than along v, several sets of texture
coordinates, vertex colours. Rough white metal differs by the light that goes from facet to facet, which Mitsuba's
loses.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from wall.core.colour import srgb_decoded
from wall.core.data import Float64
from wall.core.errors import RunError
from wall.scene.build import Scene
from wall.scene.model import Material, Texture
from wall.tracing.kernels.ggx import FLATTEST_ROUGHNESS


def rgb(values: tuple[float, ...]) -> dict[str, Any]:
    """A colour that is the same everywhere."""
    return {"type": "rgb", "value": [float(v) for v in values]}


def shape_of(mi: Any, scene: Scene, k: int, pose: Float64) -> Any:
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
    properties["bsdf"] = mi.load_dict(_bsdf(mi, material, textures, called))
    if (most := max(material.absorption)) > 0.0:
        shares = rgb(tuple(part / most for part in material.absorption))
        properties["interior"] = mi.load_dict({"type": "homogeneous", "albedo": 0.0, "sigma_t": shares, "scale": most})
    if max(material.emission) > 0.0:
        if material.emits_behind:
            raise RunError(f"object {called!r}: emits on both sides; wanted sides: front, as Mitsuba's surfaces do")
        radiance = _colour(mi, material.emission, textures[2], called)
        properties["emitter"] = mi.load_dict({"type": "area", "radiance": radiance})
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


def _bsdf(mi: Any, material: Material, textures: list[Texture | None], called: str) -> dict[str, Any]:
    """Mitsuba's material with bumps and alpha."""
    base, rough, _, normal = textures
    if rough is not None:
        raise RunError(f"object {called!r}: a texture of roughness and metalness has no equal in Mitsuba")
    found = _plain_bsdf(mi, material, base, called)
    if normal is not None:
        turned = (np.asarray(normal.texels / 255.0) - 0.5) * [material.normal_scale, material.normal_scale, 1.0] + 0.5
        found = {
            "type": "normalmap", "normalmap": _bitmap(mi, turned, normal, called), "bsdf": found,
            "use_shadowing_function": False, "flip_invalid_normals": False,
        }  # fmt: skip
    if found["type"] not in ("dielectric", "roughdielectric", "thindielectric"):
        found = {"type": "twosided", "bsdf": found}
    if material.alpha_mode == "mask":
        raise RunError(f"object {called!r}: is cut out by a mask, which has no equal in Mitsuba; wanted blend")
    if material.alpha_mode == "blend":
        opacity: Any = material.alpha
        if base is not None and base.alpha is not None:
            opacity = _bitmap(mi, np.asarray(base.alpha[..., None] * (material.alpha / 255.0)), base, called)
        found = {"type": "mask", "opacity": opacity, "bsdf": found}
    return found


def _plain_bsdf(mi: Any, material: Material, base: Texture | None, called: str) -> dict[str, Any]:
    """Mitsuba's material; alpha of GGX is the roughness squared."""
    smooth, alpha = material.roughness < float(FLATTEST_ROUGHNESS), material.roughness**2
    white = min(material.base_color) == 1.0 and base is None
    index = {"int_ior": material.ior, "ext_ior": 1.0}
    if material.transmission == 1.0 and material.thin and smooth:
        left = _colour(mi, material.base_color, base, called)
        return {"type": "thindielectric", **index, "specular_transmittance": left}
    if material.transmission == 1.0 and white and not material.thin:
        if smooth:
            return {"type": "dielectric", **index}
        return {"type": "roughdielectric", "distribution": "ggx", "alpha": alpha, **index}
    if material.mirror == 1.0:
        return {"type": "conductor", "material": "none"}
    if material.metallic == 1.0 and white:
        kind = {"type": "conductor"} if smooth else {"type": "roughconductor", "distribution": "ggx", "alpha": alpha}
        return {**kind, "material": "none"}
    if max(material.metallic, material.specular, material.mirror, material.transmission) > 0.0:
        raise RunError(f"object {called!r}: has no equal in Mitsuba; wanted diffuse, white metal, glass, or a mirror")
    return {"type": "diffuse", "reflectance": _colour(mi, material.base_color, base, called)}


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
