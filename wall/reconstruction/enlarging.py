"""Enlarge a layer's framelet of fewer pixels to those of the panel that shows it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wall.core.data import TRIPLES, Channels, Float32, Float64, Framelet
from wall.deepbuffer.kernels.pixel_buffer import TILE
from wall.reconstruction.display_values import update_display
from wall.reconstruction.kernels import enlarge as kernels

SMOOTH: Channels = frozenset({"colour", "alpha", "albedo", "normal"})  # others are of one surface: never a mean of two


class Axis:
    """For each pixel of a row or a column of the large image the two of the small one around its centre."""

    def __init__(self, small: int, large: int) -> None:
        fraction, self.pixels = _around(small, large, range(2))  # pixels: (large, 2)
        self.share: Float32 = fraction.astype(np.float32)  # (large,) of the second
        self.first_tile, self.last_tile = _tiles_of(self.pixels)


class CubicAxis:
    """For each pixel of a row or a column of the large image the four of the small one around its centre."""

    def __init__(self, small: int, large: int) -> None:
        f, self.pixels = _around(small, large, range(-1, 3))  # pixels: (large, 4)
        cubic = (
            ((-0.5 * f + 1.0) * f - 0.5) * f, (1.5 * f - 2.5) * f * f + 1.0, ((-1.5 * f + 2.0) * f + 0.5) * f,
            (0.5 * f - 0.5) * f * f,
        )  # fmt: skip
        self.weights: Float32 = np.stack(cubic, axis=1).astype(np.float32)  # (large, 4)
        self.first_tile, self.last_tile = _tiles_of(self.pixels)


def _around(small: int, large: int, taps: range) -> tuple[Float64, NDArray[np.int32]]:
    """Of each pixel of the large image: how far it is from pixel 0 of `taps` to pixel 1, and these pixels."""
    centre = (np.arange(large) + 0.5) * (small / large) - 0.5
    first = np.floor(centre)
    return centre - first, np.clip(first[:, None] + np.array(taps), 0, small - 1).astype(np.int32)


def _tiles_of(pixels: NDArray[np.int32]) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """The first and the last tile of the small image that each tile of the large one takes from."""
    starts = range(0, len(pixels), TILE)
    return np.minimum.reduceat(pixels[:, 0], starts) // TILE, np.maximum.reduceat(pixels[:, -1], starts) // TILE


class Enlarger:
    """Brings the framelet of a panel to what a smaller framelet shows. Colours are light, premultiplied by alpha."""

    def __init__(self, small: Framelet, large: Framelet) -> None:
        """`small`: with linear colour, and the channels of `large` at least."""
        self._small, self._large = small, large
        self._down, self._across = (
            Axis(*sizes) for sizes in zip(small.colour.shape[:2], large.colour.shape[:2], strict=True)
        )
        size = large.colour.shape[:2]
        self._light = np.zeros((*size, 3), np.float32) if large.encoded else large.colour
        self._source = np.zeros(size, np.int32)
        self._dirty = np.zeros((len(self._down.first_tile), len(self._across.first_tile)), np.bool_)

    def enlarge(self, dirty: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Redo what takes from the dirty tiles of the small framelet, (rows, columns) bool.

        Returns the 16-pixel tiles of the large one that changed; valid until the next call.
        """
        small, large, down, across = self._small, self._large, self._down, self._across
        kernels.enlarged_tiles(dirty, down.first_tile, down.last_tile, across.first_tile, across.last_tile, self._dirty)
        taps = (down.pixels, down.share, across.pixels, across.share, self._dirty)
        large.event = small.event
        large.stamp(small.refreshed_at)
        kernels.interpolate(small.colour, *taps, self._light)
        if large.encoded:
            update_display(self._light, self._dirty, TILE, large.colour)
        for name in sorted(large.channels & SMOOTH - {"colour"}):
            depth = 3 if name in TRIPLES else 1
            source, out = (f.channel(name).reshape(*f.colour.shape[:2], depth) for f in (small, large))
            kernels.interpolate(source, *taps, out)
        if rest := sorted(large.channels - SMOOTH):
            kernels.nearest_shown(small.alpha, small.rect.width, *taps, self._source)
            for name in rest:
                kernels.take(small.channel(name).reshape(-1), self._source, self._dirty, large.channel(name))
        return self._dirty
