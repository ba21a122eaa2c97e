"""`crop`: a rectangle of a picture."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar, Literal

from pydantic import Field, model_validator

from wall.core.data import Framelet, Rect
from wall.core.fields import Name, refusal
from wall.operators.base import Area, Input, Operator
from wall.operators.parts import blank, copy


class Crop(Operator):
    """Nothing but the pixels of an area, at the place where they were."""

    op: Literal["crop"] = Field(description="a rectangle of a framelet")
    input: Input
    area: Area | None = Field(default=None, description="x, y, width, height in the frame, pixels")
    panel: Name | None = Field(default=None, description="id of the panel whose pixels are kept, instead of an area")

    MOVES: ClassVar[bool] = True

    @model_validator(mode="after")
    def _one_of_two(self) -> Crop:
        if (self.area is None) == (self.panel is None):
            raise refusal("needs either an area or a panel", accepted="area: [x, y, width, height] or panel: ID")
        return self

    def rect(self, inputs: Sequence[Rect]) -> Rect:
        """The area; the input's own rectangle as long as a panel's id has not been replaced by its area."""
        if self.area is None:
            return inputs[0]
        x, y, width, height = self.area
        return Rect(x=x, y=y, width=width, height=height)

    def apply(self, inputs: Sequence[Framelet], out: Framelet, region: Rect, prepared: Any) -> None:
        if not inputs[0].rect.holds(region):
            blank(out, region)
        if met := inputs[0].rect.meet(region):
            copy(inputs[0], out, met)
