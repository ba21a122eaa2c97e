"""`over`: transparent images on top of each other, in order. Ordered sort-last compositing.

Source: Porter and Duff, Compositing digital images, SIGGRAPH 1984; colours are premultiplied by alpha.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar, Literal

import numpy as np
from pydantic import Field

from wall.core.data import Channels, Framelet, Rect
from wall.operators.base import Inputs, Operator
from wall.operators.kernels import pixels as kernels
from wall.operators.regions import bands, blank, copy_where, corner_of, overlapping, pixels_of, values_for


class Over(Operator):
    """Inputs by their `order`, the smallest nearest; of equal orders the earlier input is nearer.

    Depth, time and object are those of the nearest input that is not fully transparent there; variances are summed by
    the squared share that each input has in the colour.
    """

    op: Literal["over"] = Field(description="transparent layers in order")
    inputs: Inputs

    NEEDS: ClassVar[Channels] = frozenset({"colour", "alpha"})
    MAKES: ClassVar[Channels] = frozenset({"alpha"})

    def apply(self, inputs: Sequence[Framelet], out: Framelet, region: Rect, prepared: Any) -> None:
        """Write the composited pixels of a region."""
        ordered = sorted(inputs, key=lambda framelet: framelet.order)
        for band in bands(region):
            blank(out, band)
            for framelet, rect in overlapping(ordered, band):
                _add_behind(framelet, out, rect)
            if out.variance is not None:
                variance, alpha = pixels_of(out, "variance", band), pixels_of(out, "alpha", band)
                variance[alpha == 0.0] = np.inf


def _add_behind(framelet: Framelet, out: Framelet, rect: Rect) -> None:
    if out.channels - {"colour", "alpha"}:
        _other_channels(framelet, out, rect)
    source = (framelet.colour, framelet.channel("alpha"), *corner_of(framelet, rect))
    kernels.add_behind(*source, out.colour, out.channel("alpha"), *corner_of(out, rect), rect.width, rect.height)


def _other_channels(framelet: Framelet, out: Framelet, rect: Rect) -> None:
    before, alpha = pixels_of(out, "alpha", rect), pixels_of(framelet, "alpha", rect)
    seen = (before == 0.0) & (alpha > 0.0)
    for name in out.channels - {"colour", "alpha", "variance"}:
        copy_where(values_for(out, framelet, name, rect), pixels_of(out, name, rect), seen)
    if out.variance is not None:
        total, added = (pixels_of(f, "variance", rect) for f in (out, framelet))
        total[seen] = 0.0  # it was infinite: nothing
        through = 1.0 - before
        there = (alpha > 0.0) & (through > 0.0)
        total[there] += through[there] ** 2 * added[there]
