"""`average` and `age_blend`: weighted means of several images of one view, pixel by pixel."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Literal

import numpy as np
from pydantic import Field

from wall.core.data import Channels, Float32, Framelet, Rect
from wall.core.fields import Period
from wall.operators.base import Inputs, Operator
from wall.operators.kernels import pixels as kernels
from wall.operators.regions import MIXED, WHOLE, bands, blank, corner_of, overlapping, pixels_of, values_for

SMALLEST = np.float32(1e-15)  # variance: of a thousand inputs, the square of the sum of 1 / it is finite in float32


class Average(Operator):
    """The mean of the inputs that cover a pixel, by running update, which cannot cancel.

    Where every input knows its variance v, weights are 1 / v: of all weighted means that has the least variance,
    1 / sum(1 / v) (Gauss-Markov). Else all count the same. Inputs whose variance is infinite or no number there are
    left out, unless all are.
    """

    op: Literal["average"] = Field(description="the mean, better ones counting more")
    inputs: Inputs

    def apply(self, inputs: Sequence[Framelet], out: Framelet, region: Rect, prepared: Any) -> None:
        """Write the mean of a region."""
        weighted = all(framelet.variance is not None for framelet in inputs)
        for band in bands(region):
            parts = [WeightedInput(f, rect, _precision(f, rect, weighted)) for f, rect in overlapping(inputs, band)]
            if weighted:
                _use_all_where_none_counts(parts, band)
            write_mean(parts, out, band)


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
            parts = [WeightedInput(f, rect, self._weight(t, newest[rect.inside(band)])) for f, rect, t in timed]
            write_mean(parts, out, band)

    def _weight(self, time: Float32, newest: Float32) -> Float32:
        known = np.isfinite(time)
        older = np.subtract(time, newest, out=np.zeros_like(time), where=known)
        weight: Float32 = np.exp(older * np.float32(1.0 / self.tau_s), out=np.zeros_like(time), where=known)
        return weight


def _use_all_where_none_counts(parts: Sequence[WeightedInput], band: Rect) -> None:
    none = np.ones((band.height, band.width), np.bool_)
    for part in parts:
        none[part.rect.inside(band)] &= part.weight == 0.0
    for part in parts if none.any() else ():
        part.weight[none[part.rect.inside(band)]] = 1.0


def _precision(framelet: Framelet, rect: Rect, weighted: bool) -> Float32:
    """1 / variance, and 0 where that is infinite, negative or no number; all 1 unless `weighted`."""
    if not weighted:
        return np.ones((rect.height, rect.width), np.float32)
    variance = pixels_of(framelet, "variance", rect)
    weight = np.zeros((rect.height, rect.width), np.float32)
    np.divide(1.0, np.maximum(variance, SMALLEST), out=weight, where=variance >= 0.0)
    return weight


@dataclass(frozen=True, slots=True)
class WeightedInput:
    """A rectangle of an input and its weights there."""

    framelet: Framelet
    rect: Rect
    weight: Float32  # (rect.height, rect.width); what is not above 0 has no influence


def write_mean(inputs: Sequence[WeightedInput], out: Framelet, band: Rect) -> None:
    """Write the weighted means of one band: colour, alpha, albedo, normal, and the variance of the mean.

    Depth, time and object are those of the heaviest input, the earlier of equals. Where no weight is above 0, the
    output is blank. Colours must be finite.
    """
    blank(out, band)
    total, heaviest = (np.zeros((band.height, band.width), np.float32) for _ in range(2))
    variance = np.zeros_like(total)
    for each in inputs:
        here = each.rect.inside(band)
        before, total[here] = total[here].copy(), _add_to_means(each, "colour", out, total[here].copy())
        for name in out.channels & MIXED - {"colour", "variance"}:
            _add_to_means(each, name, out, before.copy())
        if out.variance is not None:
            squared = each.weight * each.weight
            there = pixels_of(each.framelet, "variance", each.rect)
            variance[here] += np.multiply(squared, there, out=np.zeros_like(squared), where=squared > 0.0)
        if out.channels & WHOLE:
            _take_the_heavier(each, out, heaviest[here])
    if out.variance is not None:
        np.divide(variance, total * total, out=pixels_of(out, "variance", band), where=total > 0.0)


def _add_to_means(each: WeightedInput, name: str, out: Framelet, total: Float32) -> Float32:
    """Fold one channel of an input into the means; `total`, the weights so far, is updated and returned."""
    source, target = (f.channel(name).reshape(*f.channel(name).shape[:2], -1) for f in (each.framelet, out))
    target_rect = (*corner_of(out, each.rect), each.rect.width, each.rect.height)
    kernels.add_to_means(source, each.weight, *corner_of(each.framelet, each.rect), target, total, *target_rect)
    return total


def _take_the_heavier(each: WeightedInput, out: Framelet, heaviest: Float32) -> None:
    heavier = each.weight > heaviest
    np.copyto(heaviest, each.weight, where=heavier)
    for name in out.channels & WHOLE:
        values = values_for(out, each.framelet, name, each.rect)
        np.copyto(pixels_of(out, name, each.rect), values, where=heavier)
