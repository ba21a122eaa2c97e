"""Gives surfaces the materials that a configuration names them."""

from __future__ import annotations

import io
import math
from collections.abc import Sequence
from dataclasses import replace
from difflib import get_close_matches
from fnmatch import fnmatchcase
from pathlib import Path

from PIL import Image

from wall.config.materials import (
    DiffuseConfig,
    EmissionConfig,
    GlassConfig,
    MaterialConfig,
    MetalConfig,
    MirrorConfig,
    PlasticConfig,
)
from wall.core.errors import SceneError
from wall.core.files import read_file
from wall.scene.images import Textures
from wall.scene.model import Material, Mesh, Source, Texture

NAMES_SHOWN = 20
NAMES_IN_NOTE = 8
BLACK, WHITE = (0.0, 0.0, 0.0), (1.0, 1.0, 1.0)
MOST_BYTES = 1 << 28  # of an image file


def with_materials(source: Source, configs: Sequence[MaterialConfig], base_folder: Path) -> Source:
    """The source with every material that `configs` names, in order.

    base_folder : where paths of textures start. Raises SceneError where a name fits nothing, or a texture does not.
    """
    for number, config in enumerate(configs):
        where = f"scene.materials[{number}]"
        texture = None
        if (name := texture_of(config)) is not None:
            image, notes = _texture(base_folder / name, f"{where}.texture = {name!r}")
            texture = len(source.textures)
            source = replace(source, textures=(*source.textures, image), notes=(*source.notes, *notes))
        make = _of_objects if config.material is None else _of_material
        source = make(source, config, texture, where)
    return source


def _of_material(source: Source, config: MaterialConfig, texture: int | None, where: str) -> Source:
    """Replaces materials by name; `texture`: index of the one that they get."""
    wanted = config.material or ""
    fits = [fnmatchcase(material.name, wanted) for material in source.materials]
    if not any(fits):
        names = described(wanted, [material.name for material in source.materials])
        raise SceneError(f"{where}.material = {wanted!r}: no such material; {names}")
    own = [mesh for mesh in source.meshes if fits[mesh.material]]
    _check_placed(texture, own, where)
    bare = {mesh.material for mesh in own if mesh.uvs is None}
    materials = tuple(
        _textured(changed(material, config), config, texture, bare=k in bare) if fits[k] else material
        for k, material in enumerate(source.materials)
    )
    return replace(source, materials=materials)


def _of_objects(source: Source, config: MaterialConfig, texture: int | None, where: str) -> Source:
    """Gives matched objects meshes of their own material; a mesh that others show too is kept beside it."""
    wanted = config.object or ""
    fits = [fnmatchcase(instance.name, wanted) for instance in source.instances]
    if not any(fits):
        names = described(wanted, [instance.name for instance in source.instances])
        raise SceneError(f"{where}.object = {wanted!r}: no such object; {names}")
    materials, meshes, instances = list(source.materials), list(source.meshes), list(source.instances)
    new_material: dict[tuple[int, bool], int] = {}  # by material, and whether the mesh lacks texture coordinates
    new_mesh: dict[int, int] = {}
    for row, (instance, fit) in enumerate(zip(source.instances, fits, strict=True)):
        if not fit:
            continue
        if instance.mesh not in new_mesh:
            mesh = meshes[instance.mesh]
            kind = mesh.material, mesh.uvs is None
            if kind not in new_material:
                materials.append(_textured(changed(materials[mesh.material], config), config, texture, bare=kind[1]))
                new_material[kind] = len(materials) - 1
            meshes.append(replace(mesh, material=new_material[kind]))
            new_mesh[instance.mesh] = len(meshes) - 1
        instances[row] = replace(instance, mesh=new_mesh[instance.mesh])
    _check_placed(texture, [meshes[k] for k in new_mesh], where)
    used = sorted({instance.mesh for instance in instances})
    place = {mesh: k for k, mesh in enumerate(used)}
    return replace(
        source,
        materials=tuple(materials),
        meshes=tuple(meshes[k] for k in used),
        instances=tuple(replace(instance, mesh=place[instance.mesh]) for instance in instances),
    )


def texture_of(config: MaterialConfig) -> str | None:
    """The file of its texture; None without one."""
    return None if isinstance(config, MirrorConfig | EmissionConfig) else config.texture


def _texture(path: Path, where: str) -> tuple[Texture, list[str]]:
    """An image file as a texture, and notes. Raises SceneError."""
    made = Textures()
    try:
        number = made.number(Image.open(io.BytesIO(read_file(path, MOST_BYTES))), path.name)
    except Exception as error:  # Pillow raises anything on broken data
        raise SceneError(f"{where}: cannot be read ({getattr(error, 'strerror', None) or error})") from error
    if number is None:
        raise SceneError(f"{where}: {made.notes[0]}")
    return made.textures[number], made.notes


def _textured(material: Material, config: MaterialConfig, texture: int | None, *, bare: bool) -> Material:
    """A material with a texture, if there is one; `bare`: it is on meshes without texture coordinates, which keep
    their colour."""
    if texture is None:
        return material
    white = getattr(config, "color", None) is None and not bare
    textures = material.textures._replace(base_color=texture)
    return replace(material, base_color=WHITE if white else material.base_color, textures=textures)


def _check_placed(texture: int | None, meshes: Sequence[Mesh], where: str) -> None:
    """Refuse a texture for meshes none of which says where it is on them. Raises SceneError."""
    if texture is not None and all(mesh.uvs is None for mesh in meshes):
        raise SceneError(f"{where}.texture: no mesh that it is for has texture coordinates; wanted one that has")


def changed(material: Material, config: MaterialConfig) -> Material:
    """A material as `config` has it. emission and mirror add to what there is; others replace all but
    its colour, normals and alpha.
    """
    if isinstance(config, EmissionConfig):
        textures = material.textures._replace(emission=None)
        return replace(material, emission=config.radiance, textures=textures, emits_behind=config.sides == "both")
    if isinstance(config, MirrorConfig):
        left = 1.0 - config.share
        return replace(material, mirror=config.share, transmission=left * material.transmission)
    plain = replace(
        material,
        mirror=0.0, metallic=0.0, specular=0.0, transmission=0.0, emission=BLACK, attenuation_distance=math.inf,
        textures=material.textures._replace(metallic_roughness=None, emission=None),
    )  # fmt: skip
    if config.color is not None:
        plain = replace(plain, base_color=config.color, textures=plain.textures._replace(base_color=None))
    match config:
        case DiffuseConfig():
            return plain
        case PlasticConfig():
            return replace(plain, specular=1.0, roughness=config.roughness, ior=config.ior)
        case MetalConfig():
            return replace(plain, metallic=1.0, roughness=config.roughness)
        case GlassConfig():
            color = plain.base_color if config.color is not None else (1.0, 1.0, 1.0)
            glass = replace(
                plain, base_color=color, transmission=1.0, roughness=config.roughness, ior=config.ior, thin=config.thin
            )
            if config.attenuation is None:
                return glass
            absorbed = config.attenuation
            return replace(glass, attenuation_color=absorbed.color, attenuation_distance=absorbed.distance)


def described(wanted: str, known: Sequence[str]) -> str:
    """The names there are, the likeliest first, as the end of an error."""
    known = sorted(set(known))
    near = get_close_matches(wanted, known, n=1)
    meant = f"did you mean {near[0]!r}? " if near else ""
    more = f" and {len(known) - NAMES_SHOWN} more" if len(known) > NAMES_SHOWN else ""
    return f"{meant}there are {', '.join(known[:NAMES_SHOWN])}{more}"


def seen_on_paths(source: Source) -> list[str]:
    """A note that names materials of a file which direct light shows as others; none without any."""
    there = {m.name for m in source.materials if m.metallic > 0.0 or m.transmission > 0.0 or max(m.emission) > 0.0}
    names = [name for name in dict.fromkeys(source.of_paths) if name in there]
    if not names:
        return []
    many = "materials are" if len(names) > 1 else "material is"
    return [
        f"{len(names)} {many} metal, glass or shining ({listed(names)}): direct light shows metal and glass matt, and "
        "what shines lights nothing; --integrator path, or scene: {integrator: {method: path}}, shows them"
    ]


def listed(names: Sequence[str]) -> str:
    """Names for a note, the first NAMES_IN_NOTE of them."""
    more = f", and {len(names) - NAMES_IN_NOTE} more" if len(names) > NAMES_IN_NOTE else ""
    return ", ".join(names[:NAMES_IN_NOTE]) + more
