"""`depth`: of several pictures of one view, the nearest surface at every pixel. Sort-last compositing.

After Porter and Duff's and Duff's z-compositing (Duff, Compositing 3-D rendered images, SIGGRAPH 1985).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar, Literal

import numpy as np

from wall.data import Channels, Framelet, Rect
from wall.operators import kernels_depth
from wall.operators.base import Inputs, Operator
from wall.operators.parts import BAND_PIXELS, part
from wall.operators.winners import choose


class Depth(Operator):
    """Nearest wins; of equals the earlier input; NaN never. Pixels that no input covers are blank.

    Where inputs have alpha, what covers a pixel in part leaves the rest of it to what is behind. Inputs without alpha
    are opaque.
    """

    op: Literal["depth"]
    inputs: Inputs

    NEEDS: ClassVar[Channels] = frozenset({"colour", "depth"})
    USES: ClassVar[Channels] = frozenset({"alpha", "object"})
    COMMON_TIME: ClassVar[bool] = True

    def moves(self, inputs: Sequence[Channels]) -> bool:
        """Whole pixels win, unless they may be covered in part."""
        return not any("alpha" in channels for channels in inputs)

    def gives(self, inputs: Sequence[Channels]) -> Channels:
        """What all have. Alpha if any has, the others' is 1; then no times and variances: pixels are of several."""
        given = frozenset.intersection(*inputs)
        return given if self.moves(inputs) else given - {"time", "variance"} | {"alpha"}

    def apply(self, inputs: Sequence[Framelet], out: Framelet, region: Rect, prepared: Any) -> None:
        if any(framelet.alpha is not None for framelet in inputs):
            _fill(inputs, out, region)
        else:
            choose(inputs, out, region, key="depth", sign=1)


def _fill(inputs: Sequence[Framelet], out: Framelet, region: Rect) -> None:
    rows = max(1, BAND_PIXELS // (region.width * len(inputs)))
    for y in range(region.y, region.bottom, rows):
        band = Rect(x=region.x, y=y, width=region.width, height=min(rows, region.bottom - y))
        _fill_band([framelet for framelet in inputs if framelet.rect.meets(band)], out, band)


def _fill_band(inputs: Sequence[Framelet], out: Framelet, band: Rect) -> None:
    size = (len(inputs), band.height, band.width)
    colour, depth = np.zeros((*size, 3), np.float32), np.full(size, np.inf, np.float32)
    alpha = np.zeros(size, np.float32)
    thing = np.zeros(size, np.uint32) if out.object is not None else None
    for k, framelet in enumerate(inputs):
        met = framelet.rect.meet(band)
        assert met is not None
        here = (k, *met.inside(band))
        colour[here], depth[here] = part(framelet, "colour", met), part(framelet, "depth", met)
        alpha[here] = part(framelet, "alpha", met) if framelet.alpha is not None else 1.0
        if thing is not None and framelet.object is not None:
            thing[here] = part(framelet, "object", met)
    alpha[np.isnan(depth)] = 0.0
    pixels = band.area
    filled = Framelet.blank(band, out.channels)
    kernels_depth.fill_by_depth(
        colour.reshape(-1, pixels, 3), depth.reshape(-1, pixels), alpha.reshape(-1, pixels),
        None if thing is None else thing.reshape(-1, pixels),
        filled.colour.reshape(pixels, 3), *(None if c is None else c.reshape(pixels) for c in (
            filled.depth, filled.alpha, filled.object)),
    )  # fmt: skip
    for name in out.channels:
        part(out, name, band)[...] = filled.channel(name)
