"""`newest`, and whole pixels of `depth`: each from the input of the newest time, or of the nearest depth."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from wall.core.data import Channels, Framelet, Rect
from wall.operators.base import Inputs, Operator
from wall.operators.kernels import pixels as kernels
from wall.operators.regions import bands, blank, copy_where, corner_of, overlapping, pixels_of, time_shift, values_for

LOSES = np.float32(np.nan)  # a key that loses against any other


class Newest(Operator):
    """What was traced last: the newest `time_origin` + `time` wins; of equals the earlier input; NaN never."""

    op: Literal["newest"] = Field(description="what was traced last")
    inputs: Inputs

    NEEDS: ClassVar[Channels] = frozenset({"colour", "time"})
    MAKES: ClassVar[Channels] = frozenset({"time"})
    MOVES: ClassVar[bool] = True

    def apply(self, inputs: Sequence[Framelet], out: Framelet, region: Rect, prepared: Any) -> None:
        """Write the newest pixels of a region."""
        select(inputs, out, region, key="time", sign=-1)


def select(inputs: Sequence[Framelet], out: Framelet, region: Rect, *, key: str, sign: int) -> None:
    """Write the pixels of the input whose `key` is smallest (sign 1) or largest (-1); the earlier one of equals.

    Keys that are NaN are never taken; where no input has any other, the output is blank.
    """
    strips = list(bands(region)) if len(inputs) > 2 else [region]  # two inputs are read only once: nothing to cache
    size = (strips[0].height, region.width)
    selection = _Selection(out=out, key=key, sign=np.float32(sign), size=size)
    for strip in strips:
        selection.write(inputs, strip)


def bits(colour: NDArray[Any]) -> NDArray[Any]:
    """Colours as integers, to be moved but not computed with: (h, w, 3) uint32 of float32; uint8 as it is."""
    return colour if colour.dtype == np.uint8 else colour.view(np.uint32)


class _Selection:
    """Writes an output band by band, with a scratch mask of one band."""

    def __init__(self, *, out: Framelet, key: str, sign: np.float32, size: tuple[int, int]) -> None:
        self._out, self._key, self._sign = out, key, sign
        self._taken = np.empty(size, np.uint8)

    def write(self, inputs: Sequence[Framelet], band: Rect) -> None:
        """Select the pixels of one band."""
        out, rest = self._out, overlapping(inputs, band)
        may_miss = True
        if len(rest) > 1 and rest[0][1] == rest[1][1] == band:
            may_miss = self._write_better_of(rest[0][0], rest[1][0], band) > 0
            rest = rest[2:]
        else:
            pixels_of(out, self._key, band)[...] = LOSES
        for framelet, rect in rest:
            kernels.replace_worse(
                self._keyed(framelet, rect), self._sign, self._keyed(out, rect), rect.width, rect.height, self._taken
            )
            self._copy_others(framelet, rect, self._mask(rect))
        if may_miss and (missing := np.isnan(pixels_of(out, self._key, band))).any():
            blank(out, band, missing)

    def _write_better_of(self, first: Framelet, second: Framelet, rect: Rect) -> int:
        """Write from two inputs that cover the whole band. Returns how many pixels neither has."""
        out = self._keyed(self._out, rect)
        a, b = self._keyed(first, rect), self._keyed(second, rect)
        missing = int(kernels.write_better(a, b, self._sign, out, rect.width, rect.height, self._taken))
        if self._out.channels - {"colour", self._key}:
            self._copy_others(first, rect, ~self._mask(rect))
            self._copy_others(second, rect, self._mask(rect))
        return missing

    def _keyed(self, framelet: Framelet, rect: Rect) -> kernels.Keyed:
        shift = time_shift(framelet, self._out) if self._key == "time" else np.float32(0.0)
        return (bits(framelet.colour), framelet.channel(self._key), *corner_of(framelet, rect), shift)

    def _mask(self, rect: Rect) -> NDArray[np.bool_]:
        return self._taken[: rect.height, : rect.width].view(np.bool_)

    def _copy_others(self, framelet: Framelet, rect: Rect, where: NDArray[np.bool_]) -> None:
        """Copy the channels other than colour and key of the pixels that an input gives."""
        for name in self._out.channels - {"colour", self._key}:
            copy_where(values_for(self._out, framelet, name, rect), pixels_of(self._out, name, rect), where)
