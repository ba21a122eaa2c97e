"""`tile`, `crop`, `flip` and `rotate`: values at other positions, themselves unchanged."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from wall.core.data import Framelet, Rect
from wall.operators.base import AreaOperator, Input, Inputs, Operator, area_rect
from wall.operators.regions import copy_all, pixels_of, timed


class Tile(Operator):
    """Every input at its position in the frame; blank where none is, the later input where two are."""

    op: Literal["tile"] = Field(description="framelets side by side")
    inputs: Inputs

    MOVES: ClassVar[bool] = True

    def apply(self, inputs: Sequence[Framelet], out: Framelet, region: Rect, prepared: Any) -> None:
        """Copy every input's pixels of a region."""
        copy_all(inputs, out, region)


class Crop(AreaOperator):
    """The pixels of an area, at their positions."""

    op: Literal["crop"] = Field(description="a rectangle of a framelet")
    input: Input

    MOVES: ClassVar[bool] = True

    def rect(self, inputs: Sequence[Rect]) -> Rect:
        """The area; the input's own rectangle as long as a panel's id has not been replaced by its area."""
        return inputs[0] if self.area is None else area_rect(self.area)

    def apply(self, inputs: Sequence[Framelet], out: Framelet, region: Rect, prepared: Any) -> None:
        """Copy a region; pixels outside of the input are blank."""
        copy_all(inputs, out, region)


class Flip(Operator):
    """Mirrored in its own rectangle."""

    op: Literal["flip"] = Field(description="mirrored")
    input: Input
    axis: Literal["horizontal", "vertical"] = Field(description="horizontal: left becomes right; vertical: top, bottom")

    KEEPS_RAYS: ClassVar[bool] = False
    MOVES: ClassVar[bool] = True

    def touched(self, rect: Rect, inputs: Sequence[Rect], k: int) -> Rect:
        """The mirrored rectangle."""
        whole = inputs[0]
        x = whole.x + whole.right - rect.right if self.axis == "horizontal" else rect.x
        y = whole.y + whole.bottom - rect.bottom if self.axis == "vertical" else rect.y
        return Rect(x=x, y=y, width=rect.width, height=rect.height)

    def apply(self, inputs: Sequence[Framelet], out: Framelet, region: Rect, prepared: Any) -> None:
        """Write the mirrored pixels of a region."""
        axis = 1 if self.axis == "horizontal" else 0
        for name in out.channels:
            _write(inputs[0], out, region, name, np.flip(inputs[0].channel(name), axis=axis))


class Rotate(Operator):
    """Turned clockwise; the top left corner of its rectangle stays."""

    op: Literal["rotate"] = Field(description="turned clockwise")
    input: Input
    degrees: Literal[90, 180, 270] = Field(description="clockwise, as the viewer sees it")

    KEEPS_RAYS: ClassVar[bool] = False
    MOVES: ClassVar[bool] = True

    def rect(self, inputs: Sequence[Rect]) -> Rect:
        """The same corner; width and height are exchanged at 90 and 270 degrees."""
        return self._turned(inputs[0].x, inputs[0].y, inputs[0])

    def touched(self, rect: Rect, inputs: Sequence[Rect], k: int) -> Rect:
        """The turned rectangle."""
        whole = inputs[0]
        x, y, right, bottom = rect.x - whole.x, rect.y - whole.y, whole.right - rect.right, whole.bottom - rect.bottom
        left, top = {90: (bottom, x), 180: (right, bottom), 270: (y, right)}[self.degrees]
        return self._turned(whole.x + left, whole.y + top, rect)

    def apply(self, inputs: Sequence[Framelet], out: Framelet, region: Rect, prepared: Any) -> None:
        """Write the turned pixels of a region."""
        for name in out.channels:
            _write(inputs[0], out, region, name, np.rot90(inputs[0].channel(name), k=-self.degrees // 90))

    def _turned(self, x: int, y: int, rect: Rect) -> Rect:
        width, height = (rect.width, rect.height) if self.degrees == 180 else (rect.height, rect.width)
        return Rect(x=x, y=y, width=width, height=height)


def _write(source: Framelet, out: Framelet, region: Rect, name: str, turned: NDArray[Any]) -> None:
    """Write a region from `turned`, a view of the source's channel as large as the output's."""
    pixels_of(out, name, region)[...] = timed(out, source, name, turned[region.inside(out.rect)])
