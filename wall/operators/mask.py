"""`mask`: remove parts of a framelet, by a rectangle or by the luminance of an image file."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import ClassVar, Literal

import numpy as np
from pydantic import Field

from wall.core.data import BLANK, Channels, Float32, Framelet, Rect
from wall.core.errors import ConfigError
from wall.core.fields import Flag, Text
from wall.operators.base import Area, Input, Operator, area_rect
from wall.operators.image_file import read_image
from wall.operators.regions import bands, copy, pixels_of


class Mask(Operator):
    """Colour and alpha times the mask; where that is 0, what is behind shows.

    The mask is 1 inside an area and 0 outside, or a file's linear luminance, clipped to 0..1; the file must be as large
    as the input.
    """

    op: Literal["mask"] = Field(description="parts taken away")
    input: Input
    area: Area | None = Field(default=None, description="x, y, width, height in the frame: what is kept")
    file: Text | None = Field(default=None, description="PNG or EXR: what is kept, instead of an area")
    invert: Flag = Field(default=False, description="keep the rest instead")

    ONE_OF: ClassVar[tuple[str, str, str] | None] = ("area", "file", "area: [x, y, width, height] or file: NAME")

    def gives(self, inputs: Sequence[Channels]) -> Channels:
        """With alpha: what is removed becomes transparent."""
        return inputs[0] | {"alpha"}

    def covers(self, rect: Rect, inputs: Sequence[Rect], k: int) -> tuple[Rect, ...]:
        """What the area leaves; all of `rect` for a file, which is not read yet."""
        if self.area is None:
            return (rect,)
        area = area_rect(self.area)
        kept = rect.intersection(area)
        return rect.minus(area) if self.invert else () if kept is None else (kept,)

    def prepare(self, folder: Path, inputs: Sequence[Rect]) -> Float32 | None:
        """(h, w) float32, the file's mask. Raises ConfigError when its size is not the input's."""
        if self.file is None:
            return None
        kept: Float32 = np.clip(read_image(folder / self.file).luminance(), np.float32(0.0), np.float32(1.0))
        came, wanted = kept.shape[::-1], (inputs[0].width, inputs[0].height)
        if came != wanted:
            raise ConfigError(
                f"mask '{self.id}': {self.file} is {came[0]} x {came[1]} pixels, wanted {wanted[0]} x {wanted[1]}"
            )
        return kept

    def apply(self, inputs: Sequence[Framelet], out: Framelet, region: Rect, prepared: Float32 | None) -> None:
        """Copy a region times the mask."""
        source = inputs[0]
        if source.alpha is None and out.alpha is not None:
            pixels_of(out, "alpha", region)[...] = 1.0
        copy(source, out, region, but=frozenset({"alpha"} if source.alpha is None else ()))
        for band in bands(region):
            kept = self._rectangle(band) if prepared is None else prepared[band.inside(source.rect)]
            _keep(out, band, np.float32(1.0) - kept if self.invert else kept)

    def _rectangle(self, band: Rect) -> Float32:
        kept = np.zeros((band.height, band.width), np.float32)
        if self.area is not None and (overlap := area_rect(self.area).intersection(band)):
            kept[overlap.inside(band)] = 1.0
        return kept


def _keep(out: Framelet, band: Rect, share: Float32) -> None:
    removed = share == 0.0
    pixels_of(out, "colour", band)[...] *= share[..., None]
    pixels_of(out, "colour", band)[removed] = 0.0  # NaN times 0 is not
    for name in out.channels - {"colour"}:
        here = pixels_of(out, name, band)
        if name == "alpha":
            here *= share
        if name == "variance":
            np.multiply(here, share * share, out=here, where=~removed)
        here[removed] = BLANK[name][0]
