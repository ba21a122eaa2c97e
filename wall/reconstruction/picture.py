"""The picture that reprojected samples make: at every refresh, under the pose of that moment.

`insert` stores samples as points of their objects; `refresh` moves them to a pose, drops what is hidden, contradicted
or dead, splats the rest and fills holes. While nothing moves, nothing is moved: new samples are averaged per pixel.
One owner, allocated once. The same code shows the picture at a compositor and lies beneath a sampler's rays.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from wall.core.data import Event, Float32, Float64, Rect, Samples
from wall.deepbuffer.feedback import Feedback
from wall.deepbuffer.kernels import sort as kernels_store
from wall.deepbuffer.kernels.expire import AGES, oldest_kept
from wall.deepbuffer.kernels.pixel_buffer import TILE
from wall.deepbuffer.kernels.reproject import OUTSIDE
from wall.geometry.panels import Panel
from wall.reconstruction.kernels import fill as kernels_fill
from wall.reconstruction.kernels import picture as kernels
from wall.reconstruction.kernels import relight as kernels_relight
from wall.reconstruction.kernels import visibility as kernels_visible
from wall.reconstruction.lamps import Relit, matt_objects
from wall.reconstruction.pose import Pose, Posed, Poses, is_shown
from wall.scene.build import Scene
from wall.scene.needs import needs
from wall.scene.sky import sky_irradiance

SAMPLES_PER_PIXEL = 4  # kept on average
SLACK = 1.0  # samples a pixel that may arrive, or be dead, between two refreshes, beside
SORT_EVERY = 8  # refreshes, by object
BY_TILE_EVERY = 4  # sorts: then it goes by tile first; neighbours stay neighbours for long
YOUNG_S = 0.017  # a refresh at 60 Hz
SLOW_DECAY = 0.5  # 1 / s: an undisturbed sample's weight falls by e in 2 s where 4 samples a pixel are seen
DECAY_PER_RESIDUAL = 100.0
PROBES = 3  # of one tile between two refreshes, from which their mean change says something
USUAL_CHANGE = 0.1  # of a tile's probes on average: noise
EPOCH_S = 512.0  # then the store's clock starts anew: its float32 seconds step by 1/32768 at most
CLOCK_STEP_S = np.float32(2.0**-15)  # of the store's clock at most; choosing the next batch takes longer


@dataclass(frozen=True, slots=True, kw_only=True)
class Ingredients:
    """What the picture is made with; each can be left out, to measure what it is worth."""

    reprojection: bool = True  # else samples stay where they were traced
    objects: bool = True  # else they are points of the world, and moving objects leave them behind
    visibility: bool = True  # else nothing hides anything
    change_test: bool = True  # else new samples contradict nothing
    tile_doubt: bool = True  # else only the surroundings of a contradiction are doubted, never a whole tile
    ageing: bool = True  # else old samples weigh as much as new ones
    relighting: bool = True  # else stored samples keep the light that they were traced in
    accumulation: bool = True  # else pixels that stand still gather no mean of their own


ALL = Ingredients()


class Picture:
    """One panel's picture from reprojected samples. Times are seconds, float64, of one clock."""

    def __init__(
        self,
        panel: Panel,
        eye: Float64,
        scene: Scene,
        *,
        judging: bool,
        rect: Rect | None = None,
        samples_per_pixel: float = SAMPLES_PER_PIXEL,
        ingredients: Ingredients = ALL,
    ) -> None:
        """`rect` is the part of the panel that is shown, all if None.

        `judging`: samples bring their lighting, and what they contradict is found here.
        """
        self.rect = rect or Rect(x=0, y=0, width=panel.pixels[0], height=panel.pixels[1])
        width, height = self.rect.width, self.rect.height
        rows, columns = -(-height // TILE), -(-width // TILE)
        self.panel, self.judging = panel, judging
        self._with = ingredients
        self._kept, self._per_pixel = int(samples_per_pixel * width * height), samples_per_pixel
        capacity = capacity_for(self._kept, width, height)
        self._relights = ingredients.relighting and needs(scene).relighting
        self._irradiance = sky_irradiance(scene.sky)
        self._matt = matt_objects(scene)
        self._relit = Relit(self._matt)
        self._most = capacity // 2  # samples taken in at once
        self._store = Store.of(capacity, lit=self._relights)
        self._spare = Store.of(capacity, lit=self._relights)  # what sorting writes to
        self._tile_starts = np.zeros(rows * columns + 1, np.int64)
        self._object_starts = np.zeros(len(scene.instances) + 2, np.int64)
        self._ages = np.zeros(AGES, np.int32)
        self.count = 0
        self._oldest_kept(0, np.float32(0.0))  # compiled now, not when first there are too many,
        kernels_store.close_ranks(*self._store, 0, np.float32(-np.inf))
        self._until_sorted = self._sorts = 0
        self.nearest = np.full((height, width, 4), -1.0, np.float32)
        self.front = np.zeros((height, width, 2), np.float32)
        self._sharpness = np.ones((height, width), np.float32)
        self._weight = np.zeros(capacity, np.float32)
        self._doubtful = np.zeros(capacity, np.uint32)
        self.gathered = np.zeros((height + 2, width + 2, 4), np.float32)
        self.lighting = np.zeros((height, width, 2), np.float32) if judging else None
        self.doubt = np.zeros((height, width, 2), np.float32)
        self.doubt_about = np.zeros((height, width), np.int32)
        self.residual = np.zeros((rows, columns), np.float32)
        self.probes = np.zeros((rows, columns, 2), np.float32)
        self.still = np.zeros((height, width, 8), np.float32)
        self.base = np.zeros((height, width, 3), np.float32)
        self.radiance: Float32 = np.zeros((height, width, 3), np.float32)
        self.dirty: NDArray[np.bool_] = np.zeros((rows, columns), np.bool_)
        self._lose_confidence(self.dirty, self.residual, np.float32(0.0))  # nor when first something is doubted
        self._levels = _pyramid(height, width)
        self._pose: Pose | None = None  # of the picture
        self._poses = Poses(panel, eye, scene, self.rect, objects=ingredients.objects, lamps=self._relights)
        self._shown: Event | None = None
        self.nothing_moves = False
        self._moved = -math.inf
        self._epoch = 0.0  # the store's clock zero

    def insert(self, samples: Samples, base_time: float, event: Posed) -> None:
        """Take samples in that were traced under `event`; their `change` is written if judging."""
        for first in range(0, len(samples), self._most):  # a store that is full could not even judge them
            self._insert(samples[first : first + self._most], base_time, event)

    def _insert(self, samples: Samples, base_time: float, event: Posed) -> None:
        pose = self._poses.of(event)
        under = self._pose if self._pose is not None else pose
        if self.count + len(samples) > len(self._store.name):
            self._make_room(len(samples))
        stored = np.float32(self._per_pixel if self.nothing_moves else np.inf)
        steady = not self.nothing_moves or is_shown(event, self._shown)
        lighting: Any = self.lighting if self.lighting is not None else self.still  # not read unless judging
        self._relit.note(pose.lamps, under.lamps)
        self.count = kernels.take_in(
            samples, self._seconds(base_time), pose.frame, pose.corner, pose.object_from_eye,
            under.panel_from_object, *self._store, self.count, self.nearest, lighting, self.doubt, self.doubt_about,
            self.residual, self.probes, self.still, steady,
            self.nothing_moves or not self._with.change_test, stored, self.judging, self.dirty, *pose.lamps,
            self._matt, self._irradiance,
        )  # fmt: skip

    def refresh(self, event: Event, now: float) -> None:
        """Show the samples under `event`; nothing moved since the last refresh if it has the same number."""
        self.nothing_moves = self._shown is not None and event.number == self._shown.number
        self._shown = event
        if not self.nothing_moves:
            self._move(self._poses.of(event), now)
            self.dirty[:] = True
        if not self._with.accumulation:
            self.still[:] = 0.0
        if self.dirty.any():
            kernels.mix_still(self.base, self.still, self.dirty, self.radiance)

    def feedback(self) -> Feedback:
        """What a sampler may read after a refresh."""
        return Feedback(
            resolved=self.radiance,
            sample_density=self.gathered[1:-1, 1:-1, 3],
            accumulation=self.still,
            temporal_gradient=self.residual,
            nothing_moves=self.nothing_moves,
        )

    def discard(self, samples: Samples, base_time: float) -> None:
        """Remove the samples of one insert again, and what their pixels have accumulated.

        They are told by the span of their times, since they may have moved and been rounded since they were inserted.
        """
        if len(samples) == 0:
            return
        first = self._seconds(base_time)
        times, confidence = self._store.state[:, : self.count]
        confidence[(times >= first - CLOCK_STEP_S) & (times <= first + samples["time"].max() + CLOCK_STEP_S)] = 0.0
        j, i = (samples["xy"].astype(np.intp) - (self.rect.x, self.rect.y)).T
        inside = (i >= 0) & (j >= 0) & (i < self.rect.height) & (j < self.rect.width)
        self.still[i[inside], j[inside]] = 0.0
        self.dirty[i[inside] // TILE, j[inside] // TILE] = True

    def clear(self) -> None:
        """Forget every sample."""
        self.count = 0
        self._shown = None
        for learnt in (self.still, self.gathered, self.doubt, self.residual, self.probes):
            learnt[:] = 0.0

    @property
    def bytes(self) -> int:
        """Memory of all its arrays; it never grows."""
        own = [*vars(self).values(), *self._store, *self._spare, *self._levels]
        return sum(array.nbytes for array in own if isinstance(array, np.ndarray))

    def take_dirty(self) -> NDArray[np.bool_]:
        """(rows, columns) bool of 16-pixel tiles changed since the last call."""
        dirty = self.dirty.copy()
        self.dirty[:] = False
        return dirty

    def stored(self) -> tuple[Float32, Float32, int, float]:
        """For whoever looks on: times and confidences, places in the picture, how many, and their clock's zero."""
        return self._store.state, self._store.screen, self.count, self._epoch

    @property
    def pose(self) -> Pose:
        """That the picture shows; only after a refresh."""
        assert self._pose is not None
        return self._pose

    def find_nearest(self) -> None:
        """Bring `nearest` up to date with samples that came since the picture last moved."""
        s = self._store
        kernels_visible.keep_nearest(s.name, s.state, s.screen, self.count, self.nearest)

    def still_counts(self) -> Float32:
        """For whoever looks on: (h, w) float32, of how many samples each pixel shows the mean while it stands still."""
        counts: Float32 = self.still[..., 3]
        return counts

    def _seconds(self, time: float) -> np.float32:
        """A time on the store's clock, which starts anew now and then."""
        if abs(time - self._epoch) > EPOCH_S:
            later = np.float32(time - self._epoch)
            self._store.state[0, : self.count] -= later
            self.doubt[..., 1] -= later
            self._epoch = time
        return np.float32(time - self._epoch)

    def _move(self, pose: Pose, now: float) -> None:
        table, last = pose.panel_from_object, self._pose
        moved = np.ones(len(table), np.uint8)
        if last is not None:
            moved = (table != last.panel_from_object).any(axis=1).astype(np.uint8)
        if not self._with.reprojection:
            moved[:] = 0
        self._pose = pose
        s, now32 = self._store, self._seconds(now)
        height, width = self.front.shape[:2]
        stale, doubted = stale_share(self.probes) * np.float32(self._with.tile_doubt), self._doubted()
        if doubted.any():
            self._lose_confidence(doubted, stale, np.float32(self._moved - self._epoch))
        kernels.place_samples(
            s.place, s.name, self.count, table, moved, np.float32(width), np.float32(height), s.screen
        )
        changed = moved | self._relight(pose, last)
        alive = kernels_visible.keep_nearest(s.name, s.state, s.screen, self.count, self.nearest)
        decay = np.float32(SLOW_DECAY * self._with.ageing) * (1.0 + DECAY_PER_RESIDUAL * self.residual)
        rim = kernels_visible.RIM * np.float32(self._with.ageing)
        kernels_visible.front_bounds(self.nearest, moved, decay, rim, self.gathered, self.front, self._sharpness)
        young = np.float32(YOUNG_S if self._with.visibility else np.inf)
        kernels_visible.weigh(
            s.state, s.screen, self.count, self._cutoff(alive, now32), self.nearest, self.front, now32, young,
            self._weight, self._doubtful,
        )  # fmt: skip
        kernels.splat(s.colour, s.screen, self._weight, self.count, self._sharpness, self.gathered, self.lighting)
        kernels.doubt_still(self.still, self.nearest, changed, self.doubt)
        self.probes[:] = 0.0
        self._sort()
        self._moved = now
        self._fill()

    def _lose_confidence(self, doubted: NDArray[np.bool_], stale: Float32, since: np.float32) -> None:
        s = self._store
        kernels.lose_confidence(
            s.name, s.state, s.screen, self.count, doubted, self.doubt, self.doubt_about, stale, since
        )

    def _relight(self, pose: Pose, last: Pose | None) -> NDArray[np.uint8]:
        """Bring stored samples into the light of `pose`. Returns (n + 1,) uint8, whose light changed."""
        now, s = pose.lamps, self._store
        changed = np.zeros(len(pose.panel_from_object), np.uint8)
        if self._relights:
            changed = self._relit.take(now, last.lamps if last is not None else None)
            kernels_relight.relight(
                s.place, s.name, s.colour, s.surface, s.albedo, self.count, changed, *now, self._irradiance
            )
        return changed

    def _doubted(self) -> NDArray[np.bool_]:
        """(rows, columns) bool: tiles where anything was contradicted since the last refresh, and their neighbours."""
        found = np.pad(self.probes[..., 1] > 0.0, 1)
        found[1:] |= found[:-1].copy()
        found[:-1] |= found[1:].copy()
        found[:, 1:] |= found[:, :-1].copy()
        found[:, :-1] |= found[:, 1:].copy()
        return found[1:-1, 1:-1].copy()

    def _fill(self) -> None:
        fine, border, trusted = self.gathered, 1, kernels_fill.TRUSTED
        for level in self._levels:
            kernels_fill.halve(fine, border, trusted, level)
            fine, border, trusted = level, 0, kernels_fill.ONE
        filled = None
        for level in reversed(self._levels):
            kernels_fill.expand(level, filled)
            filled = level
        kernels_fill.resolve(self.gathered, self._levels[0], self.base)

    def _sort(self) -> None:
        """Now and then: close ranks, and let objects stand together again."""
        self._until_sorted -= 1
        if self._until_sorted > 0:
            return
        self._until_sorted = SORT_EVERY
        self._sorts += 1
        if self._sorts % BY_TILE_EVERY == 1:
            self._sort_by(self._tile_starts, by_tile=True)
        self._sort_by(self._object_starts, by_tile=False)

    def _sort_by(self, starts: NDArray[np.int64], *, by_tile: bool) -> None:
        columns = self.residual.shape[1]
        self.count = kernels_store.sort_store(*self._store, self.count, by_tile, columns, starts, *self._spare)
        self._store, self._spare = self._spare, self._store

    def _cutoff(self, alive: int, now: np.float32) -> np.float32:
        """Time before which samples must go for no more than the wanted number to stay."""
        if alive <= self._kept:
            return np.float32(-np.inf)
        return self._oldest_kept(self.count, now)

    def _oldest_kept(self, count: int, now: np.float32) -> np.float32:
        s = self._store
        return np.float32(oldest_kept(s.state, s.screen, count, now, self._kept, self._ages))

    def _make_room(self, n: int) -> None:
        """More came between two refreshes than there is slack for: the dead leave, then if need be the oldest."""
        room = len(self._store.name) - n
        self.count = kernels_store.close_ranks(*self._store, self.count, np.float32(-np.inf))
        if self.count > room:
            share = 1.0 - min(self._kept, room) / self.count
            latest = np.float32(np.quantile(self._store.state[0, : self.count], share))
            self.count = kernels_store.close_ranks(*self._store, self.count, latest)


class Store(NamedTuple):
    """Samples as points of their objects, in no order that means anything."""

    place: Float32  # (3, capacity) object-local; a direction for the sky
    name: NDArray[np.int32]  # (capacity,) object id
    colour: Float32  # (capacity, 4) radiance and square root of lighting
    state: Float32  # (2, capacity) seconds of the store's clock, confidence 0..1
    screen: Float32  # (3, capacity) x, y, depth in the picture
    surface: NDArray[np.int32]  # (capacity,) normal and visible lights; none if never relit
    albedo: Float32  # (3, capacity) what it reflects, NOT_RELIT if that is not known; none if never relit

    @classmethod
    def of(cls, capacity: int, *, lit: bool) -> Store:
        return cls(
            place=np.zeros((3, capacity), np.float32),
            name=np.zeros(capacity, np.int32),
            colour=np.zeros((capacity, 4), np.float32),
            state=np.zeros((2, capacity), np.float32),
            screen=np.full((3, capacity), OUTSIDE, np.float32),
            surface=np.zeros(lit * capacity, np.int32),
            albedo=np.zeros((3, lit * capacity), np.float32),
        )


def capacity_for(kept: int, width: int, height: int) -> int:
    """Samples that a store has room for: those kept, what may come between two refreshes, and a batch."""
    return kept + int(SLACK * width * height) + 4096


def stale_share(probes: Float32) -> Float32:
    """(rows, columns) float32: how much of each tile the newest probes found changed; all older samples lose it.

    probes : (rows, columns, 2) float32, samples judged and their change
    """
    count, change = probes[..., 0], probes[..., 1]
    share = np.where(count >= PROBES, change / np.maximum(count, 1.0), 0.0)
    return np.maximum(share - USUAL_CHANGE, 0.0).astype(np.float32)


def _pyramid(height: int, width: int) -> list[Float32]:
    levels = []
    while height > 1 or width > 1:
        height, width = -(-height // 2), -(-width // 2)
        levels.append(np.zeros((height, width, 4), np.float32))
    return levels or [np.zeros((1, 1, 4), np.float32)]
