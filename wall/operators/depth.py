"""`depth`: the nearest surface of several images of one view at every pixel. Sort-last compositing.

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
from wall.operators.regions import bands, blank, corner_of, overlapping, pixels_of
from wall.operators.selection import bits, select

DENSE = 0.1  # share of a band: above it, taking all of it costs less than picking pixels
PICKED = ("colour", "depth", "alpha", "object_id")  # channels of pixels that are covered in part
SHAPE: dict[str, tuple[int, ...]] = {name: (3,) if name == "colour" else () for name in PICKED}  # of a pixel
BLANKS = {name: BLANK.get(name, (0.0, np.float32)) for name in PICKED}


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
        """What all have. Alpha if any has, the others' is 1; then pixels are of several, and times are lost."""
        given = frozenset.intersection(*inputs)
        return given if self.moves(inputs) else given & frozenset(PICKED) | {"alpha"}

    def apply(self, inputs: Sequence[Framelet], out: Framelet, region: Rect, prepared: Any) -> None:
        """Write the nearest pixels of a region."""
        if any(framelet.alpha is not None for framelet in inputs):
            for band in bands(region):
                _composite(overlapping(inputs, band), out, band)
        else:
            select(inputs, out, region, key="depth", sign=1)


def _composite(inputs: Sequence[tuple[Framelet, Rect]], out: Framelet, band: Rect) -> None:
    """Let the nearest win; then composite exactly the few pixels that something covers in part."""
    size = (band.height, band.width)
    near, alpha = np.full(size, np.inf, np.float32), np.zeros(size, np.float32)
    partial, taken = np.zeros(size, np.uint8), np.empty(size, np.uint8)
    blank(out, band)
    for framelet, rect in inputs:
        source = (bits(framelet.colour), framelet.channel("depth"), *corner_of(framelet, rect))
        target = (bits(out.colour), *corner_of(out, rect))
        before = (near, alpha, partial, taken, rect.x - band.x, rect.y - band.y)
        kernels_depth.replace_farther(source, framelet.alpha, target, before, rect.width, rect.height)
        if out.object_id is not None:
            won = taken[rect.inside(band)].view(np.bool_)
            np.copyto(pixels_of(out, "object_id", rect), pixels_of(framelet, "object_id", rect), where=won)
    for name, values in (("depth", near), ("alpha", alpha)):
        if name in out.channels:
            pixels_of(out, name, band)[...] = values
    count = int(np.count_nonzero(partial))
    if count:
        _fill(inputs, out, band, np.s_[:, :] if count > band.area * DENSE else np.nonzero(partial))


def _fill(inputs: Sequence[tuple[Framelet, Rect]], out: Framelet, band: Rect, some: Any) -> None:
    """Composite the pixels of a band that `some` picks from its array."""
    pixels = np.empty((band.height, band.width), np.bool_)[some].size
    stacks = {name: np.zeros((len(inputs), pixels, *SHAPE[name]), BLANKS[name][1]) for name in PICKED}
    for k, (framelet, rect) in enumerate(inputs):
        for name in PICKED if out.object_id is not None else PICKED[:3]:
            stacks[name][k] = _picked(framelet, name, rect, band, some).reshape(pixels, *SHAPE[name])
    stacks["alpha"][np.isnan(stacks["depth"])] = 0.0
    filled = Framelet.blank(Rect(x=0, y=0, width=pixels, height=1), frozenset(PICKED))
    kernels_depth.fill_by_depth(*stacks.values(), *(filled.channel(name)[0] for name in PICKED))
    for name in out.channels:
        here = pixels_of(out, name, band)
        here[some] = filled.channel(name)[0].reshape(here[some].shape)


def _picked(framelet: Framelet, name: str, rect: Rect, band: Rect, some: Any) -> NDArray[Any]:
    """A channel's pixels of a band; blank outside of `rect`, alpha 1 inside it where there is no alpha."""
    opaque = name == "alpha" and framelet.alpha is None
    if rect == band and not opaque:
        values: NDArray[Any] = pixels_of(framelet, name, band)[some]
        return values
    whole = np.full((band.height, band.width, *SHAPE[name]), *BLANKS[name])
    whole[rect.inside(band)] = 1.0 if opaque else pixels_of(framelet, name, rect)
    picked: NDArray[Any] = whole[some]
    return picked
