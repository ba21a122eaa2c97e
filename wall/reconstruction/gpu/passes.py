"""What happens to samples and pixels at a refresh, pass by pass, as `kernels_picture` and `kernels_visible` say it."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from wall.core.colour import srgb_curve
from wall.core.data import Float32
from wall.deepbuffer.kernels.pixel_buffer import TILE
from wall.reconstruction.gpu.device import OBJECT_WORDS, Device, GpuError
from wall.reconstruction.gpu.store import GpuStore, reserve
from wall.reconstruction.kernels.fill import TRUSTED

CHANNELS = 4
PIXELS_A_DISPLAY_ITEM = 4  # twelve codes, three words


class Passes:
    """The pixels' side of a picture on the GPU, and the order of passes over samples and pixels."""

    def __init__(self, device: Device, width: int, height: int, *, objects: int) -> None:
        """Raises GpuError where the GPU cannot hold so many pixels."""
        if max(width, height) + 2 > device.largest_texture:
            raise GpuError(
                f"{device.renderer} has textures of {device.largest_texture} pixels, the panel has {width}x{height}",
                wanted="smaller panels",
            )
        self._device, self._area = device, width * height
        self._size, self._columns = (width, height), -(-width // TILE)
        self._objects = reserve(device, OBJECT_WORDS * objects)
        self._tiles = reserve(device, 2 * self._columns * -(-height // TILE))
        self._pixels = reserve(device, 2 * self._area)  # least depth, its sample
        self._doubt = reserve(device, 4 * self._area)  # amount, ordinal, time, object
        self._nearest = reserve(device, 4 * self._area)
        self._front = reserve(device, 3 * self._area)  # depth, rim, crowd
        self._base, self._shown = reserve(device, 3 * self._area), reserve(device, 3 * self._area)
        self._curve = device.context.buffer(srgb_curve().astype(np.uint32))
        self._codes = reserve(device, 3 * -(-self._area // PIXELS_A_DISPLAY_ITEM))
        self._changes = reserve(device, 1)
        self._gathered, self._gathering = self._canvas(width + 2, height + 2)
        self._still, self._stilling = self._canvas(width, height)
        self._levels = [self._texture(*size) for size in _halves(width, height)]
        self._over_pixels(wipe=1, doubted=1)

    def gather_still(self, store: GpuStore, first: int, n: int) -> None:
        """Let pixels gather `n` new samples."""
        arrays = store.arrays
        self._device.draw(
            "still", self._stilling, (first, n), (arrays["screen"], arrays["colour"]), size=self._size
        )  # fmt: skip

    def doubt(self, store: GpuStore, first: int, change: Float32, ordinal: int) -> None:
        """Doubt what new samples contradict: `change` (n,) of those from slot `first` on."""
        if self._changes.size < change.nbytes:
            self._changes = reserve(self._device, len(change))
        self._changes.write(np.ascontiguousarray(change))
        arrays = store.arrays
        buffers = (self._changes, arrays["screen"], arrays["state"], arrays["name"], self._doubt)
        for stage in range(3):
            self._device.compute(
                "doubt", len(change), buffers, first=first, ordinal=ordinal, stage=stage, size=self._size
            )

    def shift_doubt(self, later: np.float32) -> None:
        """Set the times of doubts back."""
        self._device.compute("shift", self._area, (self._doubt,), offset=2 * self._area, stride=1, later=later)

    def run(
        self,
        store: GpuStore,
        table: Float32,
        moved: NDArray[np.bool_],
        changed: NDArray[np.bool_],
        stale: Float32,
        decay: Float32,
        *,
        doubted: bool,
        since: np.float32,
        now: np.float32,
        young: np.float32,
        kept: int,
    ) -> None:
        """Make the picture: `table` (n + 1, 12) panel_from_object, `moved` (n + 1,), `stale`, `decay` (rows, columns).

        changed : (n + 1,), who moved or stands in another light
        since, now, young : seconds of the store's clock, see kernels_visible; kept : samples that may stay
        """
        self._objects.write(np.column_stack([table, moved, changed]).astype(np.float32))
        self._tiles.write(np.stack([stale, decay], axis=-1).astype(np.float32))
        about = {"size": self._size, "tile_columns": self._columns, "doubted": int(doubted)}
        crowded = store.count > kept
        if store.count:
            self._place(store, since=since, **about)
        self._over_pixels(store, wipe=0, doubted=int(doubted))
        self._gathered.use(0)
        self._device.compute("front", self._area, (self._nearest, self._front, self._objects), size=self._size)
        if crowded:
            store.limit_age(now, kept)
        self._gathering.clear()
        if store.count:
            self._splat(store, now=now, young=young, crowded=int(crowded), **about)
        self._fill()

    def _place(self, store: GpuStore, **uniforms: Any) -> None:
        a, run = store.arrays, self._device.compute
        buffers = (
            a["place"],
            a["name"],
            a["state"],
            a["screen"],
            self._objects,
            self._tiles,
            self._doubt,
            self._pixels,
        )
        run("place", store.count, buffers, **uniforms)
        run("first", store.count, (a["screen"], self._pixels), **uniforms)

    def _over_pixels(self, store: GpuStore | None = None, **uniforms: int) -> None:
        arrays = () if store is None else (store.arrays["screen"], store.arrays["name"])
        self._still.bind_to_image(0, read=True, write=True)
        buffers = (*(arrays or (self._pixels, self._pixels)), self._objects, self._pixels, self._doubt, self._nearest)
        self._device.compute("nearest", self._area, buffers, **uniforms)

    def _splat(self, store: GpuStore, **uniforms: Any) -> None:
        a, size = store.arrays, self._size
        seen = (a["state"], a["screen"], store.weight, self._tiles, self._nearest, self._front, store.ages)
        self._device.compute("see", store.count, seen, **uniforms)
        self._device.draw(
            "splat", self._gathering, (0, store.count), (a["screen"], a["colour"], store.weight, self._front), size=size
        )

    def _fill(self) -> None:
        run, fine, border, trusted = self._device.compute, self._gathered, 1, TRUSTED
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
        for location, texture in enumerate((filled, self._gathered, self._still)):
            texture.use(location)
        run("resolve", self._area, (self._base, self._shown))

    def read_shown(self, shown: Float32) -> None:
        """(h, w, 3) float32, written: the picture."""
        self._shown.read_into(shown)

    def read_display(self, rgb: NDArray[np.uint8]) -> None:
        """(h, w, 3) uint8, written: the picture as sRGB."""
        items, values = -(-self._area // PIXELS_A_DISPLAY_ITEM), 3 * self._area
        self._device.compute("display", items, (self._shown, self._curve, self._codes), values=values)
        self._codes.read_into(rgb, size=values)

    def read_still(self, still: Float32, base: Float32) -> None:
        """(h, w, 8) float32, the first four written; (h, w, 3) float32, written: see mix_still."""
        width, height = self._size
        gathered = np.frombuffer(self._still.read(), np.float32).reshape(height, width, CHANNELS)
        still[..., :CHANNELS] = gathered
        self._base.read_into(base)

    def read_counts(self) -> Float32:
        """(h, w) float32: how many samples each pixel has gathered."""
        width, height = self._size
        return np.frombuffer(self._still.read(), np.float32).reshape(height, width, CHANNELS)[..., 3]

    def write_still(self, still: Float32) -> None:
        """(h, w, 8) float32, of which the first four are taken."""
        self._still.write(np.ascontiguousarray(still[..., :CHANNELS]))

    def clear_still(self) -> None:
        self._stilling.clear()

    def _texture(self, width: int, height: int) -> Any:
        texture = self._device.context.texture((width, height), CHANNELS, dtype="f4")
        texture.filter = self._device.context.NEAREST, self._device.context.NEAREST
        return texture

    def _canvas(self, width: int, height: int) -> tuple[Any, Any]:
        texture = self._texture(width, height)
        canvas = self._device.context.framebuffer([texture])
        canvas.clear()
        return texture, canvas


def _halves(width: int, height: int) -> list[tuple[int, int]]:
    """Sizes of the pyramid's levels, down to one pixel."""
    sizes: list[tuple[int, int]] = []
    while not sizes or width > 1 or height > 1:
        width, height = -(-width // 2), -(-height // 2)
        sizes.append((width, height))
    return sizes
