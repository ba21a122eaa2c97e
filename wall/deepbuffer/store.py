"""The sample store and the pixels' history: one array for each property; kernels/columns.py names their columns.

Kernels take one tuple in place of many arrays.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wall.core.data import Float32
from wall.deepbuffer.kernels.accumulation import clear_accumulation
from wall.deepbuffer.kernels.columns import ACCUMULATION_COLUMNS
from wall.deepbuffer.kernels.pixel_buffer import TILE

LISTED = 8  # one pixel in so many is cleared by itself: of more, whole tiles are


class SampleStore(NamedTuple):
    """Samples as points of their objects, in no order that means anything.

    Arrays that a scene does not need have a capacity of 0: kernels see that from the shape and leave them alone. So
    further properties cost nothing where they are not used. Such an array is one more field here, one more line in
    `copy_sample`, and is written by `insert`.
    """

    position: Float32  # (3, capacity) in the object's space; a direction for the sky
    object_id: NDArray[np.uint32]  # (capacity,)
    radiance: Float32  # (capacity, 4) linear RGB; column SQRT_IRRADIANCE
    time: Float32  # (capacity,) seconds of the store's clock
    confidence: Float32  # (capacity,) 0..1; 0: rejected
    screen_position: Float32  # (3, capacity) x, y in pixels of the image, depth; OUTSIDE where it is not in the image
    normal: NDArray[np.uint16]  # (capacity,) octahedral, two int8; empty if not lit and not noisy
    light_visibility: NDArray[np.uint32]  # (capacity,) bit k: light k reaches the point; empty if not lit
    albedo: Float32  # (3, capacity) reflected share, NOT_RELIT where it is not known; empty if not lit and not noisy
    light: Float32  # (capacity, 3) radiance over albedo as traced, of which `radiance` shows a mean; empty if not noisy

    @classmethod
    def of(cls, capacity: int, *, lit: bool, noisy: bool = False) -> SampleStore:
        """An empty store; `lit`: with what relighting needs; `noisy`: with what filtering noise needs."""
        described = capacity * (lit or noisy)
        return cls(
            position=np.zeros((3, capacity), np.float32),
            object_id=np.zeros(capacity, np.uint32),
            radiance=np.zeros((capacity, 4), np.float32),
            time=np.zeros(capacity, np.float32),
            confidence=np.zeros(capacity, np.float32),
            screen_position=np.zeros((3, capacity), np.float32),  # depth 0 is outside too; memory comes with samples
            normal=np.zeros(described, np.uint16),
            light_visibility=np.zeros(lit * capacity, np.uint32),
            albedo=np.zeros((3, described), np.float32),
            light=np.zeros((noisy * capacity, 3), np.float32),
        )

    @property
    def capacity(self) -> int:
        """Samples that it has room for."""
        return len(self.object_id)


class PixelHistory(NamedTuple):
    """What the pixels of the image remember: new samples are compared with it, and update it."""

    nearest: Float32  # (h, w, 4) the nearest sample: depth (inf: none), x, y, object id (-1: none; exact to 2^24)
    sqrt_irradiance: Float32  # (h, w, 2) weighted sum and sum of weights; (0, 0, 2) unless changes are detected
    accumulation: Float32  # (h, w, 8), see kernels.accumulation
    light: Float32  # (h, w, 4) mean of its samples' light, and squared deviations of luminance; (0, 0, 4) if not noisy
    rejection: Float32  # (h, w, 2) share of confidence that older samples lose, and the time before which they do
    rejected_object: NDArray[np.uint32]  # (h, w) object whose samples lose it
    temporal_gradient: Float32  # (rows, columns) moving mean of |change of sqrt_irradiance| that samples find in a tile
    contradicted: NDArray[np.bool_]  # (rows, columns) tiles with a pixel that a sample contradicted
    still: NDArray[np.bool_]  # (rows, columns) tiles that nothing that moves can reach, see StillTiles
    settled: NDArray[np.bool_]  # (h, w) pixels of these that show no mirror: no sample contradicts them
    dirty: NDArray[np.bool_]  # (rows, columns) tiles where the image changes
    accumulating: NDArray[np.bool_]  # (rows, columns) tiles that may have an accumulation
    held: NDArray[np.uint32]  # (rows, columns) objects whose samples a tile's accumulation may hold, see object_bit
    begun: NDArray[np.uint32]  # (n,) how many pixels began to accumulate since all were cleared, then y w + x of each;
    # n: not all of them are listed. To be set so by whoever writes to `accumulation` without `accumulate`
    arrived: NDArray[np.int32]  # (rows, columns) samples that came since the tile was resolved, see RestSchedule

    @classmethod
    def of(cls, width: int, height: int, *, detects_change: bool, noisy: bool = False) -> PixelHistory:
        """Of pixels that never had a sample."""
        tiles = -(-height // TILE), -(-width // TILE)
        return cls(
            nearest=np.full((height, width, 4), -1.0, np.float32),
            sqrt_irradiance=np.zeros((detects_change * height, detects_change * width, 2), np.float32),
            accumulation=np.zeros((height, width, ACCUMULATION_COLUMNS), np.float32),
            light=np.zeros((noisy * height, noisy * width, 4), np.float32),
            rejection=np.zeros((height, width, 2), np.float32),
            rejected_object=np.zeros((height, width), np.uint32),
            temporal_gradient=np.zeros(tiles, np.float32),
            contradicted=np.zeros(tiles, np.bool_),
            still=np.zeros(tiles, np.bool_),
            settled=np.zeros((height, width), np.bool_),
            dirty=np.zeros(tiles, np.bool_),
            accumulating=np.zeros(tiles, np.bool_),
            held=np.zeros(tiles, np.uint32),
            begun=np.zeros(1 + -(-height * width // LISTED), np.uint32),
            arrived=np.zeros(tiles, np.int32),
        )

    def clear_accumulation(self) -> None:
        """Clear that of every pixel."""
        clear_accumulation(self)
