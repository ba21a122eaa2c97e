"""The images that overlays show, made where the samples are, a few times a second while a viewer looks."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from wall.core.data import Rect, StatisticsImage
from wall.core.errors import RemoteProtocolError
from wall.deepbuffer.kernels.pixel_buffer import TILE
from wall.deepbuffer.pixel_buffer import PixelBuffer
from wall.geometry.panels import Panel
from wall.reconstruction.choice import AnyReconstruction
from wall.reconstruction.statistics import (
    DENSITY,
    ERROR_REDUCTION,
    codes_of,
    expected_error_reduction,
    grid_error_reduction,
    statistics_of_pixels,
    statistics_of_store,
)
from wall.sampling.tiles import Measured

STATISTICS_PERIOD_S = 0.2  # eyes follow colours of tiles no faster


def statistics_image_of(
    store: AnyReconstruction | PixelBuffer, tiles: list[StatisticsImage], panel: int, *, compared: bool, now: float
) -> StatisticsImage:
    """A panel's statistics image at `now`, seconds of the samples' clock.

    `tiles`: images of renderers, whose tiles it has; those of a fixed grid if there are none.
    """
    if isinstance(store, PixelBuffer):
        age, density = statistics_of_pixels(store.records, now)
    else:
        age, density = statistics_of_store(store, now)
    if tiles:
        rects = np.concatenate([image.rects for image in tiles])
        codes = np.concatenate([image.error_reduction for image in tiles])
    else:
        rects, error_reduction = grid_error_reduction(store.radiance, density)
        codes = codes_of(error_reduction, ERROR_REDUCTION)
    return StatisticsImage(
        panel=panel,
        compared=compared,
        age=age,
        density=codes_of(density, DENSITY),
        rects=rects,
        error_reduction=codes,
    )


def tiles_of(rank: int, panel: int, measured: Iterable[Measured]) -> StatisticsImage:
    """A renderer's image: the tiles of its threads' samplers."""
    tiles = list(measured)
    contrast, density = (np.concatenate([getattr(m, name) for m in tiles]) for name in ("contrast", "density"))
    nothing = np.empty((0, 0), np.uint8)
    return StatisticsImage(
        rank=rank,
        panel=panel,
        compared=False,
        age=nothing,
        density=nothing,
        rects=np.concatenate([m.rects for m in tiles]),
        error_reduction=codes_of(expected_error_reduction(contrast**2, density), ERROR_REDUCTION),
    )


class Due:
    """Says when the next statistics image is due."""

    def __init__(self) -> None:
        self._next = float("-inf")

    def now(self, now: float) -> bool:
        """True if a period has passed since the last True; `now` in seconds."""
        if now < self._next:
            return False
        self._next = now + STATISTICS_PERIOD_S
        return True


def check_statistics_image(image: StatisticsImage, panel: Panel) -> None:
    """Raise RemoteProtocolError for a statistics image whose tiles are not this panel's."""
    width, height = panel.pixels
    if image.age.shape != (-(-height // TILE), -(-width // TILE)):
        raise RemoteProtocolError(f"statistics_image of {image.age.shape} tiles, panel {panel.id} has {width}x{height}")
    if not Rect(x=0, y=0, width=width, height=height).contains(image.bounds):
        raise RemoteProtocolError(f"statistics_image: a tile reaches outside panel {panel.id} of {width}x{height}")
