"""`blend_edges`: ramps for projectors that overlap, so that their light sums to one image.

A display emits v^gamma of the value v that it is sent. Of linear light L it is sent v = E(L), E the sRGB curve, so it
emits E(L)^gamma; to emit the share f of that, it must be sent f^(1/gamma) E(L). This operator works before the
encoding, hence gives L' = D(f^(1/gamma) E(L)), D the inverse of E. Two projectors that show L, one with the share f,
the other with 1 - f, then emit together f E(L)^gamma + (1 - f) E(L)^gamma, what one alone emits. Light is clipped to
0..1 first, as the display would: else an overlap could be brighter than white.

f = 3 t^2 - 2 t^3 of the position t of a pixel's centre in the ramp: f(t) + f(1 - t) = 1, without a visible kink.
Where four overlap, shares are products and sum to 1 too. After Bourke, Edge blending using commodity projectors, 2004,
with another ramp. Black that glows cannot be taken away: overlaps are brighter where the image is dark.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from annotated_types import Ge, Le
from pydantic import Field, model_validator

from wall.core.colour import srgb_decoded, srgb_encoded
from wall.core.data import Channels, Float64, Framelet, Rect
from wall.core.fields import Gamma, Whole, refusal
from wall.operators.base import Input, Operator
from wall.operators.regions import bands, copy, pixels_of

Ramp = Annotated[Whole, Ge(0), Le(16384)]


class BlendEdges(Operator):
    """Fades to black towards the edges that other projectors light too."""

    op: Literal["blend_edges"] = Field(description="ramps for projectors that overlap")
    input: Input
    left: Ramp = Field(default=0, description="width of the ramp, pixels; as wide as the overlap")
    right: Ramp = Field(default=0, description="likewise")
    top: Ramp = Field(default=0, description="likewise")
    bottom: Ramp = Field(default=0, description="likewise")
    gamma: Gamma = Field(default=2.2, description="of the display: light is value^gamma")

    LOSES: ClassVar[Channels] = frozenset({"variance"})  # the ramps are not linear

    @model_validator(mode="after")
    def _some_ramp(self) -> BlendEdges:
        if not (self.left or self.right or self.top or self.bottom):
            raise refusal("has no ramp", accepted="left, right, top or bottom: pixels")
        return self

    def apply(self, inputs: Sequence[Framelet], out: Framelet, region: Rect, prepared: Any) -> None:
        """Copy a region, darkened by the ramps."""
        source, whole = inputs[0], inputs[0].rect
        copy(source, out, region)
        across, down = shares(whole.width, self.left, self.right), shares(whole.height, self.top, self.bottom)
        for band in bands(region):
            rows, columns = band.inside(whole)
            share = down[rows][:, None] * across[columns]
            faded = share < 1.0
            if faded.any():
                here = pixels_of(out, "colour", band)
                value = srgb_encoded(here[faded]) * (share[faded] ** (1.0 / self.gamma))[:, None].astype(np.float32)
                here[faded] = srgb_decoded(value.astype(np.float32))


def shares(n: int, first: int, last: int) -> Float64:
    """(n,) float64: what each pixel of a row keeps of its light, with ramps `first` and `last` pixels wide."""
    centre = np.arange(n) + 0.5
    kept = np.ones(n)
    for width, distance in ((first, centre), (last, n - centre)):
        t = np.clip(distance / width, 0.0, 1.0) if width else kept
        kept = kept * t * t * (3.0 - 2.0 * t) if width else kept
    return kept
