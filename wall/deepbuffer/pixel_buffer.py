"""The samples of one panel, newest per pixel, and what they show.

One owner (the compositor that reconstructs the panel), allocated once: 64 bytes a pixel. The batches of an
unfinished double-buffered frame wait beside it, 37 bytes a pixel.
"""

from __future__ import annotations

from collections import Counter

import numpy as np
from numpy.typing import NDArray

from wall.core.data import NO_EDITS, STILL, Batch, Camera, Edits, Float32, Float64, Rect
from wall.deepbuffer.arrivals import NEVER
from wall.deepbuffer.kernels import pixel_buffer as kernels

MOST_TIMES, MOST_MORE = 2, 1 << 16  # samples of a frame that are kept: lost packets are traced again, few of them
JITTER_POSITIONS = 4  # samples of one event after which a blended pixel is complete


class PixelBuffer:
    """insert(batch) folds samples in; `radiance` is what they show; `take_dirty()` says which tiles changed."""

    def __init__(self, width: int, height: int) -> None:
        self.width, self.height = width, height
        self.counters = Counter[str]()
        self.samples_shown = 0
        self.newest_event = NEVER  # of the samples shown
        self.newest_moment: tuple[Camera, float, Edits] = (STILL, 0.0, NO_EDITS)  # of that event, with its scene time
        self.records = np.zeros((height, width), kernels.PIXEL)
        self.records["time"], self.records["depth"] = -np.inf, np.inf
        self._dirty = np.zeros((-(-height // kernels.TILE), -(-width // kernels.TILE)), np.bool_)
        self.changed: NDArray[np.bool_] | None = None  # (h, w): pixels that got samples, while somebody notes them
        self.frames: dict[int, tuple[int, int]] = {}  # by rank: the event of the newest whole frame
        self._back: dict[int, _Frame] = {}  # by rank: the frame that is being put together

    @property
    def radiance(self) -> Float32:
        """(h, w, 3) float32 linear RGB: a view that insert() writes through."""
        shown: Float32 = self.records["shown"]
        return shown

    def insert(self, batch: Batch) -> None:
        """Show a batch at once, or, for double-buffered frames, when its frame is complete."""
        if batch.frame == 0:
            self._show(batch)
            return
        order = (batch.camera_event, batch.scene_event, batch.frame)
        frame = self._back.get(batch.rank)
        if frame is None or order > frame.order or batch.rect != frame.rect:
            if frame is not None and frame.batches:
                self.counters["frame_incomplete"] += frame.arrived
            frame = self._back[batch.rank] = _Frame(order, batch.rect, self.width, self.height)
        if order < frame.order or frame.shown:
            self.counters["late"] += len(batch.samples)
            return
        if frame.take(batch) >= batch.frame_samples:
            for part in frame.batches:
                self._show(part)
            frame.finish()
            self.frames[batch.rank] = order[:2]

    def _show(self, batch: Batch) -> None:
        key = _key_of(batch)
        complete_at = 1 if batch.blend >= 1.0 else JITTER_POSITIONS
        late, outside = kernels.insert(
            batch.samples, batch.base_time, key, np.float32(batch.blend), self.records, self._dirty, complete_at
        )
        self.counters += Counter(late=late, outside=outside)
        if self.changed is not None:
            self.changed.reshape(-1)[_pixels_of(batch, self.width, self.height)] = True
        shown = len(batch.samples) - late - outside
        self.samples_shown += shown
        if shown and (batch.camera_event, batch.scene_event) > self.newest_event:
            self.newest_event = (batch.camera_event, batch.scene_event)
            self.newest_moment = batch.camera, batch.scene_time, batch.edits

    def show_image(self, radiance: Float32, times: Float64) -> None:
        """Show an image until samples come: `radiance` (h, w, 3) of pixels traced at `times` (h, w), -inf = never."""
        self.records["shown"], self.records["time"] = radiance, times
        self.records["count"] = np.isfinite(times)
        self._dirty[:] = True
        if self.changed is not None:
            self.changed[:] = True

    def take_dirty(self) -> np.ndarray[tuple[int, int], np.dtype[np.bool_]]:
        """(rows, columns) bool of 16-pixel tiles changed since the last call."""
        dirty = self._dirty.copy()
        self._dirty[:] = False
        return dirty

    def oldest_sample(self, now: float) -> float:
        """Age in seconds of the oldest sample shown; inf while a pixel never had one."""
        least, never = kernels.oldest(self.records)
        return float("inf") if never else max(0.0, now - float(least))


def _key_of(batch: Batch) -> np.uint64:
    """Grows with the batch's event, and again where that is no longer a foreseen one."""
    return np.uint64(batch.camera_event + batch.scene_event << 1 | (not batch.foreseen))


def count_of(key: int) -> int:
    """The sum of both numbers of the event that a pixel's key is of: with each event of a view it grows."""
    return key >> 1


def _pixels_of(batch: Batch, width: int, height: int) -> NDArray[np.int64]:
    """The pixels, y * width + x, in which samples lie; those outside are left out."""
    x, y = np.floor(batch.samples["xy"]).astype(np.int64).T
    inside = (x >= 0) & (y >= 0) & (x < width) & (y < height)
    pixels: NDArray[np.int64] = (y * width + x)[inside]
    return pixels


class _Frame:
    """A double-buffered frame under way: its batches, shown together when every pixel is there.

    Pixels are counted, not samples: a repeated packet, or one that was lost and traced again, must not complete a
    frame that has holes. Frames are ordered by their event first: a rank that starts again counts from 1.
    """

    def __init__(self, order: tuple[int, int, int], rect: Rect, width: int, height: int) -> None:
        self.rect = rect  # of the renderer's region
        self.order, self.arrived, self.shown = order, 0, False
        self.batches: list[Batch] = []
        self._sequences: set[int] = set()
        self._most = MOST_TIMES * width * height + MOST_MORE
        self._seen = np.zeros(height * width, np.bool_)
        self._width, self._height, self._pixels, self._skipped = width, height, 0, 0

    def take(self, batch: Batch) -> int:
        """Keep a batch; returns how many pixels of the frame are there, those skipped as unusable included."""
        if batch.sequence not in self._sequences and self.arrived + len(batch.samples) <= self._most:
            self._sequences.add(batch.sequence)
            self.batches.append(batch)
            self._skipped += batch.skipped
            self.arrived += len(batch.samples) + batch.skipped
            pixels = _pixels_of(batch, self._width, self._height)
            fresh = np.unique(pixels[~self._seen[pixels]])
            self._seen[fresh] = True
            self._pixels += len(fresh)
        return self._pixels + self._skipped

    def finish(self) -> None:
        """Marks the frame as displayed: its samples that arrive from now on are late."""
        self.shown, self.batches = True, []
