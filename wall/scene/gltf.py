"""What trimesh leaves out of a glTF file: scalars of materials with their extensions, and lights.

trimesh reads geometry, instances and textures. It gives a material its name alone to be known by, which need not be
unique; so each gets its number as name before trimesh sees the file. It keeps one set of texture coordinates, and
vertex attributes whose names begin with `_`; so each set gets such a name too, as do positions and normals that are
normalized integers, which trimesh takes for what they are. glTF 2.0 specification, 3.6.2; extensions
KHR_lights_punctual, KHR_materials_emissive_strength, _ior, _specular, _transmission, _unlit, _volume;
KHR_mesh_quantization; KHR_texture_transform.
"""

from __future__ import annotations

import json
import math
import struct
from collections.abc import Iterator
from dataclasses import replace
from graphlib import CycleError, TopologicalSorter
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from wall.core.data import Float64
from wall.core.fields import LARGEST_IOR
from wall.core.files import read_file
from wall.geometry.lens import NamedCamera
from wall.scene.animation import Vector
from wall.scene.lights import unit
from wall.scene.model import AlphaMode, DirectionalLight, Light, Material, PointLight, SpotLight, Wrap

KEPT = "_"  # names of vertex attributes that trimesh keeps begin with it
NORMALIZED = "_NORMALIZED"  # and those of integers that stand for 0..1, or -1..1, end with it
INSTANCING = "EXT_mesh_gpu_instancing"
MOST_BYTES = 1 << 32  # of a model, or a file beside it
SMALLEST_CONE = 0.1  # degrees, of a spot whose angles make no cone
MAGIC, JSON_CHUNK, BINARY_CHUNK = b"glTF", 0x4E4F534A, 0x004E4942
HEADER, CHUNK = struct.Struct("<4sII"), struct.Struct("<II")
MALFORMED = ArithmeticError, AttributeError, IndexError, KeyError, TypeError, ValueError  # that wrong JSON raises
KNOWN = {
    "KHR_lights_punctual", "KHR_materials_emissive_strength", "KHR_materials_ior", "KHR_materials_specular",
    "KHR_materials_pbrSpecularGlossiness", "KHR_materials_transmission", "KHR_materials_unlit", "KHR_materials_volume",
    "KHR_texture_transform", "KHR_draco_mesh_compression", "EXT_texture_webp", "KHR_texture_basisu",
    "KHR_mesh_quantization", INSTANCING,
}  # fmt: skip
WRAPS: dict[int, Wrap] = {10497: "repeat", 33071: "clamp", 33648: "mirror"}  # OpenGL's numbers
IDENTITY = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0)
ALPHA_MODES: dict[str, AlphaMode] = {"OPAQUE": "opaque", "MASK": "mask", "BLEND": "blend"}


def renamed(path: Path) -> tuple[bytes, dict[str, Any]]:
    """A .glb or .gltf file whose materials are named by their numbers, and its JSON as it was.

    Raises ValueError, or what a parser raises, for what is no such file.
    """
    data = read_file(path, MOST_BYTES)
    if path.suffix.lower() == ".gltf":
        header = json.loads(data.decode("utf-8-sig"))
        return json.dumps(_numbered(header)).encode(), header
    magic, version, _ = HEADER.unpack_from(data)
    length, kind = CHUNK.unpack_from(data, HEADER.size)
    start = HEADER.size + CHUNK.size
    if magic != MAGIC or kind != JSON_CHUNK:
        raise ValueError("it is no binary glTF: it does not begin with a chunk of JSON")
    header = json.loads(data[start : start + length].decode("utf-8"))
    text = json.dumps(_numbered(header)).encode()
    text += b" " * (-len(text) % 4)
    rest = data[start + length :]
    size = HEADER.size + CHUNK.size + len(text) + len(rest)
    return HEADER.pack(MAGIC, version, size) + CHUNK.pack(len(text), JSON_CHUNK) + text + rest, header


def check_read(header: dict[str, Any]) -> None:
    """Raise ValueError for what would give wrong shapes: sparse accessors of meshes, instances and animations, and for
    nodes that are below themselves.

    Accessors of morph targets are not read, whatever they are.
    """
    below = {k: node.get("children", []) for k, node in enumerate(header.get("nodes", []))}
    try:
        TopologicalSorter(below).prepare()
    except CycleError as error:
        circle = sorted(set(error.args[1]))
        raise ValueError(f"its nodes {circle} are children of each other in a circle") from None
    primitives = [primitive for mesh in header.get("meshes", []) for primitive in mesh["primitives"]]
    used = {number for primitive in primitives for number in primitive["attributes"].values()}
    used |= {primitive["indices"] for primitive in primitives if "indices" in primitive}
    extensions = [node.get("extensions", {}).get(INSTANCING, {}) for node in header.get("nodes", [])]
    used |= {number for extension in extensions for number in extension.get("attributes", {}).values()}
    samplers = [sampler for animation in header.get("animations", []) for sampler in animation["samplers"]]
    used |= {sampler[end] for sampler in samplers for end in ("input", "output")}
    if sparse := [k for k in sorted(used) if "sparse" in header["accessors"][k]]:
        raise ValueError(f"its accessors {sparse} are sparse, wanted a file with all of their values")


def _numbered(header: dict[str, Any]) -> dict[str, Any]:
    accessors = header.get("accessors", [])
    materials = [{**material, "name": str(k)} for k, material in enumerate(header.get("materials", []))]
    meshes = [
        {**mesh, "primitives": [_with_kept(primitive, accessors) for primitive in mesh["primitives"]]}
        for mesh in header.get("meshes", [])
    ]
    return {**header, "meshes": meshes} | ({"materials": materials} if materials else {})


def _with_kept(primitive: dict[str, Any], accessors: list[dict[str, Any]]) -> dict[str, Any]:
    """A primitive that has its texture coordinates, and positions and normals that are normalized integers, once more
    under names that trimesh keeps."""
    given, kept = primitive["attributes"], {}
    for name, number in given.items():
        normalized = bool(accessors[number].get("normalized", False))
        if name.startswith("TEXCOORD_") or (normalized and name in ("POSITION", "NORMAL")):
            kept[f"{KEPT}{name}{NORMALIZED if normalized else ''}"] = number
    return {**primitive, "attributes": {**given, **kept}}


def completed(material: Material, header: dict[str, Any], number: int) -> Material:
    """A material with the scalars that the file gives it."""
    found = header["materials"][number]
    surface, extensions = found.get("pbrMetallicRoughness", {}), found.get("extensions", {})

    def of(extension: str, name: str, default: float) -> float:
        return _finite(extensions.get(f"KHR_materials_{extension}", {}).get(name, default))

    strength = of("emissive_strength", "emissiveStrength", 1.0)
    left = [_share(c) for c in extensions.get("KHR_materials_volume", {}).get("attenuationColor", (1.0, 1.0, 1.0))]
    distance = of("volume", "attenuationDistance", 0.0)
    r, g, b = material.emission
    old = extensions.get("KHR_materials_pbrSpecularGlossiness")
    if old is not None:  # trimesh has turned its colours into base colour
        surface = {"metallicFactor": 0.0, "roughnessFactor": 1.0 - _share(old.get("glossinessFactor", 1.0))}
        surface["baseColorFactor"] = [*material.base_color, old.get("diffuseFactor", (1.0, 1.0, 1.0, 1.0))[3]]
    metallic = _share(surface.get("metallicFactor", 1.0))
    transmission = (1.0 - metallic) * _share(of("transmission", "transmissionFactor", 0.0))
    red, green, blue, alpha = (_share(c) for c in surface.get("baseColorFactor", (1.0, 1.0, 1.0, 1.0)))
    return replace(
        material,
        name=str(found.get("name", "unnamed")),
        base_color=(red, green, blue),  # trimesh rounds it to bytes
        metallic=metallic,
        roughness=_share(surface.get("roughnessFactor", 1.0)),
        specular=_share(of("specular", "specularFactor", 1.0)),
        ior=min(max(1.0, of("ior", "ior", 1.5)), LARGEST_IOR),
        transmission=transmission,
        thin=transmission > 0.0 and of("volume", "thicknessFactor", 0.0) <= 0.0,
        attenuation_color=(left[0], left[1], left[2]),
        attenuation_distance=distance if distance > 0.0 else math.inf,  # 0: some exporters' word for none
        emission=(r * strength, g * strength, b * strength),
        emits_behind=bool(found.get("doubleSided", False)),
        normal_scale=_finite(found.get("normalTexture", {}).get("scale", 1.0)),
        alpha_mode=ALPHA_MODES[found.get("alphaMode", "OPAQUE")],
        alpha=alpha,
        alpha_cutoff=_finite(found.get("alphaCutoff", 0.5)),
    )


def undrawn(found: dict[str, Any]) -> list[str]:
    """What a material of the file has that is not drawn, besides extensions."""
    specular = found.get("extensions", {}).get("KHR_materials_specular", {})
    textures = {"specularTexture", "specularColorTexture"} & specular.keys()
    has = {
        "occlusion texture": "occlusionTexture" in found,
        "specular colour": any(_finite(c) != 1.0 for c in specular.get("specularColorFactor", ())),
        "specular texture": bool(textures),
        "culling of back faces": found.get("doubleSided") is False,  # as most are that do not say so
    }
    return [what for what, there in has.items() if there]


class UvSet(NamedTuple):
    """Texture coordinates as textures are looked up by them: a set of the file's, and what changes them."""

    number: int = 0  # of TEXCOORD_number
    transform: tuple[float, ...] = IDENTITY  # (2 x 3), row major, of columns u, v down, 1


class TextureUses(NamedTuple):
    """How a material's textures are looked up, in the order of model.TextureSet."""

    wraps: tuple[tuple[Wrap, Wrap], ...] = (("repeat", "repeat"),) * 4
    uv_sets: tuple[UvSet, ...] = (UvSet(),)  # that it needs of its meshes
    uv_set: tuple[int, ...] = (0,) * 4  # which of them
    notes: tuple[str, ...] = ()  # what is drawn otherwise


def texture_uses(header: dict[str, Any], number: int) -> TextureUses:
    """How the file says that a material's textures are looked up."""
    found = header["materials"][number]
    surface = found.get("pbrMetallicRoughness", {})
    infos = (
        surface.get("baseColorTexture"), surface.get("metallicRoughnessTexture"),
        found.get("emissiveTexture"), found.get("normalTexture"),
    )  # fmt: skip
    wanted = [None if info is None else _uv_set(info) for info in infos]
    uv_sets = list(dict.fromkeys(uv_set for uv_set in wanted if uv_set is not None)) or [UvSet()]
    notes = []
    if "transmissionTexture" in found.get("extensions", {}).get("KHR_materials_transmission", {}):
        notes.append("its transmission texture is not read; its factor holds everywhere")
    wraps = tuple(_wrap_of(header, info) for info in infos)
    uv_set = tuple(0 if one is None else uv_sets.index(one) for one in wanted)
    return TextureUses(wraps, tuple(uv_sets), uv_set, tuple(notes))


def _uv_set(info: dict[str, Any]) -> UvSet:
    """The texture coordinates of a texture, with KHR_texture_transform: scale, then rotation counterclockwise as seen
    with v down, then offset."""
    change = info.get("extensions", {}).get("KHR_texture_transform", {})
    (dx, dy), (sx, sy) = change.get("offset", (0.0, 0.0)), change.get("scale", (1.0, 1.0))
    angle = _finite(change.get("rotation", 0.0))
    c, s = math.cos(angle), math.sin(angle)
    sx, sy = _finite(sx), _finite(sy)
    number = int(change.get("texCoord", info.get("texCoord", 0)))
    return UvSet(number, (c * sx, s * sy, _finite(dx), -s * sx, c * sy, _finite(dy)))


def _wrap_of(header: dict[str, Any], info: dict[str, Any] | None) -> tuple[Wrap, Wrap]:
    """What a texture is beyond its edges."""
    if info is None:
        return "repeat", "repeat"
    sampler = header["textures"][info["index"]].get("sampler")
    found = {} if sampler is None else header["samplers"][sampler]
    return WRAPS[found.get("wrapS", 10497)], WRAPS[found.get("wrapT", 10497)]


def lit_evenly(material: Material, found: dict[str, Any]) -> Material:
    """A material that shows its colour whatever light falls on it, where the file says KHR_materials_unlit."""
    if "KHR_materials_unlit" not in found.get("extensions", {}):
        return material
    textures = material.textures._replace(metallic_roughness=None, emission=material.textures.base_color, normal=None)
    black = (0.0, 0.0, 0.0)
    return replace(
        material,
        base_color=black, emission=material.base_color, textures=textures,
        metallic=0.0, specular=0.0, transmission=0.0,
    )  # fmt: skip


def _finite(value: Any) -> float:
    """A number of the file; raises ValueError for NaN and infinity, which Python's JSON lets pass."""
    if not math.isfinite(found := float(value)):
        raise ValueError(f"{found} where a finite number is wanted")
    return found


def _share(value: Any) -> float:
    return min(max(_finite(value), 0.0), 1.0)


def lights_of(header: dict[str, Any]) -> tuple[tuple[Light, ...], list[str]]:
    """The file's lights, candela and lux taken as W/sr and W/m^2, and notes of those that are left out or mended."""
    known = header.get("extensions", {}).get("KHR_lights_punctual", {}).get("lights", [])
    lights: list[Light] = []
    notes: list[str] = []
    for node, pose in _placed(header):
        number = node.get("extensions", {}).get("KHR_lights_punctual", {}).get("light")
        if number is None:
            continue
        light = known[number]
        r, g, b = (_finite(c) * _finite(light.get("intensity", 1.0)) for c in light.get("color", (1.0, 1.0, 1.0)))
        x, y, z = pose[:3, 3].tolist()
        if light["type"] == "point":
            lights.append(PointLight(position=(x, y, z), intensity=(r, g, b)))
            continue
        away: Vector = (float(pose[0, 2]), float(pose[1, 2]), float(pose[2, 2]))  # it shines along the node's -z
        called = f"light {light.get('name', number)!r}"
        if not any(away):
            notes.append(f"{called} has no direction, since its node is scaled to nothing")
        elif light["type"] == "directional":
            lights.append(DirectionalLight(direction=unit(away), irradiance=(r, g, b)))
        elif light["type"] == "spot":
            inner, outer = _cone(light.get("spot", {}))
            if not 0.0 <= inner < outer <= 90.0:
                notes.append(f"{called} has a cone from {inner:.4g} to {outer:.4g} degrees; it is made one within 90")
                outer = min(max(outer, SMALLEST_CONE), 90.0)
                inner = min(max(inner, 0.0), outer - SMALLEST_CONE / 2)
            dx, dy, dz = unit(away)
            lights.append(
                SpotLight(
                    position=(x, y, z),
                    direction=(-dx, -dy, -dz),
                    intensity=(r, g, b),
                    inner_angle=inner,
                    outer_angle=outer,
                )
            )
        else:
            raise ValueError(f"{called} is of type {light['type']!r}, wanted point, spot or directional")
    return tuple(lights), notes


def _cone(spot: dict[str, Any]) -> tuple[float, float]:
    """Inner and outer angle of a spot, degrees."""
    inner, outer = spot.get("innerConeAngle", 0.0), spot.get("outerConeAngle", math.pi / 4)
    return math.degrees(_finite(inner)), math.degrees(_finite(outer))


def cameras_of(header: dict[str, Any]) -> tuple[tuple[NamedCamera, ...], list[str]]:
    """The file's perspective cameras, named by their nodes, else by themselves or by number; and notes."""
    cameras: list[NamedCamera] = []
    notes: list[str] = []
    for node, pose in _placed(header):
        number = node.get("camera")
        if number is None:
            continue
        found = header["cameras"][number]
        name = str(node.get("name") or found.get("name") or number)
        size = np.linalg.norm(pose[:3, :3], axis=0)
        if found["type"] != "perspective" or size.min() <= 0.0:
            notes.append(f"camera {name!r} is not read: it is {found['type']}, or scaled to nothing")
            continue
        rigid = np.eye(4)
        rigid[:3, :3], rigid[:3, 3] = pose[:3, :3] / size, pose[:3, 3]
        fov = min(max(math.degrees(_finite(found["perspective"]["yfov"])), 1.0), 170.0)
        cameras.append(NamedCamera(name=name, world_from_camera=rigid, fov=fov))
    return tuple(cameras), notes


def unread(header: dict[str, Any]) -> list[str]:
    """What the file has and nothing here reads, as notes."""
    notes = [f"its {what} are not read" for what in ("skins",) if header.get(what)]
    if any(primitive.get("targets") for mesh in header.get("meshes", []) for primitive in mesh.get("primitives", [])):
        notes.append("its morph targets are not read")
    unknown = sorted(set(header.get("extensionsUsed", [])) - KNOWN)
    required = sorted(set(header.get("extensionsRequired", [])) - KNOWN)
    if required:
        notes.append(
            f"extensions that it requires and that are not read, so that what is drawn differs: {', '.join(required)}"
        )
    rest = [name for name in unknown if name not in required]
    return notes + ([f"extensions that are not read: {', '.join(rest)}"] if rest else [])


def _placed(header: dict[str, Any]) -> Iterator[tuple[dict[str, Any], Float64]]:
    """Every node of the file's scene with its pose (4, 4) in the world; a node that holds itself is met once a way."""
    nodes, scenes = header.get("nodes", []), header.get("scenes", [])
    roots = scenes[header.get("scene", 0)].get("nodes", []) if scenes else range(len(nodes))
    waiting = [(number, np.eye(4), frozenset[int]()) for number in roots]
    while waiting:
        number, above, passed = waiting.pop()
        if number in passed:
            continue
        node = nodes[number]
        pose = above @ pose_of(node)
        yield node, pose
        waiting += [(child, pose, passed | {number}) for child in node.get("children", [])]


def pose_of(node: dict[str, Any]) -> Float64:
    """A node's matrix, or that of its translation, rotation (a quaternion x, y, z, w) and scale."""
    if "matrix" in node:
        return np.array(node["matrix"], np.float64).reshape(4, 4).T
    x, y, z, w = node.get("rotation", (0.0, 0.0, 0.0, 1.0))
    pose = np.eye(4)
    pose[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    pose[:3, :3] *= np.array(node.get("scale", (1.0, 1.0, 1.0)))
    pose[:3, 3] = node.get("translation", (0.0, 0.0, 0.0))
    return pose
