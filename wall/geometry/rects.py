"""Rectangles of the virtual screen: a panel's, and many at once."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from wall.core.data import Rect
from wall.geometry.panels import Panel

Cover = tuple[Rect, ...]  # that do not meet each other


def panel_rect(panel: Panel) -> Rect:
    """The rectangle of a panel in the virtual screen."""
    (x, y), (width, height) = panel.screen, panel.pixels
    return Rect(x=x, y=y, width=width, height=height)


class Rects:
    """Many rectangles, to find quickly those that meet one."""

    def __init__(self, rects: Sequence[Rect]) -> None:
        self._rects = rects
        self._x, self._y, self._right, self._bottom = (
            np.array([(r.x, r.y, r.right, r.bottom) for r in rects], np.int64).reshape(-1, 4).T.copy()
        )

    def meeting(self, rect: Rect, before: int | None = None) -> list[int]:
        """Indices of the rectangles that overlap one; only of the first `before`."""
        n = slice(before)
        across = (self._x[n] < rect.right) & (rect.x < self._right[n])
        found: list[int] = np.flatnonzero(across & (self._y[n] < rect.bottom) & (rect.y < self._bottom[n])).tolist()
        return found

    def left_of(self, rect: Rect, before: int | None = None) -> Cover:
        """The parts of a rectangle that none of them covers."""
        left: Cover = (rect,)
        for k in self.meeting(rect, before):
            left = tuple(part for kept in left for part in kept.minus(self._rects[k]))
        return left
