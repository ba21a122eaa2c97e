"""The light field of a reconstruction whose samples are noisy."""

from __future__ import annotations

import numpy as np

from wall.core.data import Float32
from wall.deepbuffer.store import PixelHistory, SampleStore
from wall.reconstruction.kernels import edge_filter as kernels_filter
from wall.reconstruction.kernels import light_change as kernels_change
from wall.reconstruction.kernels import light_field as kernels

PIXEL_S = 4e-7  # seconds from one filtering to the next, for each pixel: so its share of a core stays the same
EVERY_SAMPLE = np.float32(-np.inf)


class Lighting:
    """Filters the light of samples over their surfaces, at every refresh."""

    def __init__(self, height: int, width: int) -> None:
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
        self._interval = PIXEL_S * height * width
        self._filtered = EVERY_SAMPLE  # when light was filtered last
        self._probes = np.zeros((*tiles, kernels_change.COLUMNS), np.float32)
        self._changes = np.ones((*tiles, 4), np.float32)

    def probe(self, store: SampleStore, first: int, last: int) -> None:
        """Compare new samples, first..last of the store, with the light that is shown."""
        kernels_change.probe_light(store, first, last, self.field, self._probes)

    def correct(self, store: SampleStore, count: int, now: np.float32) -> None:
        """Bring older samples to the light that newer ones found. To be called before weights are found."""
        if kernels_change.find_changes(self._probes, self._changes):
            kernels_change.correct_light(store, count, self._changes, now)

    def is_due(self, now: np.float32) -> bool:
        """Whether light is to be filtered anew: not at every refresh while something moves."""
        return not 0.0 <= now - self._filtered < self._interval

    def show_new(self, store: SampleStore, count: int, weight: Float32) -> None:
        """Show new samples in the light that was filtered last; older ones keep what they show, wherever they move."""
        kernels.show_light(store, weight, count, self._filtered, self.field)

    def filter(
        self, store: SampleStore, count: int, weight: Float32, history: PixelHistory, now: np.float32
    ) -> None:  # fmt: skip
        """Filter the light of all samples anew and show them in it; weights and nearest samples are known.

        now : float32 seconds of the store's clock
        """
        field, self._filtered = self.field, now
        kernels.gather_light(store, weight, count, history.nearest, field)
        kernels.resolve_light(store, history, field)
        kernels_filter.pool_variance(self._padded)
        kernels_filter.filter_light(self._padded, kernels_filter.LEVELS)
        kernels.estimate_bias(history, field)
        kernels.show_light(store, weight, count, EVERY_SAMPLE, field)

    def mix(self, resolved: Float32, history: PixelHistory, shown: Float32) -> None:
        """Mix what pixels accumulated at rest into the filtered image: the dirty tiles of `shown` are redone."""
        kernels.mix_filtered(resolved, history, self.field.pixels, shown)
