"""`encode`: linear light to 8-bit sRGB for displays and pages."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal

from pydantic import Field

from wall.core.colour import srgb_curve
from wall.core.data import Framelet, Rect
from wall.operators.base import Input, Operator
from wall.operators.kernels import pixels as kernels
from wall.operators.regions import bands, copy, corner_of

_CURVE = srgb_curve()


class Encode(Operator):
    """8-bit sRGB, at most one code from its exact rounding; a quarter of the bytes. Other channels stay."""

    op: Literal["encode"] = Field(description="linear light to 8-bit sRGB")
    input: Input

    def apply(self, inputs: Sequence[Framelet], out: Framelet, region: Rect, prepared: Any) -> None:
        """Write the display values of a region."""
        source = inputs[0]
        copy(source, out, region, but=frozenset({"colour"}))
        for band in bands(region):
            target = (out.colour, *corner_of(out, band), band.width, band.height)
            kernels.encode(source.colour, *corner_of(source, band), _CURVE, *target)
