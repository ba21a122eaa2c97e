"""`depth`: of several pictures of one view, the nearest surface at every pixel. Sort-last compositing.

After Porter and Duff's and Duff's z-compositing (Duff, Compositing 3-D rendered images, SIGGRAPH 1985).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from wall.core.data import BLANK, Channels, Framelet, Rect
from wall.operators.base import Inputs, Operator
from wall.operators.kernels import depth as kernels_depth
from wall.operators.parts import bands, blank, corner, part
from wall.operators.winners import bits, choose

DENSE = 0.1  # share of a band: above it, taking all of it costs less than picking pixels
EVERY: Channels = frozenset({"colour", "depth", "alpha", "object_id"})


class Depth(Operator):
    """Nearest wins; of equals the earlier input; NaN never. Pixels that no input covers are blank.

    Where inputs have alpha, what covers a pixel in part leaves the rest of it to what is behind. Inputs without alpha
    are opaque.
    """

    op: Literal["depth"] = Field(description="nearest wins")
    inputs: Inputs

    NEEDS: ClassVar[Channels] = frozenset({"colour", "depth"})
    USES: ClassVar[Channels] = frozenset({"alpha", "object_id"})
    MAKES: ClassVar[Channels] = frozenset({"depth"})
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
    for band in bands(region):
        _fill_band([framelet for framelet in inputs if framelet.rect.meets(band)], out, band)


def _fill_band(inputs: Sequence[Framelet], out: Framelet, band: Rect) -> None:
    """Nearest wins; then again, exactly, the few pixels that something covers in part."""
    size = (band.height, band.width)
    near, covered = np.full(size, np.inf, np.float32), np.zeros(size, np.float32)
    partial, taken = np.zeros(size, np.uint8), np.empty(size, np.uint8)
    blank(out, band)
    for framelet in inputs:
        met = framelet.rect.meet(band)
        assert met is not None
        source = (bits(framelet.colour), framelet.channel("depth"), framelet.alpha, *corner(framelet, met))
        target, within = (bits(out.colour), *corner(out, met)), (met.x - band.x, met.y - band.y)
        kernels_depth.put_before(*source, *target, near, covered, partial, taken, *within, met.width, met.height)
        if out.object_id is not None:
            won = taken[met.inside(band)].view(np.bool_)
            np.copyto(part(out, "object_id", met), part(framelet, "object_id", met), where=won)
    for name, values in (("depth", near), ("alpha", covered)):
        if name in out.channels:
            part(out, name, band)[...] = values
    count = int(np.count_nonzero(partial))
    if count > band.area * DENSE:
        _fill_pixels(inputs, out, band, np.s_[:, :])
    elif count:
        _fill_pixels(inputs, out, band, np.nonzero(partial))


def _fill_pixels(inputs: Sequence[Framelet], out: Framelet, band: Rect, some: Any) -> None:
    """Those pixels of a band that `some` picks of its array."""
    pixels = np.empty((band.height, band.width), np.bool_)[some].size
    size = (len(inputs), pixels)
    colour, depth, alpha = np.empty((*size, 3), np.float32), np.empty(size, np.float32), np.empty(size, np.float32)
    thing = np.zeros(size, np.uint32)
    for k, framelet in enumerate(inputs):
        colour[k] = _picked(framelet, "colour", band, some).reshape(pixels, 3)
        depth[k] = _picked(framelet, "depth", band, some).ravel()
        alpha[k] = _picked(framelet, "alpha", band, some).ravel()
        if out.object_id is not None:
            thing[k] = _picked(framelet, "object_id", band, some).ravel()
    alpha[np.isnan(depth)] = 0.0
    filled = Framelet.blank(Rect(x=0, y=0, width=pixels, height=1), EVERY)
    result = (filled.colour[0], filled.channel("depth")[0], filled.channel("alpha")[0], filled.channel("object_id")[0])
    kernels_depth.fill_by_depth(colour, depth, alpha, thing, *result)
    for name in out.channels:
        here = part(out, name, band)
        here[some] = filled.channel(name)[0].reshape(here[some].shape)


def _picked(framelet: Framelet, name: str, band: Rect, some: Any) -> NDArray[Any]:
    """A channel's pixels of a band; blank where the framelet is not, alpha 1 where it is and has none."""
    met = framelet.rect.meet(band)
    opaque = name == "alpha" and framelet.alpha is None
    if met == band and not opaque:
        values: NDArray[Any] = part(framelet, name, band)[some]
        return values
    assert met is not None
    value, kind = BLANK.get(name, (0.0, np.float32))
    whole = np.full((band.height, band.width, *([3] if name == "colour" else [])), value, kind)
    whole[met.inside(band)] = 1.0 if opaque else part(framelet, name, met)
    picked: NDArray[Any] = whole[some]
    return picked
