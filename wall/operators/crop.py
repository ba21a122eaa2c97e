"""`crop`: a rectangle of a framelet."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar, Literal

from pydantic import Field

from wall.core.data import Framelet, Rect
from wall.operators.base import AreaOperator, Input, area_rect
from wall.operators.regions import blank, copy


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
        if not inputs[0].rect.contains(region):
            blank(out, region)
        if overlap := inputs[0].rect.intersection(region):
            copy(inputs[0], out, overlap)
