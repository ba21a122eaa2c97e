"""All panels cut into strips of whole pixel rows, one after the other: each rank renders what lies between two cuts.

A cut is a number of rows from the top of the first panel, through all panels in their order. It lies at the edge of a
panel, or a multiple of STEP rows below one and LEAST_ROWS away from both.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from wall.core.data import Float64, Rect, Region
from wall.core.errors import RemoteProtocolError

STEP = 4  # rows: of the blocks in which framed samples are traced
LEAST_ROWS = 8  # of a strip in a panel: enough for a row a thread

Cuts = tuple[int, ...]  # first 0, last the rows of all panels; one more than ranks; two that are equal: no strip


@dataclass(frozen=True, slots=True)
class Strips:
    """The panels, in order, each with one layer."""

    panels: tuple[Region, ...]  # each whole

    @property
    def _tops(self) -> NDArray[np.int64]:
        """(panels + 1,) the row at which each begins, and where the last ends."""
        return np.cumsum([0, *(panel.rect.height for panel in self.panels)])

    def top(self, region: Region) -> int:
        """The row at which a region begins, through all panels."""
        k = next(k for k, panel in enumerate(self.panels) if panel.layer == region.layer)
        return int(self._tops[k]) + region.rect.y

    @property
    def most_ranks(self) -> int:
        """How many ranks can have a strip each."""
        return max(1, (len(self._places()) - 1) // 2)

    def evenly(self, ranks: int) -> Cuts:
        """Cuts that give each rank the same number of rows, as nearly as may be."""
        return self.nearest(np.linspace(0.0, self._tops[-1], ranks + 1))

    def nearest(self, cuts: Float64) -> Cuts:
        """Cuts near those that are wanted, increasing, (ranks + 1,) rows, a strip for every rank."""
        places, count = self._places(), len(cuts) - 1
        found = np.abs(places[None] - np.asarray(cuts)[:, None]).argmin(axis=1)
        found[0], found[-1] = 0, len(places) - 1
        for k in range(1, count):  # two places apart are LEAST_ROWS, also within a panel
            found[k] = max(found[k], found[k - 1] + 2)
        for k in range(count - 1, 0, -1):
            found[k] = min(found[k], found[k + 1] - 2)
        return tuple(places[found].tolist())

    def regions(self, cuts: Sequence[int]) -> tuple[tuple[Region, ...], ...]:
        """The regions of each rank. Raises RemoteProtocolError for cuts that lie at no place or decrease."""
        if len(cuts) < 2 or not np.isin(cuts, self._places()).all() or (np.diff(cuts) < 0).any():
            raise RemoteProtocolError(f"cuts {list(cuts)[:8]} of {self._tops[-1]} rows; wanted: increasing places")
        if (cuts[0], cuts[-1]) != (0, self._tops[-1]):
            raise RemoteProtocolError(f"cuts from {cuts[0]} to {cuts[-1]}; wanted: 0 to {self._tops[-1]}")
        return tuple(tuple(self._between(top, bottom)) for top, bottom in pairwise(cuts))

    def _between(self, top: int, bottom: int) -> list[Region]:
        found = []
        for panel, start in zip(self.panels, self._tops[:-1].tolist(), strict=True):
            first, last = max(top - start, 0), min(bottom - start, panel.rect.height)
            if first < last:
                rect = Rect(x=0, y=first, width=panel.rect.width, height=last - first)
                found.append(Region(panel=panel.panel, rect=rect, layer=panel.layer, view=panel.view))
        return found

    def _places(self) -> NDArray[np.int64]:
        """Where cuts may lie."""
        tops = self._tops
        inside = [np.arange(top + LEAST_ROWS, bottom - LEAST_ROWS + 1, STEP) for top, bottom in pairwise(tops)]
        return np.unique(np.concatenate([tops, *inside]))


def equal_cost(rows: Float64, ranks: int) -> Float64:
    """Where cuts lie between which the rows cost the same.

    rows : (n,) cost of each, above 0. Returns (ranks + 1,) rows, with fractions.
    """
    total = np.concatenate([[0.0], np.cumsum(rows)])
    return np.interp(np.linspace(0.0, total[-1], ranks + 1), total, np.arange(len(total), dtype=np.float64))
