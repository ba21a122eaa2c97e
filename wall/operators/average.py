"""`average`: the mean of several images of one view, those of less variance weighing more.

Where every input knows its variance v, weights are 1 / v: of all weighted means that has the least variance,
1 / sum(1 / v) (Gauss-Markov). Else all count the same.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal

import numpy as np
from pydantic import Field

from wall.core.data import Float32, Framelet, Rect
from wall.operators.base import Inputs, Operator
from wall.operators.regions import bands, overlapping, pixels_of
from wall.operators.weighted_mean import WeightedInput, write_mean

SMALLEST = np.float32(1e-15)  # variance: of a thousand inputs, the square of the sum of 1 / it is finite in float32


class Average(Operator):
    """The mean of the inputs that cover a pixel, by running update, which cannot cancel.

    Inputs whose variance is infinite or no number there are left out, unless all are.
    """

    op: Literal["average"] = Field(description="the mean, better ones counting more")
    inputs: Inputs

    def apply(self, inputs: Sequence[Framelet], out: Framelet, region: Rect, prepared: Any) -> None:
        """Write the mean of a region."""
        weighted = all(framelet.variance is not None for framelet in inputs)
        for band in bands(region):
            parts = overlapping(inputs, band)
            weights = [_weight(framelet, rect) if weighted else _ones(rect) for framelet, rect in parts]
            if weighted:
                _use_all_where_none_counts(parts, weights, band)
            write_mean([WeightedInput(*each, weight) for each, weight in zip(parts, weights, strict=True)], out, band)


def _use_all_where_none_counts(parts: Sequence[tuple[Framelet, Rect]], weights: Sequence[Float32], band: Rect) -> None:
    none = np.ones((band.height, band.width), np.bool_)
    for (_, rect), weight in zip(parts, weights, strict=True):
        none[rect.inside(band)] &= weight == 0.0
    if none.any():
        for (_, rect), weight in zip(parts, weights, strict=True):
            weight[none[rect.inside(band)]] = 1.0


def _ones(rect: Rect) -> Float32:
    return np.ones((rect.height, rect.width), np.float32)


def _weight(framelet: Framelet, rect: Rect) -> Float32:
    """1 / variance, and 0 where that is infinite, negative or no number."""
    variance = pixels_of(framelet, "variance", rect)
    weight = np.zeros((rect.height, rect.width), np.float32)
    np.divide(1.0, np.maximum(variance, SMALLEST), out=weight, where=variance >= 0.0)
    return weight
