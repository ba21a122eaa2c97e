"""`flip` and `rotate`: pictures for displays that are mounted mirrored or turned."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from wall.core.data import Framelet, Rect
from wall.operators.base import Input, Operator
from wall.operators.parts import later


class Flip(Operator):
    """Mirrored in its own rectangle."""

    op: Literal["flip"] = Field(description="mirrored")
    input: Input
    axis: Literal["horizontal", "vertical"] = Field(description="horizontal: left becomes right; vertical: top, bottom")

    KEEPS_RAYS: ClassVar[bool] = False
    MOVES: ClassVar[bool] = True

    def touched(self, rect: Rect, inputs: Sequence[Rect], k: int) -> Rect:
        whole = inputs[0]
        x = whole.x + whole.right - rect.right if self.axis == "horizontal" else rect.x
        y = whole.y + whole.bottom - rect.bottom if self.axis == "vertical" else rect.y
        return Rect(x=x, y=y, width=rect.width, height=rect.height)

    def apply(self, inputs: Sequence[Framelet], out: Framelet, region: Rect, prepared: Any) -> None:
        axis = 1 if self.axis == "horizontal" else 0
        for name in out.channels:
            _put(inputs[0], out, region, name, np.flip(inputs[0].channel(name), axis=axis))


class Rotate(Operator):
    """Turned clockwise, its top left corner where it was."""

    op: Literal["rotate"] = Field(description="turned clockwise")
    input: Input
    degrees: Literal[90, 180, 270] = Field(description="clockwise, as the viewer sees it")

    KEEPS_RAYS: ClassVar[bool] = False
    MOVES: ClassVar[bool] = True

    def rect(self, inputs: Sequence[Rect]) -> Rect:
        """The same corner; width and height change places at 90 and 270 degrees."""
        rect = inputs[0]
        size = (rect.width, rect.height) if self.degrees == 180 else (rect.height, rect.width)
        return Rect(x=rect.x, y=rect.y, width=size[0], height=size[1])

    def touched(self, rect: Rect, inputs: Sequence[Rect], k: int) -> Rect:
        whole = inputs[0]
        x, y, right, bottom = rect.x - whole.x, rect.y - whole.y, whole.right - rect.right, whole.bottom - rect.bottom
        left, top = {90: (bottom, x), 180: (right, bottom), 270: (y, right)}[self.degrees]
        size = (rect.width, rect.height) if self.degrees == 180 else (rect.height, rect.width)
        return Rect(x=whole.x + left, y=whole.y + top, width=size[0], height=size[1])

    def apply(self, inputs: Sequence[Framelet], out: Framelet, region: Rect, prepared: Any) -> None:
        for name in out.channels:
            _put(inputs[0], out, region, name, np.rot90(inputs[0].channel(name), k=-self.degrees // 90))


def _put(source: Framelet, out: Framelet, region: Rect, name: str, turned: NDArray[Any]) -> None:
    """`turned` is a view of the source's channel, as large as the output's."""
    here = region.inside(out.rect)
    shift = later(source, out)
    out.channel(name)[here] = turned[here] + shift if name == "time" and shift != 0.0 else turned[here]
