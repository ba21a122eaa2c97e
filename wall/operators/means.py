"""Weighted means of pictures of one view, pixel by pixel."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from wall.core.data import Channels, Float32, Framelet, Rect
from wall.operators.kernels import pixels as kernels
from wall.operators.parts import blank, corner, later, part

OF_THE_HEAVIEST: Channels = frozenset({"depth", "time", "object_id"})


@dataclass(frozen=True, slots=True)
class Weighed:
    """A part of an input and its weights there."""

    framelet: Framelet
    rect: Rect
    weight: Float32  # (rect.height, rect.width); what is not above 0 has no influence


def mean(inputs: Sequence[Weighed], out: Framelet, band: Rect) -> None:
    """Write the weighted means of one band: colour, alpha, and the variance of the mean.

    Depth, time and object are those of the heaviest input, the earlier of equals: their mean would be of nothing.
    Where no weight is above 0, the output is blank. Colours must be finite.
    """
    blank(out, band)
    total, heaviest = (np.zeros((band.height, band.width), np.float32) for _ in range(2))
    variance = np.zeros_like(total)
    for each in inputs:
        here, size = each.rect.inside(band), (each.rect.width, each.rect.height)
        sums, source, target = total[here].copy(), corner(each.framelet, each.rect), corner(out, each.rect)
        kernels.gather(each.framelet.colour, each.weight, *source, out.colour, sums, *target, *size)
        if out.alpha is not None:
            planes = (each.framelet.channel("alpha")[..., None], out.alpha[..., None])
            kernels.gather(planes[0], each.weight, *source, planes[1], total[here].copy(), *target, *size)
        total[here] = sums
        if out.variance is not None:
            squared = each.weight * each.weight
            there = part(each.framelet, "variance", each.rect)
            variance[here] += np.multiply(squared, there, out=np.zeros_like(squared), where=squared > 0.0)
        if out.channels & OF_THE_HEAVIEST:
            _take_the_heavier(each, out, heaviest[here])
    if out.variance is not None:
        np.divide(variance, total * total, out=part(out, "variance", band), where=total > 0.0)


def _take_the_heavier(each: Weighed, out: Framelet, heaviest: Float32) -> None:
    heavier = each.weight > heaviest
    np.copyto(heaviest, each.weight, where=heavier)
    for name in out.channels & OF_THE_HEAVIEST:
        there = part(each.framelet, name, each.rect)
        there = there + later(each.framelet, out) if name == "time" else there
        np.copyto(part(out, name, each.rect), there, where=heavier)
