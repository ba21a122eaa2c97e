"""`colour`: gain, gamma, a 3D table, so that displays look alike, and opacity. `encode`: light to display values."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from annotated_types import Ge, Le
from pydantic import Field

from wall.core.colour import srgb_curve, srgb_decoded, srgb_encoded
from wall.core.data import Channels, Float32, Framelet, Rect
from wall.core.fields import Gamma, Number, Share, Text
from wall.operators.base import Input, Operator
from wall.operators.kernels import pixels as kernels
from wall.operators.lut import Lut, read_lut
from wall.operators.regions import bands, copy, corner_of, pixels_of

Gain = Annotated[Number, Ge(0.0), Le(1e6)]
_CURVE = srgb_curve()


class Colour(Operator):
    """table(gain * light ^ gamma), then opacity.

    The table takes and gives sRGB display values, for that is what such tables are measured in. Gamma and table work on
    the colour that is not yet multiplied by alpha; opacity scales premultiplied colour and alpha.
    """

    op: Literal["colour"] = Field(description="gain, gamma, 3D table, opacity")
    input: Input
    gain: Gain | tuple[Gain, Gain, Gain] = Field(default=1.0, description="factor of light: one, or red, green, blue")
    gamma: Gamma = Field(default=1.0, description="exponent of linear light, 1: as it comes; above 1 darkens")
    lut: Text | None = Field(default=None, description="3D table of display values, a .cube file")
    interpolation: Literal["tetrahedral", "trilinear"] = Field(
        default="tetrahedral", description="between the table's nodes: tetrahedral keeps greys grey"
    )
    opacity: Share = Field(default=1.0, description="0..1, scales colour and alpha")

    def gives(self, inputs: Sequence[Channels]) -> Channels:
        """Opacity below 1 adds alpha; what is not linear, or not alike in the three channels, loses the variance."""
        given = inputs[0] | ({"alpha"} if self.opacity < 1.0 else set())
        return given if self._linear and not isinstance(self.gain, tuple) else given - {"variance"}

    def prepare(self, folder: Path, inputs: Sequence[Rect]) -> Lut | None:
        """Read the table. Raises ConfigError."""
        return read_lut(folder / self.lut) if self.lut is not None else None

    def apply(self, inputs: Sequence[Framelet], out: Framelet, region: Rect, prepared: Lut | None) -> None:
        """Write the graded colours of a region."""
        source, gain = inputs[0], np.asarray(self.gain, np.float32)
        copy(source, out, region, but=frozenset({"colour", "alpha", "variance"}))
        for band in bands(region):
            here, there = pixels_of(out, "colour", band), pixels_of(source, "colour", band)
            alpha = pixels_of(source, "alpha", band) if source.alpha is not None else None
            if self._linear:
                here[...] = there * (gain * np.float32(self.opacity))
            else:
                self._grade(there, alpha, gain, prepared, here)
            if out.alpha is not None:
                opacity = np.float32(self.opacity)
                pixels_of(out, "alpha", band)[...] = opacity if alpha is None else opacity * alpha
            if out.variance is not None:
                pixels_of(out, "variance", band)[...] = (
                    pixels_of(source, "variance", band) * (gain * np.float32(self.opacity)) ** 2
                )

    @property
    def _linear(self) -> bool:
        return self.gamma == 1.0 and self.lut is None

    def _grade(self, there: Float32, alpha: Float32 | None, gain: Any, table: Lut | None, here: Float32) -> None:
        """Apply gamma, gain and table to the colour without alpha."""
        colour, scale = there, np.asarray(self.opacity, np.float32)
        if alpha is not None:
            seen = alpha > 0.0
            colour = np.divide(colour, alpha[..., None], out=colour.copy(), where=seen[..., None])
            scale = (scale * np.where(seen, alpha, np.float32(1.0)))[..., None]
        if self.gamma != 1.0:
            colour = np.maximum(colour, np.float32(0.0)) ** np.float32(self.gamma)
        colour = colour * gain
        if table is not None:
            looked = table(srgb_encoded(colour), tetrahedral=self.interpolation == "tetrahedral")
            colour = srgb_decoded(np.clip(looked, np.float32(0.0), np.float32(1.0)))
        here[...] = colour * scale


class Encode(Operator):
    """8-bit sRGB, at most one code from its exact rounding; a quarter of the bytes. Other channels stay."""

    op: Literal["encode"] = Field(description="linear light to 8-bit sRGB")
    input: Input

    def apply(self, inputs: Sequence[Framelet], out: Framelet, region: Rect, prepared: Any) -> None:
        """Write the display values of a region."""
        copy(inputs[0], out, region, but=frozenset({"colour"}))
        for band in bands(region):
            encode(inputs[0], out, band)


def encode(source: Framelet, out: Framelet, rect: Rect) -> None:
    """Write the display values of a rectangle inside both."""
    target = (out.colour, *corner_of(out, rect), rect.width, rect.height)
    kernels.encode(source.colour, *corner_of(source, rect), _CURVE, *target)
