"""`tile`: pictures side by side. Sort-first placement."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar, Literal

from pydantic import Field

from wall.core.data import Framelet, Rect
from wall.operators.base import Inputs, Operator
from wall.operators.parts import blank, copy, covered


class Tile(Operator):
    """Every input at its place in the frame; where nothing lies, blank; where two lie, the later input."""

    op: Literal["tile"] = Field(description="framelets side by side")
    inputs: Inputs

    MOVES: ClassVar[bool] = True

    def apply(self, inputs: Sequence[Framelet], out: Framelet, region: Rect, prepared: Any) -> None:
        if not covered([framelet.rect for framelet in inputs], region):
            blank(out, region)
        for framelet in inputs:
            if met := framelet.rect.meet(region):
                copy(framelet, out, met)
