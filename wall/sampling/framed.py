"""Framed sampling: every pixel once in raster order, all under one event, shown when complete.

Packets are 4 x 4 pixel blocks, so rays are as coherent as they can be. The threads of a rank share one frame: the
next one begins, under the newest event, when all have finished their part of it.
"""

from __future__ import annotations

import threading

import numpy as np

from wall.core.data import Event, Float32, Rect, Samples
from wall.sampling.base import Targets
from wall.sampling.ownership import block_order


class FrameCounter:
    """The frame that the threads of a rank share: its number and its event."""

    def __init__(self, workers: int) -> None:
        self._lock = threading.Lock()
        self._workers, self._finished = workers, workers
        self.number = 0
        self.event: Event | None = None

    def finish(self) -> None:
        """A thread has chosen all its positions of the frame."""
        with self._lock:
            self._finished += 1

    def unfinish(self) -> None:
        """A thread that had finished lost positions, and has to choose them again."""
        with self._lock:
            self._finished -= 1

    def begin(self, newest: Event, *, after: int) -> bool:
        """Start the frame after frame `after` if all threads have finished and the event is new; whether it runs."""
        with self._lock:
            if self.number > after:
                return True
            if self._finished < self._workers or (self.event is not None and self.event.number == newest.number):
                return False
            self.number, self.event, self._finished = self.number + 1, newest, 0
            return True

    def forget(self) -> None:
        """Forget the event, so that the next frame begins even if nothing has changed."""
        with self._lock:
            self.event = None


class FramedSampler:
    """One thread's pixels in raster order of 4 x 4 blocks, once a frame."""

    coherent = True

    def __init__(self, rect: Rect, counter: FrameCounter, *, batch: int, worker: int = 0, workers: int = 1) -> None:
        self._centres = (block_order(rect, worker=worker, workers=workers) + 0.5).astype(np.float32)
        self._counter, self._batch, self._area = counter, batch, rect.area
        self._frame, self._at = 0, len(self._centres)
        self._again: list[Float32] = []  # positions of this frame that were lost on the way

    def choose(self, newest: Event) -> Targets | None:
        """The next positions of the frame, lost ones first; None while the next frame may not begin."""
        if self._at >= len(self._centres) and not self._again:
            if not self._counter.begin(newest, after=self._frame):
                return None
            self._frame, self._at = self._counter.number, 0
        if self._again:
            xy = self._again.pop()
        else:
            xy = self._centres[self._at : self._at + self._batch]
            self._at += len(xy)
        if self._at >= len(self._centres) and not self._again:
            self._counter.finish()
        event = self._counter.event or newest
        return Targets(xy=xy, event=event, frame=self._frame, frame_samples=self._area)

    def observe(self, samples: Samples, base_time: float) -> None:
        """Ignore the samples: the order is fixed."""

    def forget(self, samples: Samples, base_time: float) -> None:
        """Choose the positions of these samples again in this frame."""
        if self._at >= len(self._centres) and not self._again:
            self._counter.unfinish()
        self._again.append(np.ascontiguousarray(samples["xy"]))

    def restart(self) -> None:
        """Begin another frame once this one is complete, even if nothing has changed."""
        self._counter.forget()
