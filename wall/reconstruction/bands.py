"""Bands of an image's rows, one a thread: what samples write to pixels is shared out by the rows that they show in."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wall.core.data import Float32
from wall.core.threads import Threads, split
from wall.deepbuffer.kernels.pixel_buffer import TILE
from wall.deepbuffer.kernels.reproject import BLOCK
from wall.deepbuffer.store import SampleStore
from wall.reconstruction.kernels.bands import Band, join_lists, list_bands
from wall.reconstruction.kernels.splat import splat
from wall.reconstruction.kernels.visibility import find_nearest


class Bands:
    """A thread reads the samples that show in its rows, or in the row beside, and writes its rows alone.

    It takes them in the order of the store, as one thread would: so sums are the same, bit for bit.
    """

    def __init__(self, height: int, capacity: int, threads: Threads) -> None:
        """`capacity` of the stores that will be given."""
        self._threads = threads
        bands = split(height, threads.count, TILE) if threads.count > 1 else []
        self._edges = np.array([0, *(bottom for _, bottom in bands)], np.int64)
        self._indices = np.zeros((len(bands), capacity), np.uint32)  # of each band's samples
        self._bands: list[Band | None] = []  # None: the whole image

    @property
    def bytes(self) -> int:
        """Memory of all its arrays."""
        return self._indices.nbytes

    def compile(self, store: SampleStore, nearest: Float32, sums: Float32, irradiance: Float32) -> None:
        """Compile what bands need beyond a whole image: no image is to wait for it. No pixel is written."""
        if len(self._indices) > 0:
            _, none = self._list(store, 0, 0)
            band, tiles = self._band(0, np.zeros(1, np.int64), none[None]), np.zeros((1, 1), np.bool_)
            band = band._replace(bottom=0)
            find_nearest(store, 0, nearest, tiles, band)
            bounds = np.zeros((3, *nearest.shape[:2]), np.float32)
            splat(store, np.zeros(1, np.float32), 0, bounds, tiles, sums, irradiance, band)

    def find_nearest(self, store: SampleStore, count: int, nearest: Float32, tiles: NDArray[np.bool_]) -> None:
        """Find each pixel's nearest sample in some tiles (rows, columns), see kernels.visibility."""
        if len(self._indices) == 0:
            find_nearest(store, count, nearest, tiles, None)
            self._bands = [None]
            return
        lists = self._threads.share(count, lambda first, last: self._list(store, first, last), unit=BLOCK)
        firsts = np.array([first for first, _ in lists], np.int64)
        listed = np.array([listed for _, listed in lists], np.int64).reshape(-1, len(self._indices))

        def find(first: int, last: int) -> list[Band | None]:
            bands: list[Band | None] = []
            for n in range(first, last):
                bands.append(band := self._band(n, firsts, listed))
                find_nearest(store, count, nearest, tiles, band)
            return bands

        self._bands = [band for bands in self._threads.share(len(self._indices), find) for band in bands]

    def _list(self, store: SampleStore, first: int, last: int) -> tuple[int, NDArray[np.int64]]:
        """List samples first to last - 1 by bands. Returns `first`, and the samples of each band."""
        listed = np.zeros(len(self._indices), np.int64)
        list_bands(store, first, last, self._edges, self._indices, listed)
        return first, listed

    def _band(self, n: int, firsts: NDArray[np.int64], listed: NDArray[np.int64]) -> Band:
        """A band of all samples: those of each range of the store, (ranges,), (ranges, bands)."""
        indices = self._indices[n]
        count = join_lists(indices, firsts, np.ascontiguousarray(listed[:, n]))
        return Band(int(self._edges[n]), int(self._edges[n + 1]), indices, count)

    def splat(
        self, store: SampleStore, weight: Float32, count: int, bounds: Float32, tiles: NDArray[np.bool_], sums: Float32,
        irradiance: Float32,
    ) -> None:  # fmt: skip
        """Splat the samples whose nearest were found last, see kernels.splat."""

        def splat_bands(first: int, last: int) -> None:
            for band in self._bands[first:last]:
                splat(store, weight, count, bounds, tiles, sums, irradiance, band)

        self._threads.share(len(self._bands), splat_bands)
