"""An image that comes to rest: what its pixels accumulated counts little, and tiles are resolved ever more seldom."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wall.deepbuffer.kernels.accumulation import MEAN_ALONE, limit_counts
from wall.deepbuffer.pose_tracker import PoseTracker
from wall.deepbuffer.store import PixelHistory

OTHER_MOMENTS = MEAN_ALONE - np.float32(1.0)  # samples that a mean of these counts as at rest


class RestSchedule:
    """When tiles in which nothing moves are resolved anew: what moved there may have left holes, samples fill them.

    First after a sixteenth of a sample a pixel, or an eighth where only some tiles moved, then after twice as many,
    and so on, until pixels show their own means. Once in INTERVAL_S at most: meanwhile pixels show what they have.
    """

    INTERVAL_S = 0.1
    FIRST, AGAIN = 1.0 / 16.0, 1.0 / 8.0  # samples a pixel

    def __init__(self, arrived: NDArray[np.int32], pixels: int, *, last: float = float(MEAN_ALONE)) -> None:
        """arrived : (rows, columns) samples that came to tiles of `pixels`; counted by others, here set to 0.

        last : samples a pixel, with which it shows its own mean
        """
        self._arrived, self._last = arrived, int(last * pixels)
        self._first, self._again = max(int(self.FIRST * pixels), 1), max(int(self.AGAIN * pixels), 1)
        self._due = np.full_like(arrived, self._first)
        self._next = float("-inf")  # not before, seconds

    def move(self, tiles: NDArray[np.bool_] | None = None) -> None:
        """Something moved in these tiles, in all if None: they were resolved."""
        chosen = slice(None) if tiles is None else tiles
        self._arrived[chosen], self._due[chosen] = 0, self._first if tiles is None else self._again
        self._next = float("-inf") if tiles is None else self._next

    def take_due(self, now: float) -> NDArray[np.bool_]:
        """(rows, columns) bool of tiles that are to be resolved anew, at `now` seconds."""
        due: NDArray[np.bool_] = (self._arrived >= self._due) & (self._due <= self._last) & (now >= self._next)
        if due.any():
            self._next = now + self.INTERVAL_S
        late = due
        while late.any():
            self._due[late] *= 2
            late = self._due <= np.minimum(self._arrived, self._last)
        return due


def come_to_rest(poses: PoseTracker, history: PixelHistory) -> None:
    """To be called once nothing moves any more: samples accumulated at other times of the scene now weigh little.

    Too little for any pixel to be complete: what moved last may cover it, or shade it, and no sample has told yet.
    """
    if poses.spans_moments:
        poses.spans_moments = False
        limit_means(history)


def limit_means(history: PixelHistory, tiles: NDArray[np.bool_] | None = None) -> None:
    """Let what pixels accumulated weigh too little for any of them to be complete; `tiles`: (rows, columns), or all."""
    chosen = np.ones_like(history.dirty) if tiles is None else tiles
    limit_counts(chosen, history.accumulation, OTHER_MOMENTS)
    history.dirty[chosen] = True
