"""`denoise`: Intel's Open Image Denoise, through the optional package pyoidn, which brings the library with it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import ClassVar, Literal

import numpy as np
from pydantic import Field

from wall.core.data import Channels, Float32, Framelet, Rect
from wall.core.errors import ConfigError, RunError
from wall.operators.base import Input, Operator
from wall.operators.regions import copy, pixels_of

INSTALL = "pip install 'pyoidn>=2.5'"
Denoiser = Callable[..., Float32]


class Denoise(Operator):
    """A network estimates the image behind the noise, with albedos and normals where they are known.

    Every pixel may depend on every other. Any change redoes the whole image, so it is for sinks that show few images a
    second.
    """

    op: Literal["denoise"] = Field(description="Open Image Denoise")
    input: Input
    quality: Literal["fast", "balanced", "high"] = Field(default="balanced", description="the faster, the coarser")

    USES: ClassVar[Channels] = frozenset({"albedo", "normal"})  # samples of paths bring them
    LOSES: ClassVar[Channels] = frozenset({"variance"})  # that of the estimate is unknown

    def touched(self, rect: Rect, inputs: Sequence[Rect], k: int) -> Rect:
        """Returns the rectangle of the output that changes with input `k` in `rect`: the whole image, in pixels."""
        return inputs[0]

    def prepare(self, folder: Path, inputs: Sequence[Rect]) -> Denoiser:
        """Raises ConfigError saying what to install if pyoidn is missing, too old, or cannot load its library."""
        try:
            from pyoidn import denoise
        except (ImportError, OSError) as error:
            raise ConfigError(
                f"denoise '{self.id}': cannot use pyoidn ({error}), wanted it installed: {INSTALL}"
            ) from error
        return denoise  # type: ignore[no-any-return]

    def apply(self, inputs: Sequence[Framelet], out: Framelet, region: Rect, prepared: Denoiser) -> None:
        """Raises RunError when the library fails."""
        source = inputs[0]
        copy(source, out, region, but=frozenset({"colour"}))
        try:
            noisy = np.maximum(source.colour, np.float32(0.0))
            colour = prepared(noisy, hdr=True, quality=self.quality, **_surfaces(source))
        except RuntimeError as error:
            raise RunError(f"denoise '{self.id}': {error}") from error
        pixels_of(out, "colour", region)[...] = colour[region.inside(source.rect)]


def _surfaces(source: Framelet) -> dict[str, Float32]:
    """The framelet's albedo and normal; none where it has none, or they are blank: no sample brought any."""
    if source.albedo is None or source.normal is None or not source.albedo.any():
        return {}
    return {"albedo": np.clip(source.albedo, np.float32(0.0), np.float32(1.0)), "normal": source.normal}
