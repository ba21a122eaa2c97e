"""The passes over samples and pixels at a refresh, as the kernels of deepbuffer and reconstruction do on the CPU."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wall.core.colour import srgb_curve
from wall.core.data import Float32, Float64
from wall.core.tone_mapping import Tone
from wall.deepbuffer.kernels.accumulation import BITS, object_bits
from wall.deepbuffer.kernels.change import TRUSTED
from wall.deepbuffer.kernels.columns import COUNT, OBJECTS
from wall.deepbuffer.store import PixelHistory
from wall.reconstruction.gpu.device import GROUP, OBJECT_WORDS, WORD_BYTES, Device, GpuError
from wall.reconstruction.gpu.readback import Readback
from wall.reconstruction.gpu.store import GpuStore
from wall.reconstruction.kernels.visibility import Behind
from wall.reconstruction.pyramid import pyramid_sizes

CHANNELS = 4
PIXELS_A_DISPLAY_ITEM = 4  # twelve codes, three words
LARGEST_MERGE = 1 << 14  # samples summed before they are merged into means: float32 sums of more would drift
REJECTION_TIME = 2  # plane of the rejections


class Passes:
    """The pixels' side of an image on the GPU, and the order of passes over samples and pixels."""

    def __init__(self, device: Device, width: int, height: int, *, objects: int) -> None:
        """Raises GpuError where the GPU cannot hold so many pixels."""
        if max(width, height) + 2 > device.largest_texture:
            raise GpuError(
                f"{device.renderer} has textures of {device.largest_texture} pixels, the panel has {width}x{height}",
                wanted="smaller panels",
            )
        self._device, self._area, self._size = device, width * height, (width, height)
        self._objects = device.reserve(OBJECT_WORDS * objects)
        self._pixels = device.reserve(2 * self._area)  # least depth, its sample
        self._rejection = device.reserve(4 * self._area)  # share, ordinal, time, object
        self._nearest = device.reserve(4 * self._area)
        self._accumulated_objects = device.buffer(np.zeros(2 * self._area, np.uint32))  # of means, of new samples
        self._bounds = device.reserve(3 * self._area)
        self._resolved, self._shown = device.reserve(3 * self._area), device.reserve(3 * self._area)
        self._curve = device.buffer(srgb_curve().astype(np.uint32))
        self._codes = device.reserve(3 * -(-self._area // PIXELS_A_DISPLAY_ITEM))
        self._readback = Readback(device)
        self._surfaces, self._channels, self._times = (device.reserve(1) for _ in range(3))  # once they are asked for
        self._changes = device.reserve(1)
        sums = np.zeros(CHANNELS * (width + 2) * (height + 2), np.float32)
        self._sums = device.buffer(sums)  # zero but for while samples are added
        self._splat_sums, self._accumulation = self._texture(width + 2, height + 2), self._texture(width, height)
        self._levels = [self._texture(columns, rows) for rows, columns in pyramid_sizes(height, width)]
        self.clear_accumulation()
        self._collect()
        self._over_pixels(clear=1, contradicted=1)

    def accumulate(self, store: GpuStore, slots: Iterable[range]) -> None:
        """Let pixels accumulate the samples in these slots."""
        names, noted = ("screen_position", "radiance", "object_id"), self._accumulated_objects
        buffers = (self._sums, *(store.arrays[name] for name in names), noted)
        self._accumulation.use(0)
        self._accumulation.bind_to_image(0, read=True, write=True)
        added = 0
        for part in _parts(slots):
            if added + len(part) > LARGEST_MERGE:
                self._device.compute("merge", self._area, (self._sums, noted))
                added = 0
            self._device.compute("accumulate", len(part), buffers, first=part.start, size=self._size)
            added += len(part)
        if added:
            self._device.compute("merge", self._area, (self._sums, noted))

    def reject(self, store: GpuStore, first: int, change: Float32, ordinal: int) -> None:
        """Mark what new samples contradict: `change` (n,) of those from slot `first` on."""
        if self._changes.size < change.nbytes:
            self._changes = self._device.reserve(len(change))
        self._device.write(self._changes, change)
        names = ("screen_position", "state", "object_id")
        buffers = (self._changes, *(store.arrays[name] for name in names), self._rejection)
        for stage in range(3):
            self._device.compute(
                "mark_contradicted", len(change), buffers, first=first, ordinal=ordinal, stage=stage, size=self._size
            )

    def shift_rejections(self, later: np.float32) -> None:
        """Subtract `later` from the times of rejections."""
        offset = REJECTION_TIME * self._area
        self._device.compute("shift", self._area, (self._rejection,), offset=offset, stride=1, later=later)

    def run(
        self,
        store: GpuStore,
        table: Float32,
        moved: NDArray[np.bool_],
        changed: NDArray[np.bool_],
        *,
        contradicted: bool,
        now: np.float32,
        young: np.float32,
        kept: int,
        behind: Behind,
    ) -> None:
        """Make the image: `table` (n + 1, 12) panel_from_object, `moved` (n + 1,).

        changed : (n + 1,), objects that moved or whose light changed; contradicted : whether any sample is
        now, young : seconds of the store's clock, see kernels.visibility, as `behind`; kept : samples that may stay
        """
        self._device.write(self._objects, np.column_stack([table, moved, changed]).astype(np.float32))
        evicts, flag = store.count > kept, int(contradicted)
        if store.count:
            self._reproject(store, contradicted=flag, size=self._size)
        bits = int(object_bits(changed.view(np.uint8)))
        self._over_pixels(store, clear=0, contradicted=flag, changed=bits, told_apart=int(len(changed) <= BITS))
        if changed.any():
            self._device.compute("gaps", self._area, (self._nearest, self._objects))
        self._splat_sums.use(0)
        bounded = (self._nearest, self._bounds, self._objects)
        self._device.compute("bound_depths", self._area, bounded, size=self._size, behind_own=behind.own)
        if evicts:
            store.limit_age(now, kept)
        if store.count:
            self._splat(
                store, now=now, young=young, evicts=int(evicts), size=self._size,
                behind_own=behind.own, behind_other=behind.other,
            )  # fmt: skip
        self._collect()
        self._fill()

    def find_nearest(self, store: GpuStore, table: Float32) -> None:
        """Bring every pixel's nearest sample up to date after a rest, while nothing has moved; `table` see run."""
        self._place_again(store, table)
        if store.count:
            self._over_pixels(store, clear=0, contradicted=0, changed=0)

    def _place_again(self, store: GpuStore, table: Float32) -> None:
        """Find the least depths and their samples anew, while nothing has moved; `table` see run."""
        self._device.write(self._objects, np.column_stack([table, np.zeros((len(table), 2))]).astype(np.float32))
        if store.count:
            self._reproject(store, contradicted=0, size=self._size)

    def _reproject(self, store: GpuStore, **uniforms: Any) -> None:
        a, run = store.arrays, self._device.compute
        names = ("position", "object_id", "state", "screen_position")
        buffers = (*(a[name] for name in names), self._objects, self._rejection, self._pixels)
        self._accumulation.bind_to_image(0, read=False, write=True)
        run("reproject", store.count, buffers, **uniforms)
        run("nearest_slot", store.count, (a["screen_position"], self._pixels), **uniforms)

    def _over_pixels(self, store: GpuStore | None = None, **uniforms: int) -> None:
        arrays = (self._pixels, self._pixels)  # none is read while all is cleared
        if store is not None:
            arrays = (store.arrays["screen_position"], store.arrays["object_id"])
        self._accumulation.bind_to_image(0, read=True, write=True)
        buffers = (*arrays, self._objects, self._pixels, self._rejection, self._nearest, self._accumulated_objects)
        self._device.compute("nearest", self._area, buffers, **uniforms)

    def _splat(self, store: GpuStore, **uniforms: Any) -> None:
        a, screen = store.arrays, store.arrays["screen_position"]
        weighed = (a["state"], screen, store.weight, self._nearest, self._bounds, store.ages, a["object_id"])
        self._device.compute("weigh", store.count, weighed, **uniforms)
        added = (self._sums, screen, a["radiance"], store.weight, self._bounds)
        self._device.compute("splat", store.count, added, groups=-(-CHANNELS * store.count // GROUP), size=self._size)

    def _collect(self) -> None:
        width, height = self._splat_sums.size
        self._splat_sums.bind_to_image(0, read=False, write=True)
        self._device.compute("collect", width * height, (self._sums,))

    def _fill(self) -> None:
        run, fine, border, trusted = self._device.compute, self._splat_sums, 1, TRUSTED
        for level in self._levels:
            fine.use(0)
            level.bind_to_image(0, read=False, write=True)
            run("halve", level.width * level.height, (), border=border, trusted=trusted)
            fine, border, trusted = level, 0, np.float32(1.0)
        filled = self._levels[-1]
        for level in reversed(self._levels):
            filled.use(0)
            level.bind_to_image(0, read=True, write=True)
            run("expand", level.width * level.height, (), top=int(level is filled))
            filled = level
        for location, texture in enumerate((filled, self._splat_sums, self._accumulation)):
            texture.use(location)
        run("resolve", self._area, (self._resolved, self._shown))

    def read_shown(self, shown: Float32) -> None:
        """(h, w, 3) float32, written: the image."""
        self._readback.read(self._shown, shown)

    def read_display(self, rgb: NDArray[np.uint8], tone: Tone) -> None:
        """(h, w, 3) uint8, written: the image as sRGB, exposed and mapped."""
        items, values = -(-self._area // PIXELS_A_DISPLAY_ITEM), 3 * self._area
        buffers = self._shown, self._curve, self._codes
        self._device.compute("display", items, buffers, values=values, gain=tone.gain, mapping=tone.code)
        self._readback.read(self._codes, rgb)

    def find_surfaces(self, store: GpuStore, table: Float32) -> None:
        """Find every pixel's nearest sample also among those that came since the image was made; `table` see run."""
        self._place_again(store, table)
        self._surfaces = self._of_size(self._surfaces, 2 * WORD_BYTES * self._area)
        samples = (store.arrays["screen_position"], store.arrays["object_id"])
        self._device.compute("surfaces", self._area, (*samples, self._pixels, self._nearest, self._surfaces))

    def read_surfaces(self, surfaces: Float32) -> None:
        """(h, w, 2) float32, written: depth and object id of every pixel's nearest sample, see find_surfaces."""
        self._readback.read(self._surfaces, surfaces)

    def make_channels(self, covered: Passes | None, rays: Float64) -> None:
        """Make depth, object id and alpha of the image, and clear it where nothing is; find_surfaces comes before.

        covered : whose image says how much of each pixel objects cover; None: all of it
        rays : (3, 3) float64, see geometry.frusta.ray_frame, but from the centre of the first pixel
        """
        self._channels = self._of_size(self._channels, 3 * WORD_BYTES * self._area)
        shares = self if covered is None else covered
        corner, across, down = (tuple(map(float, row)) for row in rays)
        self._device.compute(
            "channels", self._area, (self._nearest, shares._shown, self._shown, self._channels),
            size=self._size, transparent=int(covered is not None), corner=corner, across=across, down=down,
        )  # fmt: skip

    def read_channel(self, plane: int, values: NDArray[Any]) -> None:
        """(h, w), written: depth (0), object id (1) or alpha (2), see make_channels."""
        self._readback.read(self._channels, values, first=plane * self._area)

    def read_newest_times(self, store: GpuStore, times: Float32) -> None:
        """(h, w) float32, written: when every pixel's newest sample was traced, by the store's clock; -inf: none."""
        self._times = self._of_size(self._times, times.nbytes)
        buffers = (store.arrays["screen_position"], store.arrays["state"], self._times)
        for stage, items in enumerate((self._area, store.count, self._area)):
            if items:
                self._device.compute("newest_times", items, buffers, stage=stage, size=self._size)
        self._readback.read(self._times, times)

    def _of_size(self, buffer: Any, size: int) -> Any:
        """The buffer, or a new one if it has fewer bytes. Raises GpuError where memory ends."""
        return buffer if buffer.size >= size else self._device.reserve(-(-size // WORD_BYTES))

    def read_history(self, history: PixelHistory) -> None:
        """What pixels accumulated, means and counts, and whose samples these hold, written."""
        history.accumulation[..., :CHANNELS] = self._read_means()
        objects = np.empty(self._area, np.uint32)
        self._readback.read(self._accumulated_objects, objects)
        history.accumulation[..., OBJECTS] = objects.reshape(history.accumulation.shape[:2])

    def read_resolved(self, resolved: Float32) -> None:
        """(h, w, 3) float32, written: the image without what pixels accumulated."""
        self._readback.read(self._resolved, resolved)

    def read_counts(self) -> Float32:
        """(h, w) float32: how many samples each pixel has accumulated."""
        return self._read_means()[..., COUNT]

    def write_history(self, history: PixelHistory) -> None:
        """Take over what pixels accumulated, see read_history."""
        self._device.write(self._accumulation, history.accumulation[..., :CHANNELS])
        self._device.write(self._accumulated_objects, history.accumulation[..., OBJECTS].astype(np.uint32))

    def clear_accumulation(self) -> None:
        """Forget what pixels have accumulated."""
        self._accumulation.bind_to_image(0, read=False, write=True)
        self._device.compute("blank", self._area, ())

    def _read_means(self) -> Float32:
        width, height = self._size
        means = np.zeros((height, width, CHANNELS), np.float32)
        self._device.read(self._accumulation, means)
        return means

    def _texture(self, width: int, height: int) -> Any:
        texture = self._device.context.texture((width, height), CHANNELS, dtype="f4")
        texture.filter = self._device.context.NEAREST, self._device.context.NEAREST
        return texture


def _parts(slots: Iterable[range]) -> Iterator[range]:
    """The same slots, those that follow each other joined, in parts of LARGEST_MERGE at most."""
    joined: list[range] = []
    for each in slots:
        if joined and joined[-1].stop == each.start:
            joined[-1] = range(joined[-1].start, each.stop)
        elif each:
            joined.append(each)
    for each in joined:
        for start in range(each.start, each.stop, LARGEST_MERGE):
            yield range(start, min(start + LARGEST_MERGE, each.stop))
