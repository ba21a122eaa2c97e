"""`newest`: what was traced last of several images of one view at every pixel."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar, Literal

from pydantic import Field

from wall.core.data import Channels, Framelet, Rect
from wall.operators.base import Inputs, Operator
from wall.operators.selection import select


class Newest(Operator):
    """The newest `time_origin` + `time` wins; of equals the earlier input; NaN never."""

    op: Literal["newest"] = Field(description="what was traced last")
    inputs: Inputs

    NEEDS: ClassVar[Channels] = frozenset({"colour", "time"})
    MAKES: ClassVar[Channels] = frozenset({"time"})
    MOVES: ClassVar[bool] = True

    def apply(self, inputs: Sequence[Framelet], out: Framelet, region: Rect, prepared: Any) -> None:
        """Write the newest pixels of a region."""
        select(inputs, out, region, key="time", sign=-1)
