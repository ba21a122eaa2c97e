"""Textures of a model's materials, from Pillow's images: decoded once each, with notes of what is wrong with them."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from PIL import Image

from wall.scene.model import Texture, Wrap

LARGEST_TEXTURE_PX = 4096  # 48 MiB of texels; larger images are halved until they fit
REPEATING: tuple[Wrap, Wrap] = ("repeat", "repeat")


@dataclass(slots=True)
class Textures:
    """The textures met so far; equal images used alike become one."""

    textures: list[Texture] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    _numbers: dict[tuple[Any, ...], int | None] = field(default_factory=dict)
    _kept: list[Any] = field(default_factory=list)  # what the ids above stand for, so that none is given twice

    def number(
        self,
        image: Image.Image | None,
        called: str,
        *,
        linear: bool = False,
        alpha: bool = False,
        wrap: tuple[Wrap, Wrap] = REPEATING,
        uv_set: int = 0,
    ) -> int | None:
        """Index of the texture of an image, None without one; called : the material, for notes.

        linear : its bytes are values, not sRGB; alpha : keep its alpha; wrap : beyond its edges; uv_set : see Texture
        """
        if image is None:
            return None
        key = (id(image), linear, alpha, wrap, uv_set)
        if key not in self._numbers:
            texture = self._decoded(image, called, alpha=alpha)
            self._numbers[key] = None if texture is None else len(self.textures)
            self._kept.append(image)
            self.textures += [] if texture is None else [replace(texture, linear=linear, wrap=wrap, uv_set=uv_set)]
        return self._numbers[key]

    def _decoded(self, image: Image.Image, called: str, *, alpha: bool) -> Texture | None:
        try:
            shrink = max(1, -(-max(image.size) // LARGEST_TEXTURE_PX))
            if shrink > 1:
                size = f"{image.width}x{image.height}"
                self.notes.append(f"material {called!r}: its {size} texture is reduced {shrink} times")
                image = image.reduce(shrink)
            rgba = np.ascontiguousarray(image.convert("RGBA"), np.uint8)
        except Exception as error:  # Pillow's decoders raise anything on broken data
            self.notes.append(f"material {called!r}: its texture cannot be decoded ({error}); its plain value is used")
            return None
        cover = np.ascontiguousarray(rgba[:, :, 3]) if alpha and rgba[:, :, 3].min() < 255 else None
        return Texture(name=called, texels=np.ascontiguousarray(rgba[:, :, :3]), alpha=cover)
