"""`depth`: of several pictures of one view, the nearest surface at every pixel. Sort-last compositing.

After Porter and Duff's and Duff's z-compositing (Duff, Compositing 3-D rendered images, SIGGRAPH 1985).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar, Literal

from wall.data import Channels, Framelet, Rect
from wall.operators.base import Inputs, Operator
from wall.operators.winners import choose


class Depth(Operator):
    """Nearest wins; of equals the earlier input; NaN never. Pixels that no input covers are blank."""

    op: Literal["depth"]
    inputs: Inputs

    NEEDS: ClassVar[Channels] = frozenset({"colour", "depth"})
    MOVES: ClassVar[bool] = True
    COMMON_TIME: ClassVar[bool] = True

    def apply(self, inputs: Sequence[Framelet], out: Framelet, region: Rect, prepared: Any) -> None:
        choose(inputs, out, region, key="depth", sign=1)
