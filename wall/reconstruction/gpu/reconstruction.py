"""The image of `reconstruction.reconstruction` made on a GPU: same samples in, same image out, within float rounding.

New samples are inserted on the CPU, by the same kernel, and travel once; what touches every stored sample or every
pixel of a moving image happens on the GPU. While nothing moves, the GPU rests: accumulated means grow on the CPU.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wall.core.data import Event, Float32, Float64, Framelet, Rect, Samples
from wall.core.tone_mapping import AS_IT_IS, Tone
from wall.deepbuffer.deep_buffer import (
    CLOCK_ORIGIN_S,
    SAMPLES_PER_PIXEL,
    SortSchedule,
    capacity_for,
    take_dirty,
)
from wall.deepbuffer.kernels.columns import COUNT
from wall.deepbuffer.kernels.doubt import FRESH, doubt
from wall.deepbuffer.kernels.insert import insert
from wall.deepbuffer.kernels.pixel_buffer import TILE
from wall.deepbuffer.pose import Pose, Posed
from wall.deepbuffer.pose_tracker import PoseTracker
from wall.deepbuffer.rest import RestSchedule, come_to_rest
from wall.deepbuffer.store import PixelHistory, SampleStore
from wall.geometry.panels import Panel
from wall.reconstruction.display_values import update_display
from wall.reconstruction.gpu.device import CONFIDENCE, TIME, GpuError, device
from wall.reconstruction.gpu.passes import Passes
from wall.reconstruction.gpu.relighting import Relighting
from wall.reconstruction.gpu.store import GpuStore
from wall.reconstruction.kernels.splat import mix_accumulation
from wall.reconstruction.kernels.visibility import behind
from wall.reconstruction.reconstruction import YOUNG_S
from wall.reconstruction.stored import NearestSamples, StoredSamples
from wall.scene.build import Scene
from wall.scene.needs import needs

STAGED = 1 << 17  # samples that wait on the CPU at most, to travel together


class GpuReconstruction:
    """The image of one panel, or a part of it; to be used by the thread that made it."""

    def __init__(
        self,
        panel: Panel,
        eye: Float64,
        scene: Scene,
        *,
        rect: Rect | None = None,
        samples_per_pixel: float = SAMPLES_PER_PIXEL,
        relighting: bool = True,
    ) -> None:
        """`rect` is the part of the panel that is shown, all if None. Raises GpuError where there is no GPU for it.

        `relighting`: else stored samples keep the light that they were traced in.
        """
        if needs(scene).paths:
            raise GpuError("the noise of paths is filtered on the CPU alone", wanted="scene.integrator direct")
        self.poses = PoseTracker(panel, eye, scene, rect, lit=relighting and needs(scene).relighting)
        self.rect = self.poses.rect
        width, height, objects = self.rect.width, self.rect.height, len(scene.instances) + 1
        self._kept, self._samples_per_pixel = int(samples_per_pixel * width * height), samples_per_pixel
        self._device = device()
        self._store = GpuStore(self._device, capacity_for(self._kept, width, height), lit=self.poses.lit)
        self._passes = Passes(self._device, width, height, objects=objects)
        lights = len(scene.directional_lights) + len(scene.point_lights)
        self._relighting = Relighting(self._device, self.poses.diffuse.sky_irradiance, objects=objects, lights=lights)
        self._largest = min(STAGED, self._store.capacity // 2)  # samples inserted at once
        self._staged_store, self._staged = SampleStore.of(self._largest, lit=self.poses.lit), 0
        self._change = np.zeros(self._largest, np.float32)  # of the staged samples
        self._contradicted = False  # by any sample that has travelled since the last refresh
        self._accumulated: list[range] = []  # of the staged samples, what pixels accumulate: InsertRules.shows_event
        self._ordinal = 0  # new samples that have travelled since the last refresh
        self._packing = SortSchedule(self._store.capacity)
        self._history = PixelHistory.of(width, height, detects_change=False)  # its rejections are the GPU's
        self._schedule = RestSchedule(self._history.arrived, TILE * TILE)
        self._resolved = np.zeros((height, width, 3), np.float32)
        self._radiance = np.zeros((height, width, 3), np.float32)
        self._surfaces = np.zeros((0, 0, 2), np.float32)  # see find_nearest
        self._read = True  # whether that is what the GPU shows
        self._epoch = 0.0  # the store's clock zero

    @property
    def renderer(self) -> str:
        """What OpenGL calls the GPU."""
        return self._device.renderer

    @property
    def nothing_moves(self) -> bool:
        """Whether the last refresh showed the same event as the one before."""
        return self.poses.nothing_moves

    @property
    def radiance(self) -> Float32:
        """(h, w, 3) float32 linear RGB after the last refresh; travels from the GPU when it is asked for."""
        if not self._read:
            self._passes.read_shown(self._radiance)
            self._read = True
        return self._radiance

    def display(self, dirty: NDArray[np.bool_], rgb: NDArray[np.uint8], *, tone: Tone = AS_IT_IS) -> None:
        """Redo the dirty tiles of `rgb` (h, w, 3) uint8, sRGB, exposed and mapped.

        A moving image travels as these bytes and no more.
        """
        if self._read:
            update_display(self._radiance, dirty, TILE, rgb, tone=tone)
        else:
            self._passes.read_display(rgb, tone)

    @property
    def count(self) -> int:
        """Samples stored, those that wait for removal among them."""
        return self._store.count + self._staged

    def insert(self, samples: Samples, base_time: float, event: Posed) -> None:
        """Store samples that were traced under `event`. Raises GpuError if the GPU is lost."""
        known = samples["object_id"] < len(self.poses.diffuse.objects)
        samples = samples if known.all() else samples[known]
        rules = self.poses.rules(event, self._samples_per_pixel, detects_change=False, change_test=True)
        pose, under = self.poses.inserted(event)
        diffuse, doubted = self.poses.diffuse_under(pose), self.poses.doubt_of(event)
        for start in range(0, len(samples), self._largest):
            part = samples[start : start + self._largest]
            if self.count + len(part) > self._store.capacity:
                self._evict(len(part))
            if self._staged + len(part) > self._largest:
                self._send(moving=not self.nothing_moves)
            first = self._staged
            self._staged = insert(
                part, self._seconds(base_time), pose, under.panel_from_object, None, self._staged_store, first,
                self._history, diffuse, rules._replace(ignores_change=True),  # what is contradicted is the GPU's
            )  # fmt: skip
            if self.poses.is_ahead(event):
                self._staged_store.confidence[first : self._staged] = FRESH
            elif doubted is not None:
                doubt(self._staged_store, first, self._staged, doubted, self.poses.lit)
            if rules.ignores_change:
                self._change[first : self._staged] = 0.0
            else:
                self._change[first : self._staged] = part["change"]  # all were stored
            if rules.shows_event and not self.nothing_moves and self._staged > first:
                self._accumulated.append(range(first, self._staged))

    def refresh(self, event: Event, now: float) -> None:
        """Show the samples under `event`; nothing moved since the last refresh if it has the same number.

        Raises GpuError if the GPU is lost.
        """
        stood, history = self.nothing_moves, self._history
        self.poses.show(event)
        if not self.nothing_moves:
            self._reconstruct(now, stood=stood)
            self._schedule.move()
            history.dirty[:] = True
            return
        if not stood:
            self._rest()
        elif self.count and self._schedule.take_due(now).any():
            self._reconstruct(now, stood=True)
            self._passes.read_resolved(self._resolved)
            history.dirty[:] = True
        if history.dirty.any():
            mix_accumulation(self._resolved, history, self.radiance, prior=False)

    def clear(self) -> None:
        """Forget every sample."""
        self._store.count = self._staged = 0
        self._accumulated = []
        self.poses.reset()
        self._history.clear_accumulation()
        self._passes.clear_accumulation()

    def take_dirty(self) -> NDArray[np.bool_]:
        """(rows, columns) bool of 16-pixel tiles changed since the last call."""
        return take_dirty(self._history)

    def stored(self) -> StoredSamples:
        """See Reconstruction; travels from the GPU. Raises GpuError if that is lost."""
        self._send(moving=not self.nothing_moves)
        state, screen = self._store.read("state"), self._store.read("screen_position")
        self._device.check()
        return StoredSamples(state[TIME], state[CONFIDENCE], screen, self._store.count, self._epoch)

    @property
    def pose(self) -> Pose:
        """The pose that the image shows; only after a refresh."""
        assert self.poses.pose is not None
        return self.poses.pose

    def find_nearest(self) -> NearestSamples:
        """See Reconstruction; travels from the GPU. Raises GpuError if that is lost."""
        if not self._surfaces.size:
            self._surfaces = np.zeros((*self._radiance.shape[:2], 2), np.float32)
        self._bring_up_to_date()
        self._passes.find_surfaces(self._store, self.pose.panel_from_object)
        self._passes.read_surfaces(self._surfaces)
        self._device.check()
        return NearestSamples(self._surfaces[..., 0], self._surfaces[..., 1])

    @property
    def on_gpu(self) -> bool:
        """Whether the GPU has the image that is shown: while something moves, and it was not asked for."""
        return not self._read

    def write_channels(self, covered: GpuReconstruction | None, out: Framelet, *, tone: Tone) -> None:
        """Write colour, depth, object id and alpha of an image that the GPU has, exposed; display bytes also mapped.

        covered : an image on the GPU too, of where objects are, see channels.Coverage. Raises GpuError if the GPU is
        lost.
        """
        planes = (out.depth, out.object_id, out.alpha)
        if any(plane is not None for plane in planes):
            self._bring_up_to_date()
            self._passes.find_surfaces(self._store, self.pose.panel_from_object)
            first, across, down = self.pose.frame
            x, y = self.pose.corner + 0.5
            rays = np.stack([first + x * across + y * down, across, down])
            self._passes.make_channels(None if covered is None else covered._passes, rays)
        if out.encoded:
            self._passes.read_display(out.colour, tone)
        else:
            self._passes.read_shown(out.colour)
            if tone.stops != 0.0:
                out.colour *= tone.gain
        for k, plane in enumerate(planes):
            if plane is not None:
                self._passes.read_channel(k, plane)
        self._device.check()

    def write_newest_times(self, origin: float, time: Float32) -> None:
        """See Reconstruction; travels from the GPU. Raises GpuError if that is lost."""
        self._bring_up_to_date()
        self._passes.read_newest_times(self._store, time)
        self._device.check()
        np.add(time, np.float64(self._epoch - origin), out=time, casting="same_kind")

    def accumulated_counts(self) -> Float32:
        """See Reconstruction; travels from the GPU while something moves. Raises GpuError if that is lost."""
        self._send(moving=not self.nothing_moves)
        counts: Float32 = self._history.accumulation[..., COUNT] if self.nothing_moves else self._passes.read_counts()
        self._device.check()
        return counts

    def _rest(self) -> None:
        """Nothing moves any more: the accumulation and the resolved splats travel to the CPU."""
        self._send(moving=True)
        self._passes.read_history(self._history)
        self._passes.read_resolved(self._resolved)
        self._history.accumulating[:], self._history.held[:] = True, 0xFFFFFFFF  # any may be there
        self._history.begun[0] = len(self._history.begun)  # which pixels is not known
        self._device.check()
        come_to_rest(self.poses, self._history)

    def _reconstruct(self, now: float, *, stood: bool) -> None:
        """Make the image of the event shown from all samples. `stood`: nothing moved before."""
        pose, history, moved = self.poses.pose, self._history, self.poses.moved().astype(np.bool_)
        assert pose is not None
        self._send(moving=not stood, forgotten=self.poses.camera_moved)
        relit = self.poses.relit().astype(np.bool_)
        if self.poses.lit:
            self._relighting.run(self._store, pose.lights, relit)
        if self.poses.doubted is not None:
            self._store.doubt(self.poses.doubted, unlit=self.poses.lit)
            relit = relit | (self.poses.doubted != 0)
        self._reject_cut_away()
        if self.poses.camera_moved:
            self._passes.clear_accumulation()
        elif stood and not self.nothing_moves:
            self._passes.write_history(history)
            self._passes.find_nearest(self._store, pose.panel_from_object)
        self._passes.run(
            self._store, pose.panel_from_object, moved, moved | relit,
            contradicted=not self.nothing_moves and self._contradicted,
            now=self._seconds(now), young=np.float32(YOUNG_S), kept=self._kept,
            behind=behind(pose.pixel),
        )  # fmt: skip
        self._read = False
        if not self.nothing_moves:
            self._contradicted, self._ordinal = False, 0
        if due := self._packing.is_due(self._store.count):
            self._store.pack()
        self._packing.end_refresh(self._store.count, tidied=due)
        self._device.check()

    def _bring_up_to_date(self) -> None:
        """Let what came since the last refresh into the channels; at rest samples of older edits may have come."""
        self._send(moving=not self.nothing_moves)
        self._reject_cut_away()

    def _reject_cut_away(self) -> None:
        if (planes := self.poses.cuts.take()) is not None:
            self._store.reject_cut_away(planes)

    def _send(self, *, moving: bool, forgotten: bool = False) -> None:
        """Let the staged samples travel; in a moving image pixels accumulate them, and contradictions count.

        forgotten : what pixels have accumulated is about to be
        """
        n, self._staged = self._staged, 0
        accumulated, self._accumulated = self._accumulated, []
        if n == 0:
            return
        first = self._store.count
        self._store.append(self._staged_store, n)
        if moving:
            if self._change[:n].any():
                self._passes.reject(self._store, first, self._change[:n], self._ordinal)
                self._contradicted = True
            if not forgotten:
                self._passes.accumulate(self._store, [range(first + r.start, first + r.stop) for r in accumulated])
            self._ordinal += n

    def _evict(self, n: int) -> None:
        """Evict the oldest samples if need be, so that `n` more fit than expected between two refreshes."""
        self._send(moving=not self.nothing_moves)
        self._store.pack()
        room = self._store.capacity - n
        if self._store.count > room:
            self._store.drop_oldest(1.0 - min(self._kept, room) / self._store.count)

    def _seconds(self, time: float) -> np.float32:
        """A time on the store's clock, which starts anew now and then."""
        if abs(time - self._epoch) > CLOCK_ORIGIN_S:
            later = np.float32(time - self._epoch)
            self._staged_store.time[: self._staged] -= later
            self._store.shift(later)
            self._passes.shift_rejections(later)
            self._epoch = time
        return np.float32(time - self._epoch)
