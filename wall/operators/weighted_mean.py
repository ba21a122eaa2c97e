"""Weighted means of framelets of one view, pixel by pixel."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from wall.core.data import Channels, Float32, Framelet, Rect
from wall.operators.kernels import pixels as kernels
from wall.operators.regions import blank, corner_of, pixels_of, values_for

OF_THE_HEAVIEST: Channels = frozenset({"depth", "time", "object_id"})  # a mean of two surfaces would be of neither


@dataclass(frozen=True, slots=True)
class WeightedInput:
    """A rectangle of an input and its weights there."""

    framelet: Framelet
    rect: Rect
    weight: Float32  # (rect.height, rect.width); what is not above 0 has no influence


def write_mean(inputs: Sequence[WeightedInput], out: Framelet, band: Rect) -> None:
    """Write the weighted means of one band: colour, alpha, and the variance of the mean.

    Depth, time and object are those of the heaviest input, the earlier of equals. Where no weight is above 0, the
    output is blank. Colours must be finite.
    """
    blank(out, band)
    total, heaviest = (np.zeros((band.height, band.width), np.float32) for _ in range(2))
    variance = np.zeros_like(total)
    for each in inputs:
        here = each.rect.inside(band)
        before, total[here] = total[here].copy(), _add_to_means(each, "colour", out, total[here].copy())
        if out.alpha is not None:
            _add_to_means(each, "alpha", out, before)
        if out.variance is not None:
            squared = each.weight * each.weight
            there = pixels_of(each.framelet, "variance", each.rect)
            variance[here] += np.multiply(squared, there, out=np.zeros_like(squared), where=squared > 0.0)
        if out.channels & OF_THE_HEAVIEST:
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
    for name in out.channels & OF_THE_HEAVIEST:
        values = values_for(out, each.framelet, name, each.rect)
        np.copyto(pixels_of(out, name, each.rect), values, where=heavier)
