"""Renderers that share one core, or less, take turns: what one is doing is finished before the next one goes on.

Where a core is shared out a few milliseconds at a time, all of their images are ready when the last one is. In turns
the first one is ready after a fraction of that, and the last one is no later. A turn may take long, and its process may
die or be frozen: nobody waits for longer than LONGEST_S.
"""

from __future__ import annotations

import multiprocessing
import os
import time
from collections.abc import Callable

LONGEST_S = 0.25  # until a renderer goes on whoever's turn it is: then there may be two turns at a time for a while
HELD_S = 0.05  # a turn is longer where an image of a new view is to be shown, but not by more than this


class Turns:
    """Made before those who share it are forked; each of them has a copy, and `begin`s and `end`s its turns."""

    def __init__(self, now: Callable[[], float] = time.monotonic) -> None:
        """`now`: seconds; no clock that a recorded renderer is told."""
        self._now = now
        self._free = multiprocessing.get_context("fork").Semaphore(1)
        self._began: float | None = None  # this process's turn, seconds; None: it has none

    def begin(self) -> bool:
        """Wait for a turn, unless this process has it. Returns whether the others have none."""
        if self._began is not None:
            return True
        alone = self._free.acquire(timeout=LONGEST_S)
        while self._free.acquire(block=False):  # of one who did not wait for it
            pass
        self._began = self._now()
        return alone

    def end(self, *, hold: bool = False) -> None:
        """End the turn, and let others go on; `hold`: not yet, if it is not a long one already."""
        if self._began is not None and not (hold and self._now() < self._began + HELD_S):
            self._began = None
            self._free.release()
            os.sched_yield()  # else this process could begin its next one before who waits has woken up
