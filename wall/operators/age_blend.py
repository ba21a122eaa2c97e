"""`age_blend`: the mean of several images of one view, newer values weighing more."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar, Literal

import numpy as np
from pydantic import Field

from wall.core.data import Channels, Float32, Framelet, Rect
from wall.core.fields import Period
from wall.operators.base import Inputs, Operator
from wall.operators.regions import bands, overlapping, values_for
from wall.operators.weighted_mean import WeightedInput, write_mean


class AgeBlend(Operator):
    """The mean with weights exp(-age / tau_s) of each pixel's age; what was never traced counts nothing.

    Only differences of age matter, so they are taken against the newest input at each pixel: no clock is needed, and
    its weight is 1 however old it is.
    """

    op: Literal["age_blend"] = Field(description="the older the paler")
    inputs: Inputs
    tau_s: Period = Field(description="age at which a value counts 1/e = 0.37 as much, seconds")

    NEEDS: ClassVar[Channels] = frozenset({"colour", "time"})

    def apply(self, inputs: Sequence[Framelet], out: Framelet, region: Rect, prepared: Any) -> None:
        """Write the weighted mean of a region."""
        for band in bands(region):
            newest = np.full((band.height, band.width), -np.inf, np.float32)
            timed = [(f, rect, values_for(out, f, "time", rect)) for f, rect in overlapping(inputs, band)]
            for _, rect, time in timed:
                here = newest[rect.inside(band)]
                np.fmax(here, time, out=here)
            weights = (self._weight(time, newest[rect.inside(band)]) for _, rect, time in timed)
            write_mean([WeightedInput(f, rect, w) for (f, rect, _), w in zip(timed, weights, strict=True)], out, band)

    def _weight(self, time: Float32, newest: Float32) -> Float32:
        known = np.isfinite(time)
        older = np.subtract(time, newest, out=np.zeros_like(time), where=known)
        weight: Float32 = np.exp(older * np.float32(1.0 / self.tau_s), out=np.zeros_like(time), where=known)
        return weight
