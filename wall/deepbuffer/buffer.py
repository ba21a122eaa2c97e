"""The samples of one panel, newest per pixel, and what they show.

One owner (the compositor that reconstructs the panel), arrays allocated once: 61 bytes a pixel, twice that for
framed sources, whose unfinished frame waits in a second set of arrays.
"""

from __future__ import annotations

import numpy as np

from wall.data import Batch, Counters, Float32
from wall.deepbuffer import kernels

JITTER_POSITIONS = 4  # samples of one event after which a blended pixel is complete


class _Records:
    """Arrays of one picture; see kernels.insert for shapes."""

    def __init__(self, width: int, height: int) -> None:
        shape = (height, width)
        self.shown, self.history, self.mean = (np.zeros((*shape, 3), np.float32) for _ in range(3))
        self.count = np.zeros(shape, np.uint16)
        self.depth = np.full(shape, np.inf, np.float32)
        self.objects = np.zeros(shape, np.uint32)
        self.times = np.full(shape, -np.inf, np.float64)
        self.keys = np.zeros(shape, np.uint64)
        self.dirty = np.zeros((-(-height // kernels.TILE), -(-width // kernels.TILE)), np.bool_)

    def insert(self, batch: Batch) -> tuple[int, int]:
        key = np.uint64((batch.camera_event << 32) | batch.scene_event)
        complete_at = 1 if batch.blend >= 1.0 else JITTER_POSITIONS
        late, outside = kernels.insert(
            batch.samples,
            batch.base_time,
            key,
            np.float32(batch.blend),
            self.shown,
            self.history,
            self.mean,
            self.count,
            self.depth,
            self.objects,
            self.times,
            self.keys,
            self.dirty,
            complete_at,
        )
        return int(late), int(outside)


class DeepBuffer:
    """insert(batch) folds samples in; `radiance` is what they show; `take_dirty()` says which tiles changed."""

    def __init__(self, width: int, height: int) -> None:
        self.width, self.height = width, height
        self.counters = Counters()
        self.samples_shown = 0
        self.newest_event = (-1, -1)  # of the samples in the picture
        self._front = _Records(width, height)
        self._back: dict[int, _Frame] = {}  # by rank: the frame that is being put together

    @property
    def radiance(self) -> Float32:
        """(h, w, 3) float32 linear RGB, updated in place by insert()."""
        return self._front.shown

    @property
    def records(self) -> _Records:
        return self._front

    def insert(self, batch: Batch) -> None:
        """Show a batch at once, or, for double-buffered frames, when its frame is complete."""
        if batch.frame == 0:
            self._show(batch)
            return
        frame = self._back.get(batch.rank)
        if frame is None or batch.frame > frame.number:
            if frame is not None and frame.seen:
                self.counters.add("frame_incomplete", frame.seen)
            frame = self._back[batch.rank] = _Frame(batch.frame)
        if batch.frame < frame.number:
            self.counters.add("late", len(batch.samples))
            return
        frame.batches.append(batch)
        frame.seen += len(batch.samples) + batch.skipped
        if frame.seen >= batch.frame_samples:
            for part in frame.batches:
                self._show(part)
            self._back[batch.rank] = _Frame(batch.frame)

    def _show(self, batch: Batch) -> None:
        late, outside = self._front.insert(batch)
        self.counters.add("late", late)
        self.counters.add("outside", outside)
        shown = len(batch.samples) - late - outside
        self.samples_shown += shown
        if shown and (batch.camera_event, batch.scene_event) > self.newest_event:
            self.newest_event = (batch.camera_event, batch.scene_event)

    def take_dirty(self) -> np.ndarray[tuple[int, int], np.dtype[np.bool_]]:
        """(rows, columns) bool of 16-pixel tiles changed since the last call."""
        dirty = self._front.dirty.copy()
        self._front.dirty[:] = False
        return dirty

    def oldest_sample(self, now: float) -> float:
        """Age in seconds of the oldest sample shown; inf while a pixel never had one."""
        least, never = kernels.oldest(self._front.times)
        return float("inf") if never else max(0.0, now - float(least))


class _Frame:
    """A double-buffered frame under way: its batches, shown together when all samples are there."""

    def __init__(self, number: int) -> None:
        self.number, self.seen = number, 0
        self.batches: list[Batch] = []
