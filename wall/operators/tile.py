"""`tile`: framelets side by side. Sort-first compositing."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar, Literal

from pydantic import Field

from wall.core.data import Framelet, Rect
from wall.operators.base import Inputs, Operator
from wall.operators.regions import blank, copy, covers, overlapping


class Tile(Operator):
    """Every input at its position in the frame; blank where none is, the later input where two are."""

    op: Literal["tile"] = Field(description="framelets side by side")
    inputs: Inputs

    MOVES: ClassVar[bool] = True

    def apply(self, inputs: Sequence[Framelet], out: Framelet, region: Rect, prepared: Any) -> None:
        """Copy every input's pixels of a region."""
        if not covers([framelet.rect for framelet in inputs], region):
            blank(out, region)
        for framelet, rect in overlapping(inputs, region):
            copy(framelet, out, rect)
