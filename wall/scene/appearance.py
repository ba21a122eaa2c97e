"""What surfaces look like, from trimesh's materials to ours: colour, texture, vertex colours, gloss, emission.

Colour spaces: glTF factors and vertex colours are linear, as its specification says; so is an OBJ's Kd. PLY and OBJ
vertex colours are sRGB by custom, and are made linear. Textures stay sRGB bytes; the tracer decodes them.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import trimesh
from numpy.typing import NDArray

from wall.core.colour import srgb_decoded
from wall.core.data import Float32
from wall.scene.animation import Vector
from wall.scene.gltf import MALFORMED, TextureUses, UvSet, completed, lit_evenly, texture_uses, undrawn
from wall.scene.images import Textures
from wall.scene.materials import listed
from wall.scene.model import Material, TextureSet
from wall.scene.mtl import Maps, lets_through, of_mtl
from wall.scene.mtl import undrawn as undrawn_of_mtl


@dataclass(slots=True)
class Palette:
    """Materials and textures met so far; equal objects in the file become one entry."""

    linear_vertex_colors: bool
    maps: Maps  # of an MTL file
    textures_given: bool = False  # from a configuration: it is no news that the file has none
    header: dict[str, Any] = field(default_factory=dict)  # a glTF file's JSON; its materials are named by their numbers
    materials: list[Material] = field(default_factory=list)
    images: Textures = field(default_factory=Textures)
    notes: list[str] = field(default_factory=list)
    of_paths: list[str] = field(default_factory=list)  # names of materials that direct light shows as others
    undrawn: dict[str, list[str]] = field(default_factory=dict)  # what is not drawn, and names of the materials
    uv_sets: dict[int, tuple[UvSet, ...]] = field(default_factory=dict)  # that a material needs of its meshes
    _materials: dict[int, int] = field(default_factory=dict)
    _kept: list[Any] = field(default_factory=list)  # what the ids above stand for, so that none is given twice

    def material(self, visual: Any) -> int:
        """Number of the material of a trimesh visual; one without any is light grey."""
        found = getattr(visual, "material", None)
        key = id(found) if found is not None else -1
        if key not in self._materials:
            self.materials.append(self._converted(found))
            self._materials[key] = len(self.materials) - 1
            self._kept.append(found)
        return self._materials[key]

    def plain(self) -> int:
        """A white material for meshes that bring a colour at each vertex."""
        if -2 not in self._materials:
            self.materials.append(Material(name="vertex colours", base_color=(1.0, 1.0, 1.0)))
            self._materials[-2] = len(self.materials) - 1
        return self._materials[-2]

    def said(self) -> list[str]:
        """Notes of all materials and textures: of what is wrong with them, and one of what is not drawn."""
        notes = [*self.notes, *self.maps.notes, *self.images.notes]
        left_out = "; ".join(f"{what} ({listed(names)})" for what, names in self.undrawn.items())
        return [*notes, f"of its materials is not drawn: {left_out}"] if left_out else notes

    def _converted(self, found: Any) -> Material:
        if found is None:
            return Material(name="default")
        name, number = str(getattr(found, "name", None) or "unnamed"), -1
        if self.header and name.isdecimal() and int(name) < len(self.header.get("materials", ())):
            number = int(name)
            name = str(self.header["materials"][number].get("name", "unnamed"))
        base = Material(name=name)
        if isinstance(found, trimesh.visual.material.PBRMaterial):
            base = replace(
                base,
                base_color=_factor(found.baseColorFactor, base.base_color),
                emission=_factor(found.emissiveFactor, (0.0, 0.0, 0.0)),
            )
            if found.baseColorFactor is None:
                base = replace(base, base_color=(1.0, 1.0, 1.0))  # glTF's default
            return self._completed(base, number, found) if number >= 0 else self._seen_on_paths(base)
        image = getattr(found, "image", None)
        if image is not None and image.format is None:  # trimesh's own stand-in, not from a file
            image = None
            if not self.textures_given:
                self.notes.append(
                    "it has texture coordinates and names no image: its surfaces are plain; wanted: its .mtl, or "
                    "scene.materials with texture: FILE"
                )
        written = getattr(found, "kwargs", {})
        color = _factor(written.get("kd"), base.base_color if image is None else (1.0, 1.0, 1.0))
        images = self.maps.of(written, image, name)
        base = of_mtl(replace(base, base_color=color), written, images)
        if image is not None and "map_d" not in images.read and lets_through(image):
            self.notes.append(f"material {name!r}: the alpha of its texture is not used; it is opaque")
        self.leave_out(name, undrawn_of_mtl(written, image))
        linear, alpha = (False, True, False, True), ("map_d" in images.read, False, False, False)
        numbers = [
            self.images.number(each, name, linear=linear[k], alpha=alpha[k]) for k, each in enumerate(images[:4])
        ]
        return self._seen_on_paths(replace(base, textures=TextureSet(*numbers)))

    def leave_out(self, material: str, what: Iterable[str]) -> None:
        """Remember what of a material is not drawn."""
        for each in what:
            names = self.undrawn.setdefault(each, [])
            names += [] if material in names else [material]

    def _seen_on_paths(self, material: Material) -> Material:
        """The material; its name is kept where direct light shows it as another: metal, glass, or what shines."""
        number = material.textures.metallic_roughness
        blue = number is None or bool(self.images.textures[number].texels[..., 2].any())
        if (material.metallic > 0.0 and blue) or material.transmission > 0.0 or max(material.emission) > 0.0:
            self.of_paths.append(material.name)
        return material

    def _completed(self, material: Material, number: int, found: Any) -> Material:
        """A glTF material with all that its file says."""
        try:
            material = completed(material, self.header, number)
            uses = texture_uses(self.header, number)
            self.leave_out(material.name, undrawn(self.header["materials"][number]))
        except MALFORMED as error:
            self.notes.append(
                f"material {material.name!r}: its numbers cannot be read ({type(error).__name__}: {error})"
            )
            uses = TextureUses()
        images = (
            found.baseColorTexture, found.metallicRoughnessTexture, found.emissiveTexture, found.normalTexture
        )  # fmt: skip
        linear, alpha = (False, True, False, True), (material.alpha_mode != "opaque", False, False, False)
        numbers = [
            self.images.number(
                image, material.name, linear=linear[k], alpha=alpha[k], wrap=uses.wraps[k], uv_set=uses.uv_set[k]
            )
            for k, image in enumerate(images)
        ]
        self.notes += [f"material {material.name!r}: {what}" for what in uses.notes]
        self.uv_sets[len(self.materials)] = uses.uv_sets
        material = replace(material, textures=TextureSet(*numbers))
        unlit = lit_evenly(material, self.header["materials"][number])
        return self._seen_on_paths(material) if unlit is material else unlit

    def vertex_colors(self, visual: Any, count: int) -> Float32 | None:
        """(count, 3) linear RGB of a mesh that brings colours for its vertices."""
        rows = _color_rows(visual)
        if rows is None or np.ndim(rows) != 2 or len(rows) != count or np.shape(rows)[1] < 3:
            return None
        return self.linear(rows)

    def see_alpha(self, visual: Any, material: int) -> None:
        """Remember that the alpha of a mesh's vertex colours is not drawn, where its material would show it."""
        rows, seen = _color_rows(visual), self.materials[material]
        if rows is None or seen.alpha_mode == "opaque" or np.ndim(rows) != 2 or np.shape(rows)[1] < 4:
            return
        whole = np.iinfo(rows.dtype).max if np.issubdtype(rows.dtype, np.integer) else 1
        if (rows[:, 3] < whole).any():
            self.leave_out(seen.name, ["alpha of vertex colours"])

    def linear(self, rows: NDArray[Any]) -> Float32:
        """(n, 3) linear RGB of (n, 3 or 4) colours as the file has them, integers or floats in 0..1."""
        scale = float(np.iinfo(rows.dtype).max) if np.issubdtype(rows.dtype, np.integer) else 1.0
        values = np.clip(np.nan_to_num(rows[:, :3].astype(np.float64)) / scale, 0.0, 1.0)
        return (values if self.linear_vertex_colors else srgb_decoded(values)).astype(np.float32)


def _color_rows(visual: Any) -> NDArray[Any] | None:
    """The colours of a mesh's vertices as trimesh has them."""
    if getattr(visual, "kind", None) == "vertex":
        return np.asarray(visual.vertex_colors)
    found: NDArray[Any] | None = getattr(visual, "vertex_attributes", {}).get("color")
    return found


def _factor(color: Any, default: Vector) -> Vector:
    """A colour as three floats in 0..1; bytes are scaled, anything unfit gives the default."""
    if color is None:
        return default
    values = np.asarray(color)
    if values.ndim == 0 and values.dtype.kind in "fiu":
        values = np.repeat(values, 3)
    if values.ndim != 1 or len(values) < 3 or values.dtype.kind not in "fiu" or not np.isfinite(values[:3]).all():
        return default
    scale = 255.0 if values.dtype.kind in "iu" and values.dtype.itemsize == 1 else 1.0
    r, g, b = np.clip(values[:3].astype(np.float64) / scale, 0.0, 1.0).tolist()
    return (r, g, b)
