"""The deep buffer: samples kept as points of their objects, so that they can be reprojected to later cameras.

After Dayal et al., "Adaptive Frameless Rendering", 2005. One owner, allocated once; it never grows.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from wall.core.data import Camera, Samples
from wall.core.threads import Threads
from wall.deepbuffer.kernels import accumulation as kernels_accumulation
from wall.deepbuffer.kernels import change as kernels_change
from wall.deepbuffer.kernels import cuts as kernels_cuts
from wall.deepbuffer.kernels import doubt as kernels_doubt
from wall.deepbuffer.kernels import insert as kernels_insert
from wall.deepbuffer.kernels import reproject as kernels_reproject
from wall.deepbuffer.kernels import reproject_rows as kernels_rows
from wall.deepbuffer.kernels import sort as kernels_sort
from wall.deepbuffer.kernels.accumulation import BITS
from wall.deepbuffer.kernels.columns import BEFORE
from wall.deepbuffer.kernels.coverage import count_by_cell
from wall.deepbuffer.kernels.doubt import FRESH
from wall.deepbuffer.kernels.evict import AGES, evict, oldest_kept
from wall.deepbuffer.kernels.pixel_buffer import TILE
from wall.deepbuffer.kernels.reproject import BLOCK
from wall.deepbuffer.pose import Posed
from wall.deepbuffer.pose_tracker import PoseTracker
from wall.deepbuffer.rest import OTHER_MOMENTS
from wall.deepbuffer.store import PixelHistory, SampleStore

SAMPLES_PER_PIXEL = 4  # kept on average
SLACK = 1.0  # samples a pixel that may arrive, or wait for removal, between two refreshes
LARGEST_BATCH = 4096  # samples, for which there is always room
SORT_EVERY = 8  # refreshes, by object
BY_TILE_EVERY = 4  # sorts: then by tile first; neighbours stay neighbours for long
CLOCK_ORIGIN_S = 512.0  # then the store's clock starts anew: its float32 seconds step by 1/32768 at most
CLOCK_STEP_S = np.float32(2.0**-15)  # of the store's clock at most; choosing the next batch takes longer
CELLS = (9, 16)  # parts of an image of which it is told whether samples show there
LOOKED_AT, SHOWS = 32, 1 / 16  # samples on average of each; share of that average with which a part shows something
ALL_TIMES = np.float32(-np.inf)


class DeepBuffer:
    """The stored samples of one image, and what its pixels remember of them. Times are float64 seconds of one clock."""

    def __init__(
        self,
        poses: PoseTracker,
        objects: int,
        *,
        detects_change: bool,
        change_test: bool = True,
        noisy: bool = False,
        samples_per_pixel: float = SAMPLES_PER_PIXEL,
        threads: Threads | None = None,
    ) -> None:
        """`objects` of the scene. `detects_change`: samples bring their irradiance, and what they contradict is found.

        `noisy`: they bring albedo and normal, so that noise can be filtered.

        Without `change_test` no sample contradicts anything. `threads` share what is done to all samples.
        """
        self._threads = threads or Threads()
        width, height = poses.rect.width, poses.rect.height
        self.poses, self.detects_change = poses, detects_change
        self._change_test, self._samples_per_pixel = change_test, samples_per_pixel
        self._kept = int(samples_per_pixel * width * height)
        capacity = capacity_for(self._kept, width, height)
        self._largest = capacity // 2  # samples inserted at once: a store that is full could not even compare them
        self.store = SampleStore.of(capacity, lit=poses.lit, noisy=noisy)
        self._spare = SampleStore.of(capacity, lit=poses.lit, noisy=noisy)  # what sorting writes to
        self.history = PixelHistory.of(width, height, detects_change=detects_change, noisy=noisy)
        self._objects = objects
        self._ages = np.zeros(AGES, np.int32)
        self._indices = np.zeros(capacity, np.uint32)  # where the samples of a part came from
        self.count = 0
        self.epoch = 0.0  # the store's clock zero
        self._schedule, self._sorts = SortSchedule(capacity), 0
        self._compile(objects)

    def insert(self, samples: Samples, base_time: float, event: Posed) -> None:
        """Store samples that were traced under `event`; their `change` is written if changes are detected."""
        rules = self.poses.rules(
            event, self._samples_per_pixel, detects_change=self.detects_change, change_test=self._change_test,
            noisy=self.store.light.size > 0,
        )  # fmt: skip
        pose, under = self.poses.inserted(event)
        rows = self.poses.rows_of(under)
        diffuse, doubted = self.poses.diffuse_under(pose), self.poses.doubt_of(event)
        for first in range(0, len(samples), self._largest):
            part = samples[first : first + self._largest]
            if self.count + len(part) > self.store.capacity:
                self._evict(len(part))
            before = self.count
            self.count = kernels_insert.insert(
                part, self.seconds(base_time), pose, under.panel_from_object, rows, self.store, before, self.history,
                diffuse, rules,
            )  # fmt: skip
            if self.poses.is_ahead(event):
                self.store.confidence[before : self.count] = FRESH
            elif doubted is not None:
                kernels_doubt.doubt(self.store, before, self.count, doubted, self.poses.lit)

    def take_over(self, other: DeepBuffer) -> None:
        """Store the newest samples of another deep buffer of the same scene, under the pose shown; it has none."""
        self.epoch, times = other.epoch, other.store.time[: other.count]
        latest = ALL_TIMES
        if other.count > self._kept:
            latest = np.float32(np.quantile(times, 1.0 - self._kept / other.count))
        self.count = kernels_sort.copy_newer(other.store, other.count, latest, self.store)
        everything = np.ones(self._objects + 1, np.uint8)
        self.reproject(everything, everything, np.zeros_like(self.history.dirty))

    def covers(self, camera: Camera) -> float:
        """The share of the image that its samples would show to another camera, told by some of them.

        A part counts that has a sixteenth of the samples that it would have if they were spread evenly: plain surfaces
        get few.
        """
        if not self.count:
            return 0.0
        rect, cells = self.poses.rect, np.zeros(CELLS, np.int32)
        step = max(1, self.count // (LOOKED_AT * cells.size))
        table, size = self.poses.seen_by(camera), (np.float32(rect.width), np.float32(rect.height))
        looked_at = count_by_cell(self.store, self.count, step, table, *size, cells)
        return float((cells >= max(1.0, SHOWS * looked_at / cells.size)).mean())

    def forget(self, samples: Samples, base_time: float) -> None:
        """Reject the samples of one insert, whose packet was lost, and what their pixels have accumulated.

        They are told by the span of their times, since they may have moved and been rounded since they were inserted.
        """
        if len(samples) == 0:
            return
        first, history, rect = self.seconds(base_time), self.history, self.poses.rect
        times, last = self.store.time[: self.count], first + samples["time"].max()
        self.store.confidence[: self.count][(times >= first - CLOCK_STEP_S) & (times <= last + CLOCK_STEP_S)] = 0.0
        j, i = (samples["xy"].astype(np.intp) - (rect.x, rect.y)).T
        inside = (i >= 0) & (j >= 0) & (i < rect.height) & (j < rect.width)
        history.accumulation[i[inside], j[inside]] = 0.0
        history.dirty[i[inside] // TILE, j[inside] // TILE] = True

    def reject_contradicted(self) -> NDArray[np.bool_]:
        """Take confidence from contradicted samples. Returns (rows, columns) bool, the tiles with such pixels."""
        contradicted = self.history.contradicted.copy()
        if contradicted.any():
            kernels_change.reject_contradicted(self.store, self.count, self.history)
        return contradicted

    def doubt(self, doubted: NDArray[np.uint8]) -> None:
        """Take confidence from samples that saw the scene before an edit; `doubted` (n + 1,), see ShadingChanges."""
        kernels_doubt.doubt(self.store, 0, self.count, doubted, self.poses.lit)

    def reject_cut_away(self) -> None:
        """Reject the samples that lie where the event shown cuts the scene away."""
        if (planes := self.poses.cuts.take()) is not None:
            kernels_cuts.reject_cut_away(self.store, self.count, planes)

    def reproject(self, moved: NDArray[np.uint8], changed: NDArray[np.uint8], tiles: NDArray[np.bool_]) -> None:
        """Bring the samples of `moved` objects (n + 1,) to the pose shown.

        What pixels accumulated that show one of the `changed` objects (n + 1,) before or after, those that moved among
        them, is cleared, here or by `reject_accumulation`. Sets the tiles (rows, columns) bool where such pixels are.
        """
        pose, history, everything = self.poses.pose, self.history, changed.all()
        assert pose is not None
        if everything:
            history.clear_accumulation()
            tiles[:] = True
        else:
            means = history.accumulation[: 0 if len(changed) <= BITS else None]  # see reject_accumulation
            kernels_accumulation.mark_changed(self.store, self.count, changed, tiles, means)
        if not moved.any():
            return
        height, width = history.nearest.shape[:2]
        size, table, rows = (np.float32(width), np.float32(height)), pose.panel_from_object, self.poses.rows
        if rows is not None:
            kernels_rows.reproject_rows(self.store, self.count, table, rows, moved, *size)
        else:
            self._threads.share(
                self.count,
                lambda first, last: kernels_reproject.reproject(self.store, first, last, table, moved, *size),
                unit=BLOCK,
            )
        if not everything:  # where they have come to
            kernels_accumulation.mark_changed(self.store, self.count, moved, tiles, history.accumulation[:0])

    def part(self, tiles: NDArray[np.bool_]) -> tuple[SampleStore, int]:
        """The samples of some tiles (rows, columns) bool, and how many: to be weighed and splatted alone.

        What is rejected of them is told by `give_back`.
        """
        return self._spare, kernels_sort.gather(self.store, self.count, tiles, self._spare, self._indices)

    def give_back(self, count: int) -> None:
        """To be called after the `count` samples of a part were weighed, before anything else is done."""
        kernels_sort.give_back(self._spare, count, self._indices, self.store)

    def reject_accumulation(
        self, changed: NDArray[np.uint8], tiles: NDArray[np.bool_], near: NDArray[np.bool_]
    ) -> None:  # fmt: skip
        """Clear what pixels of `changed` objects (n + 1,) accumulated, shorten it where it was contradicted.

        tiles, near : (rows, columns), see kernels.accumulation
        """
        kernels_accumulation.reject_accumulation(self.history, changed, tiles, near)

    def keep(self, share: float) -> None:
        """Keep that share of the samples a pixel that it was made for, from the next refresh on."""
        height, width = self.history.nearest.shape[:2]
        self._kept = int(share * self._samples_per_pixel * width * height)

    def evict(self, now: np.float32) -> None:
        """Reject the oldest samples, so that no more than the wanted number stay."""
        if self.count > self._kept:
            cutoff = oldest_kept(self.store, self.count, now, self._kept, self._ages)
            self._threads.share(self.count, lambda first, last: evict(self.store, first, last, cutoff))

    @property
    def sort_is_due(self) -> bool:
        """Whether the next call of `sort` does anything."""
        return self._schedule.is_due(self.count)

    def sort(self) -> None:
        """If it is due, removes samples outside the image and sorts the others by object."""
        if due := self.sort_is_due:
            self._sorts += 1
            if self._sorts % BY_TILE_EVERY == 1:
                self._sort_by(self.history.dirty.size, by_tile=True)
            self._sort_by(self._objects + 1, by_tile=False)
        self._schedule.end_refresh(self.count, tidied=due)

    def clear(self) -> None:
        """Remove all samples."""
        self.count = 0
        self.poses.reset()
        self.history.clear_accumulation()
        self.history.rejection[:] = 0.0
        self.history.temporal_gradient[:] = 0.0
        self.history.contradicted[:] = False
        self.history.arrived[:] = 0
        self.history.still[:], self.history.settled[:] = False, False

    def seconds(self, time: float) -> np.float32:
        """A time on the store's clock, which starts anew now and then."""
        if abs(time - self.epoch) > CLOCK_ORIGIN_S:
            later = np.float32(time - self.epoch)
            self.store.time[: self.count] -= later
            self.history.rejection[..., BEFORE] -= later
            self.epoch = time
        return np.float32(time - self.epoch)

    @property
    def bytes(self) -> int:
        """Memory of all its arrays."""
        own: list[NDArray[Any]] = [self._ages, self._indices]
        for arrays in (self.store, self._spare, self.history):
            own += arrays
        return sum(array.nbytes for array in own)

    def _compile(self, objects: int) -> None:
        """Compile what is not needed at once: no image is to wait for it."""
        store, history, none, now = self.store, self.history, np.zeros(objects + 1, np.uint8), np.float32(0.0)
        self.count = kernels_sort.compact(store, 0, ALL_TIMES)
        kernels_sort.copy_newer(store, 0, ALL_TIMES, store)
        kernels_accumulation.mark_changed(store, 0, none, history.dirty, history.accumulation)
        kernels_accumulation.limit_counts(history.dirty, history.accumulation, OTHER_MOMENTS)
        kernels_change.reject_contradicted(store, 0, history)
        self.give_back(self.part(history.dirty)[1])
        count_by_cell(store, 0, 1, np.zeros((objects + 1, 12), np.float32), now, now, np.zeros(CELLS, np.int32))
        evict(store, 0, 0, oldest_kept(store, 0, now, self._kept, self._ages))
        kernels_doubt.doubt(store, 0, 0, none, False)
        if self.poses.cuts.used:
            kernels_cuts.reject_cut_away(store, 0, np.zeros((objects + 1, 0, 4), np.float32))

    def _sort_by(self, keys: int, *, by_tile: bool) -> None:
        """Sort by tile or object, of which there are so many; a sample is copied to a place that is known before."""
        columns = self.history.dirty.shape[1]

        def count(first: int, last: int) -> tuple[int, NDArray[np.int64]]:
            counts = np.zeros(keys, np.int64)
            kernels_sort.count_keys(self.store, first, last, by_tile, columns, counts)
            return first, counts

        counted = self._threads.share(self.count, count)
        counts = np.array([own for _, own in counted], np.int64).reshape(-1, keys)
        ends = counts.T.cumsum().reshape(keys, -1).T  # within a key the samples of earlier ranges come first
        starts = dict(zip((first for first, _ in counted), np.ascontiguousarray(ends - counts), strict=True))
        self._threads.share(
            self.count,
            lambda first, last: kernels_sort.copy_sorted(
                self.store, first, last, by_tile, columns, starts[first], self._spare
            ),
        )
        self.count = int(counts.sum())
        self.store, self._spare = self._spare, self.store

    def _evict(self, n: int) -> None:
        """Free space for `n` samples, more than expected between two refreshes: the oldest are evicted if need be."""
        room = self.store.capacity - n
        self.count = kernels_sort.compact(self.store, self.count, ALL_TIMES)
        if self.count > room:
            share = 1.0 - min(self._kept, room) / self.count
            latest = np.float32(np.quantile(self.store.time[: self.count], share))
            self.count = kernels_sort.compact(self.store, self.count, latest)


def capacity_for(kept: int, width: int, height: int) -> int:
    """Samples that a store has room for: those kept, what may come between two refreshes, and a batch."""
    return kept + int(SLACK * width * height) + LARGEST_BATCH


def take_dirty(history: PixelHistory) -> NDArray[np.bool_]:
    """(rows, columns) bool of 16-pixel tiles changed since the last call."""
    dirty = history.dirty.copy()
    history.dirty[:] = False
    return dirty


class SortSchedule:
    """When a store is rid of samples that are rejected or outside the image: every SORT_EVERY refreshes.

    Earlier if as many may come until the next refresh as came since the last that there is no room for them.
    """

    def __init__(self, capacity: int) -> None:
        """`capacity` of the store, samples."""
        self._capacity, self._refreshes, self._counted = capacity, SORT_EVERY, 0

    def is_due(self, count: int) -> bool:
        """Whether it is at the end of this refresh; `count`: samples stored."""
        return self._refreshes + 1 >= SORT_EVERY or count + (count - self._counted) > self._capacity

    def end_refresh(self, count: int, *, tidied: bool) -> None:
        """To be called at the end of every refresh, with the samples that are stored now."""
        self._refreshes, self._counted = 0 if tidied else self._refreshes + 1, count
