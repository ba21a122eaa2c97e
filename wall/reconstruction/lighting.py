"""The light field of a reconstruction whose samples are noisy."""

from __future__ import annotations

import numpy as np

from wall.core.data import Float32
from wall.deepbuffer.store import PixelHistory, SampleStore
from wall.reconstruction.kernels import edge_filter as kernels_filter
from wall.reconstruction.kernels import light_change as kernels_change
from wall.reconstruction.kernels import light_field as kernels


class Lighting:
    """Filters the light of samples over their surfaces, at every refresh."""

    def __init__(self, height: int, width: int) -> None:
        def zeros(rows: int) -> Float32:
            return np.zeros((rows, height, width), np.float32)

        self.field = kernels.LightField(
            sums=np.zeros((height, width, kernels.SUMS), np.float32), pixels=zeros(kernels.ROWS),
            light=zeros(kernels.LIGHTS), filtered=zeros(kernels.LIGHTS), scratch=zeros(kernels.LIGHTS),
            spread=zeros(kernels.SPREADS), spread_scratch=zeros(kernels.SPREADS),
        )  # fmt: skip
        tiles = -(-height // kernels_change.LIGHT_TILE), -(-width // kernels_change.LIGHT_TILE)
        self._probes = np.zeros((*tiles, kernels_change.COLUMNS), np.float32)
        self._changes = np.ones((*tiles, 4), np.float32)

    def probe(self, store: SampleStore, first: int, last: int) -> None:
        """Compare new samples, first..last of the store, with the light that is shown."""
        kernels_change.probe_light(store, first, last, self.field, self._probes)

    def correct(self, store: SampleStore, count: int, now: np.float32) -> None:
        """Bring older samples to the light that newer ones found."""
        if kernels_change.find_changes(self._probes, self._changes):
            kernels_change.correct_light(store, count, self._changes, now)

    def show(self, store: SampleStore, count: int, weight: Float32, history: PixelHistory) -> None:
        """Bring the samples' radiance to the filtered light of this refresh; weights and nearest samples are known."""
        field = self.field
        kernels.gather_light(store, weight, count, history.nearest, field.sums)
        kernels.resolve_light(history.nearest, history.accumulation, history.light, field)
        kernels_filter.pool_variance(field)
        kernels_filter.filter_light(field, kernels_filter.LEVELS)
        kernels.estimate_bias(history.light, history.accumulation, field)
        kernels.show_light(store, weight, count, field)

    def mix(self, resolved: Float32, history: PixelHistory, shown: Float32) -> None:
        """Mix what pixels accumulated at rest into the filtered image: the dirty tiles of `shown` are redone."""
        kernels.mix_filtered(resolved, history, self.field.pixels, shown)
