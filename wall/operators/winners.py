"""Pixel by pixel one input wins whole: nearest depth, newest time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wall.core.data import Framelet, Rect
from wall.operators.kernels import pixels as kernels
from wall.operators.parts import bands, blank, corner, later, part

NOTHING = np.float32(np.nan)  # a key that loses against any


def choose(inputs: Sequence[Framelet], out: Framelet, region: Rect, *, key: str, sign: int) -> None:
    """Write the pixels of the input whose `key` is smallest (sign 1) or largest (-1); the earlier one of equals.

    Keys that are NaN never win; where no input has any other, the output is blank.
    """
    contest = _Contest(out=out, key=key, sign=np.float32(sign), width=region.width, height=next(bands(region)).height)
    for band in bands(region):
        contest.hold(inputs, band)


def bits(colour: NDArray[Any]) -> NDArray[Any]:
    """Colours as numbers that can only be moved: (h, w, 3) uint32 of float32; uint8 as it is."""
    return colour if colour.dtype == np.uint8 else colour.view(np.uint32)


class _Contest:
    """Winners of an output, band by band, with scratch for one band."""

    def __init__(self, *, out: Framelet, key: str, sign: np.float32, width: int, height: int) -> None:
        self._out, self._key, self._sign = out, key, sign
        self._taken = np.empty((height, width), np.uint8)

    def hold(self, inputs: Sequence[Framelet], band: Rect) -> None:
        out, rest = self._out, [framelet for framelet in inputs if framelet.rect.meets(band)]
        doubtful = True
        if len(rest) > 1 and rest[0].rect.holds(band) and rest[1].rect.holds(band):
            doubtful = self._first_two(rest[0], rest[1], band) > 0
            rest = rest[2:]
        else:
            part(out, self._key, band)[...] = NOTHING
        for framelet in rest:
            if met := framelet.rect.meet(band):
                self._challenge(framelet, met)
        if doubtful and (nothing := np.isnan(part(out, self._key, band))).any():
            blank(out, band, nothing)

    def _first_two(self, first: Framelet, second: Framelet, rect: Rect) -> int:
        target = (self._sign, *self._target(rect), self._taken)
        nothing = int(kernels.choose(*self._source(first, rect), *self._source(second, rect), *target))
        won = self._taken[: rect.height, : rect.width].view(np.bool_)
        self._others(first, rect, ~won)
        self._others(second, rect, won)
        return nothing

    def _challenge(self, framelet: Framelet, rect: Rect) -> None:
        kernels.challenge(*self._source(framelet, rect), self._sign, *self._target(rect), self._taken)
        self._others(framelet, rect, self._taken[: rect.height, : rect.width].view(np.bool_))

    def _source(self, framelet: Framelet, rect: Rect) -> tuple[Any, ...]:
        shift = later(framelet, self._out) if self._key == "time" else np.float32(0.0)
        return (bits(framelet.colour), framelet.channel(self._key), *corner(framelet, rect), shift)

    def _target(self, rect: Rect) -> tuple[Any, ...]:
        return (bits(self._out.colour), self._out.channel(self._key), *corner(self._out, rect), rect.width, rect.height)

    def _others(self, framelet: Framelet, rect: Rect, won: NDArray[np.bool_]) -> None:
        """The other channels of the pixels that an input has won."""
        for name in self._out.channels - {"colour", self._key}:
            there = part(framelet, name, rect)
            there = there + later(framelet, self._out) if name == "time" else there
            np.copyto(part(self._out, name, rect), there, where=won)
