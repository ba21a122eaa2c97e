"""`outline`: a line along the edges of a framelet, such as that of an inset."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from annotated_types import Ge, Le
from pydantic import Field

from wall.core.colour import srgb_codes
from wall.core.data import Framelet, Rect
from wall.core.fields import Reflectance, Whole
from wall.operators.base import Input, Operator
from wall.operators.regions import copy, pixels_of

Side = Literal["left", "top", "right", "bottom"]
SIDES: tuple[Side, ...] = ("left", "top", "right", "bottom")
LineWidth = Annotated[Whole, Ge(1), Le(256)]


class Outline(Operator):
    """One colour along the edges, just inside the framelet's rectangle; depth stays that of what is beneath."""

    op: Literal["outline"] = Field(description="a line along the edges")
    input: Input
    width: LineWidth = Field(default=2, description="pixels")
    color: Reflectance = Field(default=(1.0, 1.0, 1.0), description="linear RGB, 1: as bright as the display is")
    sides: Annotated[tuple[Side, ...], Field(min_length=1, max_length=4)] = Field(
        default=SIDES, description="left, top, right, bottom: which edges have one"
    )

    MOVES: ClassVar[bool] = True  # it draws into linear and encoded colour alike

    def lines(self, whole: Rect) -> list[Rect]:
        """Where the lines are."""
        x, y, width, height = whole.x, whole.y, whole.width, whole.height
        across, down = min(self.width, width), min(self.width, height)
        places = {
            "left": Rect(x=x, y=y, width=across, height=height),
            "top": Rect(x=x, y=y, width=width, height=down),
            "right": Rect(x=whole.right - across, y=y, width=across, height=height),
            "bottom": Rect(x=x, y=whole.bottom - down, width=width, height=down),
        }
        return [places[side] for side in self.sides]

    def apply(self, inputs: Sequence[Framelet], out: Framelet, region: Rect, prepared: Any) -> None:
        """Copy a region, with the lines over it."""
        copy(inputs[0], out, region)
        color = np.array(self.color, np.float32)
        for line in self.lines(out.rect):
            if (drawn := line.intersection(region)) is not None:
                pixels_of(out, "colour", drawn)[...] = srgb_codes(color) if out.encoded else color
                if out.alpha is not None:
                    pixels_of(out, "alpha", drawn)[...] = 1.0
