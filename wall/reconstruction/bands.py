"""Bands of an image's rows, one a thread: what samples write to pixels is shared out by the rows that they show in."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wall.core.data import Float32
from wall.core.threads import Threads, split
from wall.deepbuffer.kernels.pixel_buffer import TILE
from wall.deepbuffer.store import SampleStore
from wall.reconstruction.kernels.splat import splat
from wall.reconstruction.kernels.visibility import Band, find_nearest, list_rows


class Bands:
    """A thread reads the samples that show in its rows, or in the row beside, and writes its rows alone.

    It takes them in the order of the store, as one thread would: so sums are the same, bit for bit.
    """

    def __init__(self, height: int, capacity: int, threads: Threads) -> None:
        """`capacity` of the stores that will be given."""
        self._height, self._threads = height, threads
        bands = split(height, threads.count, TILE) if threads.count > 1 else []
        self._listed = {top: np.zeros(capacity, np.uint32) for top, _ in bands}  # by the first row
        self._bands: list[Band | None] = []  # None: the whole image

    @property
    def bytes(self) -> int:
        """Memory of all its arrays."""
        return sum(listed.nbytes for listed in self._listed.values())

    def compile(self, store: SampleStore, nearest: Float32, sums: Float32, irradiance: Float32) -> None:
        """Compile what bands need beyond a whole image: no image is to wait for it. No pixel is written."""
        for indices in self._listed.values():
            none, tiles = Band(0, 0, indices, list_rows(store, 0, 0, 0, indices)), np.zeros((1, 1), np.bool_)
            find_nearest(store, 0, nearest, tiles, none)
            bounds = np.zeros((3, *nearest.shape[:2]), np.float32)
            splat(store, np.zeros(1, np.float32), 0, bounds, tiles, sums, irradiance, none)
            return

    def find_nearest(self, store: SampleStore, count: int, nearest: Float32, tiles: NDArray[np.bool_]) -> None:
        """Find each pixel's nearest sample in some tiles (rows, columns), see kernels.visibility."""

        def find(top: int, bottom: int) -> Band | None:
            band, indices = None, self._listed.get(top)
            if indices is not None:
                band = Band(top, bottom, indices, list_rows(store, count, top - 1, bottom + 1, indices))
            find_nearest(store, count, nearest, tiles, band)
            return band

        self._bands = self._threads.share(self._height, find, unit=TILE)

    def splat(
        self, store: SampleStore, weight: Float32, count: int, bounds: Float32, tiles: NDArray[np.bool_], sums: Float32,
        irradiance: Float32,
    ) -> None:  # fmt: skip
        """Splat the samples whose nearest were found last, see kernels.splat."""

        def splat_bands(first: int, last: int) -> None:
            for band in self._bands[first:last]:
                splat(store, weight, count, bounds, tiles, sums, irradiance, band)

        self._threads.share(len(self._bands), splat_bands)
