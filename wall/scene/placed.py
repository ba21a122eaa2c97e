"""Leaves out what a source brings and no object shows: meshes that are not placed, textures that no placed mesh has."""

from __future__ import annotations

from dataclasses import replace

from wall.scene.model import Material, Source, TextureSet


def only_placed(source: Source) -> Source:
    """The source with the meshes that its instances place, and the textures that these show; a note tells the rest.

    Materials stay, since edits name them; a texture that is left out is gone from them.
    """
    meshes = sorted({instance.mesh for instance in source.instances})
    mapped = {source.meshes[k].material for k in meshes if source.meshes[k].uvs is not None}
    textures = sorted({k for number in mapped for k in source.materials[number].textures if k is not None})
    left_out = len(source.meshes) - len(meshes), len(source.textures) - len(textures)
    if not source.instances or left_out == (0, 0):
        return source
    mesh_of = {old: new for new, old in enumerate(meshes)}
    texture_of = {old: new for new, old in enumerate(textures)}
    counted = _counted(left_out[0], "mesh", "meshes"), _counted(left_out[1], "texture", "textures")
    note = f"of no object that is placed, left out: {' and '.join(filter(None, counted))}"
    return replace(
        source,
        meshes=tuple(source.meshes[k] for k in meshes),
        textures=tuple(source.textures[k] for k in textures),
        materials=tuple(_renumbered(material, texture_of) for material in source.materials),
        instances=tuple(replace(instance, mesh=mesh_of[instance.mesh]) for instance in source.instances),
        notes=(*source.notes, note),
    )


def _counted(count: int, one: str, more: str) -> str:
    """Words for a number of things, none for none."""
    return "" if count == 0 else f"{count} {one if count == 1 else more}"


def _renumbered(material: Material, texture_of: dict[int, int]) -> Material:
    numbers = (None if k is None else texture_of.get(k) for k in material.textures)
    return replace(material, textures=TextureSet(*numbers))
