"""Colour maps: numbers to colours, for data in a scene and for legends on a wall.

The tables are Matplotlib's: all but coolwarm and turbo are even steps to the eye, and none is a rainbow with bands.
"""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
from annotated_types import Ge, Le
from pydantic import Field, model_validator

from wall.core.colour import srgb_decoded
from wall.core.data import Float32, Float64
from wall.core.fields import Flag, Model, Number, Reflectance, refusal

STEPS = 256  # of a table; colours between them are blended
Bound = Annotated[Number, Ge(-1e300), Le(1e300)]


class ColorMap(Model):
    """Which colours stand for which numbers."""

    name: Literal["cividis", "coolwarm", "gray", "inferno", "magma", "plasma", "turbo", "twilight", "viridis"] = Field(
        default="viridis",
        description="cividis is for all kinds of colour blindness; coolwarm shows both sides of a middle; twilight is "
        "for angles: its ends are one colour; gray; turbo tells most values apart, at the cost of even steps",
    )
    range: tuple[Bound, Bound] | None = Field(
        default=None, description="the numbers at both ends; absent = the least and the greatest of the data"
    )
    scale: Literal["linear", "log"] = Field(default="linear", description="log: equal ratios are equal steps")
    reversed: Flag = Field(default=False, description="from the last colour to the first")
    below: Reflectance | None = Field(
        default=None, description="linear RGB, 0..1, of numbers below the range; absent = as its lower end"
    )
    above: Reflectance | None = Field(
        default=None, description="linear RGB, 0..1, of numbers above the range; absent = as its upper end"
    )
    missing: Reflectance = Field(
        default=(0.6, 0.0, 0.6),
        description="linear RGB, 0..1, where there is no number (NaN), and where a log scale has none",
    )

    @model_validator(mode="after")
    def _grows(self) -> ColorMap:
        if self.range is None:
            return self
        low, high = self.range
        if low >= high:
            raise refusal(f"{low:g} is not below {high:g}", accepted="[lower, upper]", at=("range",))
        if self.scale == "log" and low <= 0.0:
            raise refusal(f"{low:g} has no logarithm", accepted="two numbers above 0", at=("range",))
        return self

    def over(self, values: Float64) -> ColorMap:
        """This map with the range of `values` where it has none; one number gets a range about it."""
        if self.range is not None:
            return self
        known = values[np.isfinite(values) & ((values > 0.0) | (self.scale == "linear"))]
        low, high = (float(known.min()), float(known.max())) if len(known) else (0.0, 1.0)
        if low >= high:
            low, high = (low / 2.0, low * 2.0) if self.scale == "log" and low > 0.0 else (low - 0.5, low + 0.5)
        return self.model_copy(update={"range": (low, high)})

    def places(self, values: Float64) -> Float64:
        """Where numbers lie in the range, 0 at its lower end and 1 at its upper; NaN where there is no number."""
        low, high = self.range or (0.0, 1.0)
        with np.errstate(divide="ignore", invalid="ignore"):
            if self.scale == "log":
                logarithms = np.log(np.where(values > 0.0, values, np.nan))
                return np.asarray((logarithms - np.log(low)) / (np.log(high) - np.log(low)), np.float64)
            return np.asarray((values - low) / (high - low), np.float64)

    def colors(self, values: Float64) -> Float32:
        """(n, 3) linear RGB of numbers (n,), by the map's range, or theirs."""
        whole = self.over(values)
        places = whole.places(values)
        table = self.table()
        at = np.clip(np.nan_to_num(places), 0.0, 1.0) * (len(table) - 1)
        first = np.minimum(at.astype(np.intp), len(table) - 2)
        share = (at - first).astype(np.float32)[:, None]
        found = srgb_decoded((1.0 - share) * table[first] + share * table[first + 1])
        for color, where in ((self.below, places < 0.0), (self.above, places > 1.0), (self.missing, np.isnan(places))):
            if color is not None:
                found[where] = color
        return found

    def described(self, values: Float64, called: str) -> tuple[str, ...]:
        """Notes for a reader: the range, where the map takes it from `values`, and how many are not shown by it."""
        whole = self.over(values)
        places = whole.places(values)
        low, high = whole.range or (0.0, 1.0)
        notes = [] if self.range is not None else [f"{called}: colours from {low:.6g} to {high:.6g}"]
        outside = int(np.count_nonzero((places < 0.0) | (places > 1.0)))
        missing = int(np.count_nonzero(np.isnan(places)))
        if outside:
            notes.append(f"{called}: {outside} of {len(values)} values lie outside {low:.6g} to {high:.6g}")
        if missing:
            notes.append(f"{called}: {missing} of {len(values)} values are no numbers that the colour map has")
        return tuple(notes)

    def table(self) -> Float32:
        """(256, 3) sRGB values, 0..1, from the lower end of the range to the upper."""
        import matplotlib  # 0.1 s, that scenes without data do not wait for

        rows = matplotlib.colormaps[self.name].resampled(STEPS)(np.arange(STEPS))[:, :3].astype(np.float32)
        return rows[::-1] if self.reversed else rows
