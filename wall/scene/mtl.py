"""What an MTL file says of its materials and trimesh does not read: all but Kd and map_Kd.

A map multiplies the value of its key, which counts as 1 where the file leaves it out, as "Object Files", appendix B1
(Alias|Wavefront, 1995) says of map_Kd and map_d. Pm, Pr, their maps and norm: the format's extension for physically
based rendering, by Clara.io.
"""

from __future__ import annotations

import io
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np
from PIL import Image

from wall.core.data import Float64
from wall.core.fields import LARGEST_IOR
from wall.scene.model import AlphaMode, Material

SHARPEST_NS = 1000.0  # Blender writes (1 - roughness)^2 times this
OPTIONS = {  # of maps, before the file: how many words follow at most; numbers alone follow those of three
    "-blendu": 1, "-blendv": 1, "-boost": 1, "-bm": 1, "-cc": 1, "-clamp": 1, "-imfchan": 1, "-mm": 2, "-o": 3, "-s": 3,
    "-t": 3, "-texres": 1, "-type": 1,
}  # fmt: skip
AS_IF_UNWRITTEN = {  # options that change where a map lies or what it holds, and with what words they change nothing
    "-clamp": ["off"], "-mm": ["0.0", "1.0"], "-o": ["0.0"] * 3, "-s": ["1.0"] * 3, "-t": ["0.0"] * 3,
}  # fmt: skip
DRAWN_MAPS = {"map_ke": "map_Ke", "map_d": "map_d", "map_pr": "map_Pr", "map_pm": "map_Pm", "norm": "norm"}
UNDRAWN_MAPS = {
    "bump": "bump", "decal": "decal", "disp": "disp", "map_bump": "map_Bump", "map_ks": "map_Ks", "map_ns": "map_Ns",
    "map_pc": "map_Pc", "map_ps": "map_Ps", "map_refl": "map_refl", "map_tf": "map_Tf", "map_tr": "map_Tr",
    "refl": "refl",
}  # fmt: skip
UNDRAWN_VALUES = {  # and the number by which they change nothing
    "aniso": ("aniso", 0.0), "anisor": ("anisor", 0.0), "pc": ("Pc", 0.0), "ps": ("Ps", 0.0), "tf": ("Tf", 1.0),
}  # fmt: skip
DRAWN_ILLUM = ("1", "2")  # others have no light, or mirrors and glass


class MtlImages(NamedTuple):
    """Images of a material, in the order of model.TextureSet."""

    base_color: Image.Image | None
    metallic_roughness: Image.Image | None = None
    emission: Image.Image | None = None
    normal: Image.Image | None = None
    read: frozenset[str] = frozenset()  # keys of the maps that they hold, in lower case, besides map_Kd


@dataclass(slots=True)
class Maps:
    """Images that materials name; each is read once, and those made of the same ones are one."""

    read: Callable[[str], bytes]  # of a file beside the model; raises OSError, and ValueError
    notes: list[str] = field(default_factory=list)
    _images: dict[str, Image.Image | None] = field(default_factory=dict)
    _made: dict[tuple[Any, ...], tuple[Image.Image, Any]] = field(default_factory=dict)

    def of(self, written: dict[str, Any], image: Image.Image | None, called: str) -> MtlImages:
        """The images of a material; image : of its map_Kd."""
        found = {key: self._image(written, key, called) for key in DRAWN_MAPS if key in written}
        images = {key: each for key, each in found.items() if each is not None}
        cover, rough, metal = (images.get(key) for key in ("map_d", "map_pr", "map_pm"))
        surface = None if rough is None and metal is None else self._made_of(_surface, rough, metal)
        if cover is not None:
            try:
                image = self._made_of(_covered, image, cover)
            except Exception as error:  # of map_Kd, which trimesh has opened and not decoded
                self.notes.append(f"material {called!r}: its map_Kd cannot be read ({type(error).__name__}: {error})")
                image = self._made_of(_covered, None, cover)
        return MtlImages(image, surface, images.get("map_ke"), images.get("norm"), frozenset(images))

    def _image(self, written: dict[str, Any], key: str, called: str) -> Image.Image | None:
        """The image that a key names; None where it names none, or one that cannot be read."""
        name = options_of(written.get(key, ()))[1]
        if name and name not in self._images:
            self._images[name] = None
            try:
                image = Image.open(io.BytesIO(self.read(name)))
                image.load()
                self._images[name] = image
            except Exception as error:  # Pillow's decoders raise anything on broken data
                self.notes.append(
                    f"material {called!r}: its {DRAWN_MAPS[key]} cannot be read ({type(error).__name__}: {error})"
                )
        return self._images.get(name)

    def _made_of(self, make: Callable[..., Image.Image], *parts: Image.Image | None) -> Image.Image:
        key = (make, *map(id, parts))
        if key not in self._made:
            self._made[key] = make(*parts), parts  # which stay, so that no other gets their ids
        return self._made[key][0]


def _surface(rough: Image.Image | None, metal: Image.Image | None) -> Image.Image:
    """An image of roughness in green and metalness in blue, as large as the larger one."""
    size = max(image.size for image in (rough, metal) if image is not None)
    full = Image.new("L", size, 255)
    green, blue = (full if image is None else _grey(image).resize(size) for image in (rough, metal))
    return Image.merge("RGB", (full, green, blue))


def _covered(color: Image.Image | None, cover: Image.Image) -> Image.Image:
    """A colour, white where there is none, with the alpha of another image; that is its grey where it has no alpha."""
    size = cover.size if color is None else max(color.size, cover.size)
    alpha = cover.convert("RGBA").getchannel("A") if lets_through(cover) else _grey(cover)
    covered = Image.new("RGB", size, (255, 255, 255)) if color is None else color.convert("RGB").resize(size)
    covered.putalpha(alpha.resize(size))
    return covered


def _grey(image: Image.Image) -> Image.Image:
    """Eight bits of an image; Pillow would cut sixteen, and floats of 0 to 1, off."""
    if image.mode[0] in "IF":
        values = np.asarray(image) / (1.0 if image.mode == "F" else 65535.0)
        return Image.fromarray(np.rint(255.0 * np.clip(values, 0.0, 1.0)).astype(np.uint8))
    return image.convert("L")


def lets_through(image: Image.Image) -> bool:
    """Whether an image is anywhere less than opaque; one that cannot be decoded is noted elsewhere."""
    if "A" not in image.getbands() and "transparency" not in image.info:
        return False
    try:
        return bool(np.asarray(image.convert("RGBA"))[..., 3].min() < 255)
    except Exception:  # Pillow's decoders raise anything on broken data
        return False


def options_of(words: Sequence[str]) -> tuple[dict[str, list[str]], str]:
    """The options of a map with their words, and the file behind them."""
    options: dict[str, list[str]] = {}
    k = 0
    while k < len(words) and (most := OPTIONS.get(words[k].lower(), 0)):
        taken = list(words[k + 1 : k + 1 + most])
        if most == 3:  # one to three numbers
            taken = taken[: next((n for n, word in enumerate(taken) if _numbers(word, 1) is None), most)]
        options[words[k].lower()] = taken
        k += 1 + len(taken)
    return options, " ".join(words[k:])


def undrawn(written: dict[str, Any], image: Image.Image | None) -> Iterator[str]:
    """What a material has that is not drawn; image : of its map_Kd."""
    yield from (name for key, name in UNDRAWN_MAPS.items() if key in written)
    for key, (name, nothing) in UNDRAWN_VALUES.items():
        found = _numbers(written.get(key), len(written.get(key, ())))
        if found is not None and (found != nothing).any():
            yield name
    if (illum := " ".join(written.get("illum", DRAWN_ILLUM[:1]))) not in DRAWN_ILLUM:
        yield f"illum {illum}"
    lines = {name: written[key] for key, name in DRAWN_MAPS.items() if key in written}
    if image is not None:
        lines["map_Kd"] = str(image.info.get("file_path", "")).split()  # trimesh's word for what stood there
    for name, words in lines.items():
        for option, taken in options_of(words)[0].items():
            values = [word if _numbers(word, 1) is None else str(float(word)) for word in taken]
            if option in AS_IF_UNWRITTEN and values != AS_IF_UNWRITTEN[option][: len(values)]:
                yield f"{option} of {name}"


def of_mtl(material: Material, written: dict[str, Any], images: MtlImages) -> Material:
    """A material with what its file says besides Kd: Ke, Ni, d or Tr, Pm and Pr; else Ks and Ns as Blender has them.

    written : keys in lower case; numbers, lists of them, or of their words. What cannot be read counts as absent
    """
    pm, pr, ni, ns, d, tr = (_numbers(written.get(key), 1) for key in ("pm", "pr", "ni", "ns", "d", "tr"))
    ke, ks = _numbers(written.get("ke"), 3), _numbers(written.get("ks"), 3)
    bumps = _numbers(options_of(written.get("norm", ()))[0].get("-bm"), 1)
    if ke is not None:
        r, g, b = np.maximum(ke, 0.0).tolist()
        material = replace(material, emission=(r, g, b))
    if images.emission is not None and not any(material.emission):  # exporters write Ke 0 0 0 beside it
        material = replace(material, emission=(1.0, 1.0, 1.0))
    if bumps is not None:
        material = replace(material, normal_scale=float(bumps[0]))
    if ni is not None and 1.0 < ni[0] <= LARGEST_IOR:
        material = replace(material, ior=float(ni[0]))
    left = d if d is not None else 1.0 - tr if tr is not None else None
    if left is not None or "map_d" in images.read:
        alpha = 1.0 if left is None else float(np.clip(left[0], 0.0, 1.0))
        mode: AlphaMode = "blend" if alpha < 1.0 else "mask" if "map_d" in images.read else "opaque"
        material = replace(material, alpha=alpha, alpha_mode=mode)
    if pm is not None or "map_pm" in images.read:
        material = replace(material, metallic=1.0 if pm is None else float(np.clip(pm[0], 0.0, 1.0)))
    if pr is not None or "map_pr" in images.read:
        roughness = 1.0 if pr is None else float(np.clip(pr[0], 0.0, 1.0))
        material = replace(material, roughness=roughness, specular=1.0)
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
