"""The light field of a reconstruction whose samples are noisy."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wall.core.data import Float32
from wall.deepbuffer.kernels.reproject_rows import RowTables
from wall.deepbuffer.store import PixelHistory, SampleStore
from wall.reconstruction.kernels import edge_filter as kernels_filter
from wall.reconstruction.kernels import light_change as kernels_change
from wall.reconstruction.kernels import light_field as kernels

SAMPLE_EVERY = 20  # pixels: with so many new samples light is filtered anew,
PIXEL_S = 2e-6  # or after so many seconds for each pixel: so its share of a core is bounded
EVERY_SAMPLE = np.float32(-np.inf)


class Lighting:
    """Filters the light of samples over their surfaces, whenever enough of them are new."""

    def __init__(self, height: int, width: int, moves: NDArray[np.uint8], *, scanned: bool = False) -> None:
        """`moves` (objects + 1,): 1 where an object is animated. `scanned`: rows of the image are seen one by one."""

        def zeros(rows: int) -> Float32:
            return np.zeros((rows, *kernels_filter.padded(height, width)), np.float32)

        self._padded = kernels.LightField(
            sums=np.zeros((height, width, kernels.SUMS), np.float32), surface=np.zeros((height, width), np.uint32),
            pixels=zeros(kernels.ROWS), light=zeros(kernels.LIGHTS), filtered=zeros(kernels.LIGHTS),
            scratch=zeros(kernels.LIGHTS), spread=zeros(kernels.SPREADS), spread_scratch=zeros(kernels.SPREADS),
        )  # fmt: skip
        self._padded.pixels[kernels.OBJECT] = kernels_filter.NOWHERE
        first = kernels_filter.BORDER
        inside = np.s_[:, first : first + height, first : first + width]
        self.field = self._padded._replace(
            pixels=self._padded.pixels[inside], light=self._padded.light[inside], spread=self._padded.spread[inside],
            filtered=self._padded.filtered[inside],
        )  # fmt: skip
        tiles = -(-height // kernels_change.LIGHT_TILE), -(-width // kernels_change.LIGHT_TILE)
        self._enough, self._longest = height * width // SAMPLE_EVERY, PIXEL_S * height * width
        self._new = 0  # samples since the light was filtered last,
        self._filtered, self._table = EVERY_SAMPLE, np.zeros((len(moves), 12), np.float32)  # when, and from where
        still = RowTables(self._table, np.zeros(3, np.float32))
        self._rows: RowTables | None = still if scanned else None  # beside the table
        self._moves = moves
        self._probes = np.zeros((2, *tiles, kernels_change.COLUMNS), np.float32)  # of still and of animated objects
        self._changes = np.ones((2, *tiles, 4), np.float32)

    def compile(self, store: SampleStore) -> None:
        """Compile what is not needed at once: no image is to wait for it."""
        kernels_change.correct_light(store, 0, self._changes, self._moves, np.float32(0.0))

    def clear(self) -> None:
        """Forget the light of every surface."""
        self.field.pixels[kernels.OBJECT] = kernels_filter.NOWHERE
        self._probes[:] = 0.0
        self._filtered = EVERY_SAMPLE

    @property
    def bytes(self) -> int:
        """Memory of all its arrays."""
        return sum(array.nbytes for array in (*self._padded, self._probes, self._changes, self._table))

    def probe(self, store: SampleStore, first: int, last: int) -> None:
        """Compare new samples, first..last of the store, with the light that is shown."""
        self._new += last - first
        shown = self._table, self._rows, self.field
        kernels_change.probe_light(store, first, last, *shown, self._moves, self._probes)

    def correct(self, store: SampleStore, count: int, now: np.float32) -> None:
        """Bring older samples to the light that newer ones found. To be called before weights are found."""
        found = [kernels_change.find_changes(self._probes[k], self._changes[k]) for k in range(1 + self._moves.any())]
        if any(found):
            kernels_change.correct_light(store, count, self._changes, self._moves, now)

    def is_due(self, now: np.float32) -> bool:
        """Whether light is to be filtered anew while something moves: enough samples came, or it was long ago."""
        return self._new >= self._enough or not 0.0 <= now - self._filtered < self._longest

    def show_new(self, store: SampleStore, count: int, weight: Float32) -> None:
        """Show new samples in the light that was filtered last; older ones keep what they show, wherever they move."""
        kernels.show_light(store, weight, count, self._filtered, self._table, self._rows, self.field)

    def filter(
        self, store: SampleStore, count: int, weight: Float32, history: PixelHistory, now: np.float32, table: Float32,
        rows: RowTables | None = None,
    ) -> None:  # fmt: skip
        """Filter the light of all samples anew and show them in it; weights and nearest samples are known.

        now : float32 seconds of the store's clock; table : (objects + 1, 12) float32, panel_from_object
        rows : of the image, where these are seen one after the other
        """
        field, self._filtered, self._table, self._new = self.field, now, table, 0
        self._rows = rows
        kernels.gather_light(store, weight, count, history.nearest, field)
        kernels.resolve_light(store, history, field)
        kernels_filter.pool_variance(self._padded)
        kernels_filter.filter_light(self._padded)
        kernels.estimate_bias(history, field)
        kernels.show_light(store, weight, count, EVERY_SAMPLE, table, rows, field)

    def mix(self, resolved: Float32, history: PixelHistory, shown: Float32) -> None:
        """Mix what pixels accumulated at rest into the filtered image: the dirty tiles of `shown` are redone."""
        kernels.mix_filtered(resolved, history, self.field, shown)
