"""What overlays show, made where the samples are: only while somebody looks, no more often than eyes can read."""

from __future__ import annotations

from wall.core.data import StatisticsImage, Tiling
from wall.deepbuffer.pixel_buffer import PixelBuffer
from wall.reconstruction.choice import Reprojected
from wall.reconstruction.statistics import (
    DENSITY,
    ERROR_REDUCTION,
    codes_of,
    grid_error_reduction,
    statistics_of_pixels,
    statistics_of_store,
    tiling_error_reduction,
)

STATISTICS_PERIOD_S = 0.2  # eyes follow colours of tiles no faster


def statistics_image_of(
    store: Reprojected | PixelBuffer, tilings: list[Tiling], panel: int, *, compared: bool, now: float
) -> StatisticsImage:
    """A panel's statistics image at `now` (seconds of the samples' clock); tiles are the samplers' or a fixed grid."""
    if isinstance(store, PixelBuffer):
        age, density = statistics_of_pixels(store.records, now)
    else:
        age, density = statistics_of_store(store, now)
    rects, error_reduction = (
        tiling_error_reduction(tilings) if tilings else grid_error_reduction(store.radiance, density)
    )
    return StatisticsImage(
        panel=panel,
        compared=compared,
        age=age,
        density=codes_of(density, DENSITY),
        rects=rects,
        error_reduction=codes_of(error_reduction, ERROR_REDUCTION),
    )


class Due:
    """Says when the next statistics image is due."""

    def __init__(self) -> None:
        self._next = float("-inf")

    def now(self, now: float) -> bool:
        if now < self._next:
            return False
        self._next = now + STATISTICS_PERIOD_S
        return True
