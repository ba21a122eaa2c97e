"""Pixel by pixel one input wins whole: nearest depth, newest time."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from wall.data import Framelet, Rect
from wall.operators import kernels
from wall.operators.parts import bands, blank, corner, later, part

NOTHING = np.float32(np.nan)  # a key that loses against any


def choose(inputs: Sequence[Framelet], out: Framelet, region: Rect, *, key: str, sign: int) -> None:
    """Write the pixels of the input whose `key` is smallest (sign 1) or largest (-1); the earlier one of equals.

    Keys that are NaN never win; where no input has any other, the output is blank.
    """
    taken = np.empty((next(bands(region)).height, region.width), np.uint8)
    for band in bands(region):
        _choose_band(inputs, out, band, key, np.float32(sign), taken)


def _choose_band(
    inputs: Sequence[Framelet], out: Framelet, band: Rect, key: str, sign: np.float32, taken: NDArray[np.uint8]
) -> None:
    rest = [framelet for framelet in inputs if framelet.rect.meets(band)]
    doubtful = True
    if len(rest) > 1 and rest[0].rect.holds(band) and rest[1].rect.holds(band):
        doubtful = _fold(rest[0], rest[1], out, band, key, sign, taken) > 0
        rest = rest[2:]
    else:
        part(out, key, band)[...] = NOTHING
    for framelet in rest:
        if met := framelet.rect.meet(band):
            _fold(out, framelet, out, met, key, sign, taken)
    if doubtful:
        nothing = np.isnan(part(out, key, band))
        if nothing.any():
            blank(out, band, nothing)


def _fold(
    first: Framelet, second: Framelet, out: Framelet, rect: Rect, key: str, sign: np.float32, taken: NDArray[np.uint8]
) -> int:
    """The winners of two inputs; the first may be the output itself. Returns pixels where neither has a key."""
    shifts = (later(each, out) if key == "time" else np.float32(0.0) for each in (first, second))
    a, b = (
        (f.colour, f.channel(key), *corner(f, rect), shift) for f, shift in zip((first, second), shifts, strict=True)
    )
    place = (*corner(out, rect), rect.width, rect.height)
    nothing = int(kernels.choose(*a, *b, sign, out.colour, out.channel(key), *place, taken))
    won = taken[: rect.height, : rect.width].view(np.bool_)
    for name in out.channels - {"colour", key}:
        here = part(out, name, rect)
        for source, where in ((first, ~won), (second, won)):
            if source is not out:
                there = part(source, name, rect)
                there = there + later(source, out) if name == "time" else there
                np.copyto(here, there, where=where)
    return nothing
