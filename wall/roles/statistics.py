"""What overlays show, made where the samples are: only while somebody looks, no more often than eyes can read."""

from __future__ import annotations

from wall.core.data import Survey, Tiling
from wall.deepbuffer.pixel_buffer import PixelBuffer
from wall.reconstruction.choice import Reprojected
from wall.reconstruction.statistics import (
    DENSITY,
    WORTH,
    codes_of,
    grid_worth,
    survey_newest,
    survey_picture,
    tiling_worth,
)

SURVEY_PERIOD_S = 0.2  # eyes follow colours of tiles no faster


def survey_of(
    store: Reprojected | PixelBuffer, tilings: list[Tiling], panel: int, *, compared: bool, now: float
) -> Survey:
    """A panel's survey at `now` (seconds of the samples' clock), its tiles from the samplers or else a fixed grid."""
    if isinstance(store, PixelBuffer):
        age, density = survey_newest(store.records, now)
    else:
        age, density = survey_picture(store, now)
    rects, worth = tiling_worth(tilings) if tilings else grid_worth(store.radiance, density)
    return Survey(
        panel=panel,
        compared=compared,
        age=age,
        density=codes_of(density, DENSITY),
        rects=rects,
        worth=codes_of(worth, WORTH),
    )


class Due:
    """Says when the next survey is due."""

    def __init__(self) -> None:
        self._next = float("-inf")

    def now(self, now: float) -> bool:
        if now < self._next:
            return False
        self._next = now + SURVEY_PERIOD_S
        return True
