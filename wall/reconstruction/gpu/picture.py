"""The picture of `reconstruction.picture`, made on a GPU: same samples in, same picture out, within float rounding.

New samples are taken in on the CPU, by the same kernel, and travel once; what touches every stored sample or every
pixel of a moving picture happens on the GPU. While nothing moves, the GPU rests: means of still pixels grow on the CPU.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from wall.core.data import Event, Float32, Float64, Rect, Samples
from wall.deepbuffer.kernels.pixel_buffer import TILE
from wall.geometry.panels import Panel
from wall.reconstruction.display_values import update_display
from wall.reconstruction.gpu.device import device
from wall.reconstruction.gpu.passes import Passes
from wall.reconstruction.gpu.relighting import Relighting
from wall.reconstruction.gpu.store import GpuStore
from wall.reconstruction.kernels import picture as kernels
from wall.reconstruction.lamps import Relit, matt_objects
from wall.reconstruction.picture import (
    DECAY_PER_RESIDUAL,
    EPOCH_S,
    SAMPLES_PER_PIXEL,
    SLOW_DECAY,
    SORT_EVERY,
    YOUNG_S,
    Store,
    capacity_for,
    stale_share,
)
from wall.reconstruction.pose import Pose, Posed, Poses, is_shown
from wall.scene.build import Scene
from wall.scene.needs import needs
from wall.scene.sky import sky_irradiance

STAGED = 1 << 17  # samples that wait on the CPU at most, to travel together


class GpuPicture:
    """One panel's picture from reprojected samples; to be used by the thread that made it."""

    def __init__(
        self,
        panel: Panel,
        eye: Float64,
        scene: Scene,
        *,
        rect: Rect | None = None,
        samples_per_pixel: float = SAMPLES_PER_PIXEL,
    ) -> None:
        """`rect` is the part of the panel that is shown, all if None. Raises GpuError where there is no GPU for it."""
        self.rect = rect or Rect(x=0, y=0, width=panel.pixels[0], height=panel.pixels[1])
        width, height = self.rect.width, self.rect.height
        rows, columns = -(-height // TILE), -(-width // TILE)
        self._scene = scene
        self._kept, self._per_pixel = int(samples_per_pixel * width * height), samples_per_pixel
        self._device = device()
        self._relights = needs(scene).relighting
        self._irradiance, self._matt = sky_irradiance(scene.sky), matt_objects(scene)
        self._relit = Relit(self._matt)
        capacity, objects = capacity_for(self._kept, width, height), len(scene.instances) + 1
        self._store = GpuStore(self._device, capacity, lit=self._relights)
        self._passes = Passes(self._device, width, height, objects=objects)
        lamps = len(scene.directional_lights) + len(scene.point_lights)
        self._relighting = Relighting(self._device, self._irradiance, objects=objects, lamps=lamps)
        self._most = min(STAGED, self._store.capacity // 2)  # samples taken in at once
        self._new, self._staged = Store.of(self._most, lit=self._relights), 0
        self._change = np.zeros(self._most, np.float32)  # of the staged samples
        self._ordinal = 0  # new samples that have travelled since the last refresh
        self._until_packed = 0
        # what the kernel that takes samples in writes beside; only judging reads the first three
        self._nearest = np.full((height, width, 4), -1.0, np.float32)
        self._doubt = np.zeros((height, width, 2), np.float32)
        self._doubt_about = np.zeros((height, width), np.int32)
        self._residual = np.zeros((rows, columns), np.float32)
        self._probes = np.zeros((rows, columns, 2), np.float32)
        self.still = np.zeros((height, width, 8), np.float32)
        self.base = np.zeros((height, width, 3), np.float32)
        self._radiance = np.zeros((height, width, 3), np.float32)
        self._read = True  # whether that is what the GPU shows
        self.dirty: NDArray[np.bool_] = np.zeros((rows, columns), np.bool_)
        self._pose: Pose | None = None  # of the picture
        self._poses = Poses(panel, eye, scene, self.rect, lamps=self._relights)
        self._shown: Event | None = None
        self.nothing_moves = False
        self._moved = -math.inf
        self._epoch = 0.0  # the store's clock zero

    @property
    def renderer(self) -> str:
        """What OpenGL calls the GPU."""
        return self._device.renderer

    @property
    def radiance(self) -> Float32:
        """(h, w, 3) float32 linear RGB after the last refresh; travels from the GPU when it is asked for."""
        if not self._read:
            self._passes.read_shown(self._radiance)
            self._read = True
        return self._radiance

    def display(self, dirty: NDArray[np.bool_], rgb: NDArray[np.uint8]) -> None:
        """Redo the dirty tiles of `rgb` (h, w, 3) uint8, sRGB; a moving picture travels as these bytes and no more."""
        if self._read:
            update_display(self._radiance, dirty, TILE, rgb)
        else:
            self._passes.read_display(rgb)

    @property
    def count(self) -> int:
        """Samples stored, the dead that have not left yet among them."""
        return self._store.count + self._staged

    def insert(self, samples: Samples, base_time: float, event: Posed) -> None:
        """Take samples in that were traced under `event`. Raises GpuError if the GPU has given up."""
        known = samples["object_id"] <= len(self._scene.instances)
        samples = samples if known.all() else samples[known]
        for first in range(0, len(samples), self._most):
            self._insert(samples[first : first + self._most], base_time, event)

    def _insert(self, samples: Samples, base_time: float, event: Posed) -> None:
        pose = self._poses.of(event)
        under = self._pose if self._pose is not None else pose
        if self.count + len(samples) > self._store.capacity:
            self._make_room(len(samples))
        if self._staged + len(samples) > self._most:
            self._send(moving=not self.nothing_moves)
        offset, first = self._seconds(base_time), self._staged
        stored = np.float32(self._per_pixel if self.nothing_moves else np.inf)
        steady = not self.nothing_moves or is_shown(event, self._shown)
        self._relit.note(pose.lamps, under.lamps)
        self._staged = kernels.take_in(
            samples, offset, pose.frame, pose.corner, pose.object_from_eye, under.panel_from_object, *self._new,
            first, self._nearest, self.still, self._doubt, self._doubt_about, self._residual, self._probes, self.still,
            steady, self.nothing_moves, stored, False, self.dirty, *pose.lamps, self._matt, self._irradiance,
        )  # fmt: skip
        if self.nothing_moves:
            self._change[first : self._staged] = 0.0  # changes are noise
        else:
            self._change[first : self._staged] = samples["change"]  # all were stored

    def refresh(self, event: Event, now: float) -> None:
        """Show the samples under `event`; nothing moved since the last refresh if it has the same number.

        Raises GpuError if the GPU has given up.
        """
        stood, shown = self.nothing_moves, self._shown
        self.nothing_moves = shown is not None and event.number == shown.number
        self._shown = event
        if self.nothing_moves:
            if not stood:
                self._rest()
            if self.dirty.any():
                kernels.mix_still(self.base, self.still, self.dirty, self.radiance)
            return
        self._move(self._poses.of(event), now, stood=stood)
        self.dirty[:] = True

    def clear(self) -> None:
        """Forget every sample."""
        self._store.count = self._staged = 0
        self._shown = None
        self.still[:] = 0.0
        self._passes.clear_still()

    def take_dirty(self) -> NDArray[np.bool_]:
        """(rows, columns) bool of 16-pixel tiles changed since the last call."""
        dirty = self.dirty.copy()
        self.dirty[:] = False
        return dirty

    def stored(self) -> tuple[Float32, Float32, int, float]:
        """As Picture says it; travels from the GPU. Raises GpuError if that has given up."""
        self._send(moving=not self.nothing_moves)
        state, screen = self._store.read()
        self._device.check()
        return state, screen, self._store.count, self._epoch

    def still_counts(self) -> Float32:
        """As Picture says it; travels from the GPU while something moves. Raises GpuError if that has given up."""
        self._send(moving=not self.nothing_moves)
        counts: Float32 = self.still[..., 3] if self.nothing_moves else self._passes.read_counts()
        self._device.check()
        return counts

    def _rest(self) -> None:
        """Nothing moves any more: what pixels have gathered, and what lies beneath it, come to the CPU."""
        self._send(moving=True)
        self._passes.read_still(self.still, self.base)
        self._device.check()

    def _move(self, pose: Pose, now: float, *, stood: bool) -> None:
        table, last = pose.panel_from_object, self._pose
        moved = np.ones(len(table), np.bool_) if last is None else (table != last.panel_from_object).any(axis=1)
        self._send(moving=not stood)
        changed = moved | self._relight(pose, last)
        if changed.all():
            self._passes.clear_still()
        elif stood:
            self._passes.write_still(self.still)
        now32 = self._seconds(now)
        self._pose = pose
        doubted = bool(self._probes[..., 1].any())
        decay = np.float32(SLOW_DECAY) * (1.0 + DECAY_PER_RESIDUAL * self._residual)
        self._passes.run(
            self._store, table, moved, changed, stale_share(self._probes), decay, doubted=doubted,
            since=np.float32(max(self._moved - self._epoch, -EPOCH_S)), now=now32, young=np.float32(YOUNG_S),
            kept=self._kept,
        )  # fmt: skip
        self._read = False
        self._probes[:] = 0.0
        self._ordinal = 0
        self._until_packed -= 1
        if self._until_packed <= 0:
            self._pack()
        self._device.check()
        self._moved = now

    def _relight(self, pose: Pose, last: Pose | None) -> NDArray[np.bool_]:
        """Bring samples that have travelled into the light of `pose`. Returns (n + 1,) bool, whose light changed."""
        if not self._relights:
            return np.zeros(len(pose.panel_from_object), np.bool_)
        changed = self._relit.take(pose.lamps, last.lamps if last is not None else None).astype(np.bool_)
        self._relighting.run(self._store, pose.lamps, changed)
        return changed

    def _send(self, *, moving: bool) -> None:
        """Let the staged samples travel; in a moving picture still pixels gather them, and contradictions count."""
        n, self._staged = self._staged, 0
        if n == 0:
            return
        first = self._store.count
        self._store.append(self._new, n)
        if moving:
            self._passes.gather_still(self._store, first, n)
            if self._change[:n].any():
                self._passes.doubt(self._store, first, self._change[:n], self._ordinal)
            self._ordinal += n

    def _pack(self) -> None:
        """The dead leave."""
        self._until_packed = SORT_EVERY
        self._store.pack()

    def _make_room(self, n: int) -> None:
        """More came between two refreshes than there is slack for: the dead leave, then if need be the oldest."""
        self._send(moving=not self.nothing_moves)
        self._store.pack()
        room = self._store.capacity - n
        if self._store.count > room:
            self._store.drop_oldest(1.0 - min(self._kept, room) / self._store.count)

    def _seconds(self, time: float) -> np.float32:
        """A time on the store's clock, which starts anew now and then."""
        if abs(time - self._epoch) > EPOCH_S:
            later = np.float32(time - self._epoch)
            self._new.state[0, : self._staged] -= later
            self._store.shift(later)
            self._passes.shift_doubt(later)
            self._epoch = time
        return np.float32(time - self._epoch)
