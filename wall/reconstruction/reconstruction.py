"""Reconstruct an image from the samples of a deep buffer, at every refresh, under the event of that moment.

`insert` stores samples; `refresh` reprojects them, rejects what is contradicted or hidden, evicts the oldest, splats
the rest, fills holes. While the camera stands, only tiles where something changes are redone; elsewhere new samples are
averaged per pixel. The same code makes the image at a compositor and the one that a sampler reads.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wall.core.data import Event, Float32, Float64, Rect, Samples
from wall.core.threads import Threads
from wall.core.tone_mapping import AS_IT_IS, Tone
from wall.deepbuffer.deep_buffer import SAMPLES_PER_PIXEL, DeepBuffer, take_dirty
from wall.deepbuffer.feedback import Feedback
from wall.deepbuffer.kernels.accumulation import MEAN_ALONE
from wall.deepbuffer.kernels.columns import COUNT, NEAREST_DEPTH, NEAREST_OBJECT
from wall.deepbuffer.kernels.pixel_buffer import TILE
from wall.deepbuffer.kernels.reproject import BLOCK
from wall.deepbuffer.pose import Pose, Posed
from wall.deepbuffer.pose_tracker import PoseTracker
from wall.deepbuffer.rest import RestSchedule, come_to_rest, limit_means
from wall.deepbuffer.still_tiles import StillTiles, with_neighbours
from wall.deepbuffer.store import SampleStore
from wall.geometry.panels import Panel
from wall.reconstruction.bands import Bands
from wall.reconstruction.display_values import update_display
from wall.reconstruction.kernels import splat as kernels_splat
from wall.reconstruction.kernels import visibility as kernels_visibility
from wall.reconstruction.kernels.channels import newest_times
from wall.reconstruction.kernels.relight import relight
from wall.reconstruction.lighting import Lighting
from wall.reconstruction.pyramid import Pyramid
from wall.reconstruction.stored import NearestSamples, StoredSamples
from wall.reconstruction.surfaces import SurfaceImages
from wall.scene.build import Scene
from wall.scene.needs import needs

YOUNG_S = 0.017  # a refresh at 60 Hz: what samples hide may not have been traced yet
LONGEST_FILTERED = 4096.0  # samples a pixel, until which noise is filtered anew at rest
SLOW_DECAY = 0.5  # 1 / s: an undisturbed sample's weight falls by e in 2 s where 4 samples a pixel are seen
DECAY_PER_GRADIENT = 100.0
LARGEST_PART = 0.5  # of the tiles: more are not worth making anew alone
LEVEL_OF_TILES = int(math.log2(TILE)) - 1  # of the pyramid: its pixels are as large as tiles


@dataclass(frozen=True, slots=True, kw_only=True)
class Ingredients:
    """What the image is made with; each can be left out, to measure its effect."""

    reprojection: bool = True  # else samples stay where they were traced
    objects: bool = True  # else they are points of the world, and moving objects leave them behind
    visibility: bool = True  # else nothing hides anything
    change_test: bool = True  # else new samples contradict nothing
    ageing: bool = True  # else old samples weigh as much as new ones
    relighting: bool = True  # else stored samples keep the light that they were traced in
    accumulation: bool = True  # else pixels at rest accumulate no mean of their own
    filtering: bool = True  # else noise stays
    parts: bool = True  # else all of the image is made anew where some of it changes


ALL = Ingredients()


class Reconstruction:
    """The image of one panel, or a part of it. Times are float64 seconds of one clock."""

    def __init__(
        self,
        panel: Panel,
        eye: Float64,
        scene: Scene,
        *,
        detects_change: bool,
        rect: Rect | None = None,
        samples_per_pixel: float = SAMPLES_PER_PIXEL,
        ingredients: Ingredients = ALL,
        threads: int = 1,
        settles: bool = False,
    ) -> None:
        """`rect`: the part of the panel that is shown, or all. `detects_change`, `settles`: see DeepBuffer, StillTiles.

        So many `threads` share a refresh; the image is the same, bit for bit.
        """
        lit = ingredients.relighting and needs(scene).relighting
        noisy = ingredients.filtering and needs(scene).paths
        self.poses = PoseTracker(panel, eye, scene, rect, lit=lit, objects=ingredients.objects)
        self.rect, self._with, self._threads = self.poses.rect, ingredients, Threads(threads)
        self.buffer = DeepBuffer(
            self.poses, len(scene.instances), detects_change=detects_change, change_test=ingredients.change_test,
            samples_per_pixel=samples_per_pixel, noisy=noisy, threads=self._threads,
        )  # fmt: skip
        still = settles and StillTiles.can_have(scene)
        self._still = StillTiles(scene, self.buffer, self._threads) if still else None
        width, height = self.rect.width, self.rect.height
        moves = np.zeros(len(scene.instances) + 1, np.uint8)
        moves[scene.animated_objects + 1] = 1
        self._lighting = Lighting(height, width, moves, scanned=panel.scan is not None) if noisy else None
        if self._lighting is not None:
            self._lighting.compile(self.buffer.store)
        self._bounds = np.ones((3, height, width), np.float32)
        self._untested = np.zeros(self.buffer.store.capacity, np.uint32)
        self._weight = np.zeros(self.buffer.store.capacity, np.float32)
        self._bands = Bands(height, self.buffer.store.capacity, self._threads)
        self.splat_sums: Float32 = np.zeros((height + 2, width + 2, 4), np.float32)
        self._part_sums = np.zeros_like(self.splat_sums)  # of the samples of some tiles
        self._pyramid = Pyramid(height, width)
        self.surfaces: SurfaceImages | None = None  # see describe_surfaces
        self._resolved: Float32 = np.zeros((height, width, 3), np.float32)
        self._shows_splats = False  # `radiance` shows them alone, `_resolved` is not up to date
        self._prior, self._prior_of = self._resolved[:0], (-1, -1)  # see take_over; of the event of that number alone
        kernels_splat.copy_tiles(self._part_sums, self.buffer.history.dirty, self.splat_sums)  # compiled now
        last = float(LONGEST_FILTERED if noisy else MEAN_ALONE)
        self._bands.compile(
            self.buffer.store, self.buffer.history.nearest, self.splat_sums, self.buffer.history.sqrt_irradiance
        )
        self._schedule = RestSchedule(self.buffer.history.arrived, TILE * TILE, last=last)
        self.refreshes, self._moved_at = 0, 0.0
        self.radiance: Float32 = np.zeros((height, width, 3), np.float32)  # with the accumulation: the image shown

    def insert(self, samples: Samples, base_time: float, event: Posed) -> None:
        """Store samples that were traced under `event`; their `change` is written if changes are detected."""
        first = self.buffer.count
        self.buffer.insert(samples, base_time, event)
        if self._lighting is not None and self.buffer.count > first:
            self._lighting.probe(self.buffer.store, first, self.buffer.count)

    def refresh(self, event: Event, now: float) -> None:
        """Show the samples under `event`; nothing moved since the last refresh if it has the same number."""
        stood, history = self.nothing_moves, self.buffer.history
        self.poses.show(event)
        self.buffer.reject_cut_away()  # at rest too: samples of older edits may have come
        self.refreshes += 1
        if not self.nothing_moves:
            self._moved_at = now
            self._reconstruct(self._schedule.take_due(now), self.buffer.seconds(now))
        elif not stood:
            come_to_rest(self.poses, history)
        elif self.count:
            due, seconds = self._schedule.take_due(now), self.buffer.seconds(now)
            if self._lighting is not None:  # which shows stored samples for long: they are not to age
                seconds = np.float32(self._moved_at - self.buffer.epoch)
            self._splat(self.poses.moved(), due, seconds)
        if not self._with.accumulation or (self._lighting is not None and not self.nothing_moves):
            history.clear_accumulation()
        if self._prior.size and self._prior_of != event.number:
            self._prior, history.dirty[:] = self._resolved[:0], True
        if history.dirty.any() and not (self._shows_splats and not history.accumulating.any() and not self._prior.size):
            self._mix()

    def take_over(self, other: Reconstruction, prior: Float32 | None = None) -> None:
        """Forget every sample, and store those of an image of other pixels: what that shows is what the next one shows.

        `other`: of the same panel, eye and scene; where there are more than are kept, its newest. `prior`: (h, w, 3),
        what the other shows; while nothing moves pixels go over from it to their own samples, see mix_accumulation.
        """
        self.clear()
        if (event := other.poses.shown) is not None:
            if prior is not None:
                self._prior, self._prior_of = prior, event.number
            self.poses.show(event)
            self.buffer.take_over(other.buffer)
            self.poses.reset()  # all of it is made anew, whatever moves

    def limit_means(self) -> None:
        """Let what pixels accumulated weigh too little for any of them to be complete."""
        limit_means(self.buffer.history)

    def feedback(self) -> Feedback:
        """What a sampler may read after a refresh."""
        return Feedback(
            resolved=self.radiance,
            sample_density=self.splat_sums[1:-1, 1:-1, 3],
            accumulation=self.buffer.history.accumulation,
            accumulating=self.buffer.history.accumulating,
            temporal_gradient=self.buffer.history.temporal_gradient,
            nothing_moves=self.nothing_moves,
        )

    def forget(self, samples: Samples, base_time: float) -> None:
        """Reject the samples of one insert, whose packet was lost; see DeepBuffer."""
        self.buffer.forget(samples, base_time)

    def clear(self) -> None:
        """Forget every sample."""
        self._prior = self._resolved[:0]
        self.buffer.clear()
        self.splat_sums[:] = 0.0
        if self._lighting is not None:
            self._lighting.clear()

    @property
    def nothing_moves(self) -> bool:
        """Whether the last refresh showed the same event as the one before."""
        return self.poses.nothing_moves

    @property
    def at_rest(self) -> bool:
        """Whether nothing moves, and pixels show no filtered noise: a prior for an image of more of them."""
        return self.nothing_moves and self._lighting is None

    @property
    def count(self) -> int:
        """Samples stored, those that wait for removal among them."""
        return self.buffer.count

    @property
    def bytes(self) -> int:
        """Memory of all its arrays; it never grows, but for a prior."""
        parts = (self.buffer, self._pyramid, self._bands, self._lighting, self.surfaces, self._still)
        own = sum(array.nbytes for array in vars(self).values() if isinstance(array, np.ndarray))
        return own + sum(part.bytes for part in parts if part is not None)

    def describe_surfaces(self) -> None:
        """Make images of albedos and normals from now on, where samples bring them: those of paths.

        They are for a denoiser: at rest it gets the means of pixels' own samples, not the filtered image, whose noise
        is no longer independent from pixel to pixel.
        """
        if self._lighting is not None and self.surfaces is None:
            self.surfaces = SurfaceImages(self.rect.height, self.rect.width, self.buffer.store.capacity)

    def take_dirty(self) -> NDArray[np.bool_]:
        """(rows, columns) bool of 16-pixel tiles changed since the last call."""
        return take_dirty(self.buffer.history)

    def display(self, dirty: NDArray[np.bool_], rgb: NDArray[np.uint8], *, tone: Tone = AS_IT_IS) -> None:
        """Redo the dirty tiles of `rgb` (h, w, 3) uint8, sRGB, exposed and mapped."""

        def update(top: int, bottom: int) -> None:
            rows = slice(top // TILE, -(-bottom // TILE))
            update_display(self.radiance[top:bottom], dirty[rows], TILE, rgb[top:bottom], tone=tone)

        self._threads.share(self.rect.height, update, unit=TILE)

    def stored(self) -> StoredSamples:
        """The samples of the image, for statistics."""
        buffer = self.buffer
        store = buffer.store
        return StoredSamples(store.time, store.confidence, store.screen_position, buffer.count, buffer.epoch)

    @property
    def pose(self) -> Pose:
        """The pose that the image shows; only after a refresh."""
        assert self.poses.pose is not None
        return self.poses.pose

    def find_nearest(self) -> NearestSamples:
        """Find each pixel's nearest sample, also among those that came since the last refresh."""
        history = self.buffer.history
        everywhere = np.ones_like(history.dirty)
        self._bands.find_nearest(self.buffer.store, self.buffer.count, history.nearest, everywhere)
        return NearestSamples(history.nearest[..., NEAREST_DEPTH], history.nearest[..., NEAREST_OBJECT])

    def write_newest_times(self, origin: float, time: Float32) -> None:
        """Write when each pixel's newest sample was traced: `time` (h, w), seconds after `origin`; -inf: none."""
        buffer, store = self.buffer, self.buffer.store
        later = buffer.epoch - origin
        newest_times(store.time, store.confidence, store.screen_position, buffer.count, later, time)

    def block_weights(self) -> Float32:
        """(h / 4, w / 4) float32, rounded up: weight of the samples that show in each 4x4 pixels, a pixel's up to 1."""
        weights: Float32 = self._pyramid.levels[min(1, len(self._pyramid.levels) - 1)][..., 3]
        return weights

    def accumulated_counts(self) -> Float32:
        """(h, w) float32: of how many samples each pixel shows the mean while nothing moves."""
        counts: Float32 = self.buffer.history.accumulation[..., COUNT]
        return counts

    def _reconstruct(self, due: NDArray[np.bool_], now: np.float32) -> None:
        """Make the image of the event shown. `due`: see RestSchedule; `now`: seconds of the store's clock."""
        buffer = self.buffer
        moved = self.poses.moved() * np.uint8(self._with.reprojection)
        doubted = self.poses.doubted
        if doubted is not None:
            buffer.doubt(doubted)
        contradicted, shown = buffer.reject_contradicted(), np.zeros_like(buffer.history.dirty)
        changed = moved | self._relight() | np.uint8(self.poses.camera_moved)  # it may uncover, or hide, any surface
        if doubted is not None:
            changed |= doubted
        buffer.reproject(moved, changed, shown)
        tiles = contradicted | shown | (not self._in_parts())
        redone = self._splat(moved, tiles | due, now)
        if self._still is not None:
            self._still.update(moved, float(now))
        buffer.reject_accumulation(changed, redone, with_neighbours(shown))
        self._schedule.move(None if redone.all() else tiles)

    @property
    def resolved(self) -> Float32:
        """The image of splats alone, (h, w, 3) float32: without what pixels accumulated."""
        if self._shows_splats:
            self._shows_splats = False
            self._resolved[:] = self.radiance
        return self._resolved

    def _mix(self) -> None:
        """Mix what pixels accumulated into the splats, in dirty tiles."""
        history = self.buffer.history
        if self._prior.size:
            kernels_splat.mix_accumulation(self._prior, history, self.radiance, prior=True)
        elif self._lighting is not None and self.surfaces is None:
            self._lighting.mix(self.resolved, history, self.radiance)
        else:
            kernels_splat.mix_accumulation(self.resolved, history, self.radiance, prior=False)

    def _resolve(self, *, everywhere: bool) -> None:
        """Resolve splat sums; at once to `radiance` if all of it is redone, and nothing is to be mixed in."""
        mixes = self._lighting is not None or bool(self._prior.size or self.buffer.history.accumulating.any())
        self._shows_splats = everywhere and not mixes
        self._pyramid.resolve(self.splat_sums, self.radiance if self._shows_splats else self._resolved, self._threads)

    def _splat(self, moved: NDArray[np.uint8], tiles: NDArray[np.bool_], now: np.float32) -> NDArray[np.bool_]:
        """Splat the samples of `tiles` (rows, columns) where they are: of all if that is much, or where some are empty.

        moved : (n + 1,) uint8, objects that are not where they were in the image before

        Returns
        -------
        redone : (rows, columns) bool, the tiles, or all
        """
        buffer, nearest = self.buffer, self.buffer.history.nearest
        if not tiles.any():
            return tiles
        if tiles.mean() > LARGEST_PART or not self._in_parts():
            tiles = np.ones_like(tiles)
        if tiles.all():
            self._bands.find_nearest(buffer.store, buffer.count, nearest, tiles)
            buffer.evict(now)
            self._splat_samples(buffer.store, buffer.count, tiles, moved, now, self.splat_sums)
        else:
            if buffer.sort_is_due:
                buffer.evict(now)
            store, count = buffer.part(tiles)
            self._bands.find_nearest(store, count, nearest, tiles)
            self._splat_samples(store, count, tiles, moved, now, self._part_sums)
            buffer.give_back(count)
            kernels_splat.copy_tiles(self._part_sums, tiles, self.splat_sums)
        buffer.sort()
        self._resolve(everywhere=bool(tiles.all()))
        buffer.history.dirty[with_neighbours(tiles)] = True
        return tiles

    def _splat_samples(
        self, store: SampleStore, count: int, tiles: NDArray[np.bool_], moved: NDArray[np.uint8], now: np.float32,
        sums: Float32,
    ) -> None:  # fmt: skip
        """Weigh and splat the `count` samples of a store, which are those of some tiles; the nearest are known."""
        history, ageing = self.buffer.history, np.float32(self._with.ageing)
        decay = np.float32(SLOW_DECAY) * ageing * (1.0 + DECAY_PER_GRADIENT * history.temporal_gradient)
        silhouette, ratios = kernels_visibility.SILHOUETTE_PER_S * ageing, kernels_visibility.behind(self.pose.pixel)
        share = self._threads.share
        share(
            self.rect.height,
            lambda top, bottom: kernels_visibility.bound_depths(
                history.nearest, ratios.own, moved, decay, silhouette, self.splat_sums, tiles, self._bounds, top, bottom
            ),
        )
        lighting = self._lighting
        filters = lighting is not None and (self.nothing_moves or lighting.is_due(now))
        if lighting is not None and filters and self._with.change_test:
            lighting.correct(store, count, now)
        young = np.float32(YOUNG_S if self._with.visibility else np.inf)
        share(
            count,
            lambda first, last: kernels_visibility.weigh(
                store, first, last, history.nearest, ratios, self._bounds, now, young, self._weight, self._untested
            ),
            unit=BLOCK,
        )
        if lighting is not None and filters:
            table, rows = self.pose.panel_from_object, self.poses.rows
            lighting.filter(store, count, self._weight, history, now, table, rows)
        elif lighting is not None:
            lighting.show_new(store, count, self._weight)
        self._bands.splat(store, self._weight, count, self._bounds, tiles, sums, history.sqrt_irradiance)
        if self.surfaces is not None:
            self.surfaces.splat(store, self._weight, count, tiles, self.pose.object_from_eye)

    def _in_parts(self) -> bool:
        """Whether tiles may be made anew alone: not while some have no sample, and are filled from afar."""
        weight = self._pyramid.levels[min(LEVEL_OF_TILES, len(self._pyramid.levels) - 1)][..., 3]
        return self._with.parts and self._lighting is None and bool((weight > 0.0).all())

    def _relight(self) -> NDArray[np.uint8]:
        """Light stored samples anew where lights or objects moved. Returns (n + 1,) uint8, those objects."""
        relit, buffer = self.poses.relit(), self.buffer
        if relit.any():
            self._threads.share(
                buffer.count,
                lambda first, last: relight(buffer.store, first, last, relit, self.pose.lights, self.pose.lights.sky),
                unit=BLOCK,
            )
        return relit
