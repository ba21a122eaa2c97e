"""What surfaces look like, from trimesh's materials to ours: colour, texture, vertex colours, gloss, emission.

Colour spaces: glTF factors and vertex colours are linear, as its specification says; so is an OBJ's Kd. PLY and OBJ
vertex colours are sRGB by custom, and are made linear. Textures stay sRGB bytes; the tracer decodes them.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import trimesh
from numpy.typing import NDArray
from PIL import Image

from wall.core.colour import srgb_decoded
from wall.core.data import Float32, Float64
from wall.core.fields import LARGEST_IOR
from wall.scene.animation import Vector
from wall.scene.gltf import MALFORMED, TextureUses, UvSet, completed, lit_evenly, texture_uses
from wall.scene.images import Textures
from wall.scene.model import Material, TextureSet

NAMES_SHOWN = 8  # in a note
SHARPEST_NS = 1000.0  # Blender writes (1 - roughness)^2 times this


@dataclass(slots=True)
class Palette:
    """Materials and textures met so far; equal objects in the file become one entry."""

    linear_vertex_colors: bool
    header: dict[str, Any] = field(default_factory=dict)  # a glTF file's JSON; its materials are named by their numbers
    materials: list[Material] = field(default_factory=list)
    images: Textures = field(default_factory=Textures)
    notes: list[str] = field(default_factory=list)
    metals: list[str] = field(default_factory=list)  # names of materials that are drawn diffuse
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

    def simplified(self) -> list[str]:
        """A note that counts and names the materials which are drawn simpler than the file says; none if all are."""
        names = self.metals
        many = "materials are" if len(names) > 1 else "material is"
        return [f"{len(names)} {many} metal, diffuse under direct light ({_listed(names)})"] if names else []

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
            if number >= 0:
                base = self._completed(base, number, found)
            self.metals += [name] if self._is_metal(base) else []
            return base
        image = getattr(found, "image", None)
        if image is not None and image.format is None:  # trimesh's own stand-in, not from a file
            image = None
            self.notes.append("it has texture coordinates and names no image: its surfaces are plain")
        written = getattr(found, "kwargs", {}).get("kd")
        base = replace(base, base_color=_factor(written, base.base_color if image is None else (1.0, 1.0, 1.0)))
        base = of_mtl(base, getattr(found, "kwargs", {}))
        if image is not None and _lets_through(image):
            self.notes.append(f"material {name!r}: the alpha of its texture is not used; it is opaque")
        return replace(base, textures=TextureSet(self.images.number(image, name)))

    def _is_metal(self, material: Material) -> bool:
        """Whether a material is metal anywhere: its factor times the blue of its texture."""
        number = material.textures.metallic_roughness
        return material.metallic > 0.0 and (number is None or bool(self.images.textures[number].texels[..., 2].any()))

    def _completed(self, material: Material, number: int, found: Any) -> Material:
        """A glTF material with all that its file says."""
        try:
            material = completed(material, self.header, number)
            uses = texture_uses(self.header, number)
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
        return lit_evenly(replace(material, textures=TextureSet(*numbers)), self.header["materials"][number])

    def vertex_colors(self, visual: Any, count: int) -> Float32 | None:
        """(count, 3) linear RGB of a mesh that brings colours for its vertices."""
        rows = None
        if getattr(visual, "kind", None) == "vertex":
            rows = np.asarray(visual.vertex_colors)
        elif hasattr(visual, "vertex_attributes"):
            rows = visual.vertex_attributes.get("color")
        if rows is None or np.ndim(rows) != 2 or len(rows) != count or np.shape(rows)[1] < 3:
            return None
        return self.linear(rows)

    def linear(self, rows: NDArray[Any]) -> Float32:
        """(n, 3) linear RGB of (n, 3 or 4) colours as the file has them, integers or floats in 0..1."""
        scale = float(np.iinfo(rows.dtype).max) if np.issubdtype(rows.dtype, np.integer) else 1.0
        values = np.clip(np.nan_to_num(rows[:, :3].astype(np.float64)) / scale, 0.0, 1.0)
        return (values if self.linear_vertex_colors else srgb_decoded(values)).astype(np.float32)


def of_mtl(material: Material, written: dict[str, Any]) -> Material:
    """A material with what an MTL file says besides Kd: Ke, Ni, d or Tr, Pm and Pr; else Ks and Ns as Blender has them.

    written : keys in lower case; numbers, lists of them, or of their words. What cannot be read counts as absent
    """
    pm, pr, ni, ns, d, tr = (_numbers(written.get(key), 1) for key in ("pm", "pr", "ni", "ns", "d", "tr"))
    ke, ks = _numbers(written.get("ke"), 3), _numbers(written.get("ks"), 3)
    if ke is not None:
        r, g, b = np.maximum(ke, 0.0).tolist()
        material = replace(material, emission=(r, g, b))
    if ni is not None and 1.0 < ni[0] <= LARGEST_IOR:
        material = replace(material, ior=float(ni[0]))
    left = d if d is not None else 1.0 - tr if tr is not None else None
    if left is not None:
        alpha = float(np.clip(left[0], 0.0, 1.0))
        material = replace(material, alpha=alpha, alpha_mode="blend" if alpha < 1.0 else "opaque")
    if pm is not None:
        material = replace(material, metallic=float(np.clip(pm[0], 0.0, 1.0)))
    if pr is not None:
        material = replace(material, roughness=float(np.clip(pr[0], 0.0, 1.0)), specular=1.0)
    elif ks is not None and ns is not None and ks.max() > 0.0:
        shine = 1.0 - np.sqrt(np.clip(ns[0] / SHARPEST_NS, 0.0, 1.0))
        material = replace(material, roughness=float(shine), specular=float(np.clip(2.0 * ks.mean(), 0.0, 1.0)))
    return material


def _numbers(value: Any, count: int) -> Float64 | None:
    """The first `count` numbers of an MTL value; None where there are not so many, or they are not finite."""
    try:
        found = np.atleast_1d(np.asarray(value, np.float64))[:count]
    except (TypeError, ValueError):
        return None
    return found if len(found) == count and np.isfinite(found).all() else None


def _lets_through(image: Image.Image) -> bool:
    """Whether an image is anywhere less than opaque; one that cannot be decoded is noted elsewhere."""
    if "A" not in image.getbands() and "transparency" not in image.info:
        return False
    try:
        return bool(np.asarray(image.convert("RGBA"))[..., 3].min() < 255)
    except Exception:  # Pillow's decoders raise anything on broken data
        return False


def _listed(names: list[str]) -> str:
    """Names for a note, the first NAMES_SHOWN of them."""
    more = f", and {len(names) - NAMES_SHOWN} more" if len(names) > NAMES_SHOWN else ""
    return ", ".join(names[:NAMES_SHOWN]) + more


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
