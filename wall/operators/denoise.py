"""`denoise`: Intel's Open Image Denoise, through the optional package pyoidn, which brings the library with it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import ClassVar, Literal, TypeAlias

import numpy as np
from pydantic import Field

from wall.core.data import Channels, Float32, Framelet, Rect
from wall.core.errors import ConfigError, RunError
from wall.operators.base import Input, Operator
from wall.operators.regions import copy, pixels_of

INSTALL = "pip install 'pyoidn>=2.5'"
Denoiser = Callable[..., Float32]
Quality: TypeAlias = Literal["fast", "balanced", "high"]


class Denoise(Operator):
    """A network estimates the image behind the noise, with albedos and normals where they are known.

    Every pixel may depend on every other. Any change redoes the whole image, so it is for sinks that show few images a
    second.
    """

    op: Literal["denoise"] = Field(description="Open Image Denoise")
    input: Input
    quality: Quality = Field(default="balanced", description="the faster, the coarser")

    USES: ClassVar[Channels] = frozenset({"albedo", "normal"})  # samples of paths bring them
    LOSES: ClassVar[Channels] = frozenset({"variance"})  # that of the estimate is unknown

    def touched(self, rect: Rect, inputs: Sequence[Rect], k: int) -> Rect:
        """Returns the rectangle of the output that changes with input `k` in `rect`: the whole image, in pixels."""
        return inputs[0]

    def prepare(self, folder: Path, inputs: Sequence[Rect]) -> Denoiser:
        """See load_denoiser."""
        return load_denoiser(f"denoise '{self.id}'")

    def apply(self, inputs: Sequence[Framelet], out: Framelet, region: Rect, prepared: Denoiser) -> None:
        """Raises RunError when the library fails."""
        source = inputs[0]
        copy(source, out, region, but=frozenset({"colour"}))
        who = f"denoise '{self.id}'"
        colour = denoised(prepared, source.colour, source.albedo, source.normal, quality=self.quality, who=who)
        pixels_of(out, "colour", region)[...] = colour[region.inside(source.rect)]


def load_denoiser(who: str) -> Denoiser:
    """Open Image Denoise. Raises ConfigError saying what to install where pyoidn is missing, or cannot load it."""
    try:
        from pyoidn import denoise
    except (ImportError, OSError) as error:
        raise ConfigError(f"{who}: cannot use pyoidn ({error}), wanted it installed: {INSTALL}") from error
    return denoise  # type: ignore[no-any-return]


def denoised(
    denoiser: Denoiser, colour: Float32, albedo: Float32 | None, normal: Float32 | None, *, quality: Quality, who: str
) -> Float32:
    """(h, w, 3) float32 linear RGB of a noisy image; `albedo` and `normal` (h, w, 3) are used where samples bring them.

    Raises RunError, of `who` wanted it, when the library fails.
    """
    surfaces: dict[str, Float32] = {}
    if albedo is not None and normal is not None and albedo.any():  # else blank: no sample brought any
        surfaces = {"albedo": np.clip(albedo, np.float32(0.0), np.float32(1.0)), "normal": normal}
    try:
        return denoiser(np.maximum(colour, np.float32(0.0)), hdr=True, quality=quality, **surfaces)
    except RuntimeError as error:
        raise RunError(f"{who}: {error}") from error
