"""How far what was on the wall is from the reference image of each moment, by the metrics of `wall measure quality`."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from wall.core.data import Float32, Rect
from wall.core.errors import RunError
from wall.deepbuffer.kernels.pixel_buffer import TILE
from wall.display.image_log import LoggedImages
from wall.geometry.panels import Panel
from wall.reconstruction.dynamic_resolution import Enlarged
from wall.study.live.reference import WallReference
from wall.study.live.timeline import Timeline
from wall.study.quality.image_strips import Bytes
from wall.study.quality.metrics import flip, mean_square, ssim


@dataclass(frozen=True, slots=True, kw_only=True)
class Score:
    """Of one run."""

    rmse_display: float  # over pixels, channels and moments; display values, 0 to 1
    flip: float  # means over moments and panels, a panel counts by its pixels
    ssim: float
    over_time: list[float]  # RMSE at each moment
    flip_over_time: list[float]


class Shows(Protocol):
    """What was on the panels of a wall."""

    def codes(self, panel: Panel, time: float) -> Bytes:
        """(h, w, 3) uint8 sRGB that a panel showed at `time` of the path."""


class Shown:
    """What the panels of a wall showed in one run."""

    def __init__(self, log: LoggedImages, display_delay_s: float | None = None, *, enlarges: bool = False) -> None:
        """`display_delay_s`: from a refresh to its light; the configuration's if None.

        `enlarges`: images of fewer pixels are brought to those of their panel.
        """
        self.timeline, self._log, self._enlarges = Timeline(log, display_delay_s), log, enlarges

    def codes(self, panel: Panel, time: float) -> Bytes:
        """(h, w, 3) uint8 sRGB that a panel showed at `time` of the path: black before its first image.

        Raises RunError where the log has images of another size.
        """
        width, height = panel.pixels
        held = self.timeline.held(panel.id, time)
        if held is None:
            return np.zeros((height, width, 3), np.uint8)
        if held.size != panel.pixels and self._enlarges:
            return enlarged(self._log.rgb(held), panel.pixels)
        if held.size != panel.pixels:
            raise RunError(f"panel {panel.id}: an image of {held.size} pixels was recorded, wanted {panel.pixels}")
        return self._log.rgb(held)


def enlarged(codes: Bytes, size: tuple[int, int]) -> Bytes:
    """(h, w, 3) uint8 sRGB: an image brought to (width, height) pixels as dynamic resolution does it."""
    large = Enlarged(rect_of(codes.shape[1], codes.shape[0]), rect_of(*size))
    large.codes[:] = codes
    rgb = np.zeros((size[1], size[0], 3), np.uint8)
    large.display(np.ones((-(-size[1] // TILE), -(-size[0] // TILE)), np.bool_), rgb, 0, size[1])
    return rgb


def rect_of(width: int, height: int) -> Rect:
    """A whole image."""
    return Rect(x=0, y=0, width=width, height=height)


def score(shown: Shows, reference: WallReference) -> Score:
    """Hold what was shown against the reference images, moment by moment. Raises RunError."""
    panels = reference.wall.panels
    weights = [panel.pixels[0] * panel.pixels[1] for panel in panels]
    found = np.array([[_panel(shown, reference, panel, k) for panel in panels] for k in range(len(reference.times))])
    squares, flips, ssims = (np.average(found[..., i], axis=1, weights=weights) for i in range(3))
    return Score(
        rmse_display=math.sqrt(float(squares.mean())), flip=float(flips.mean()), ssim=float(ssims.mean()),
        over_time=np.sqrt(squares).tolist(), flip_over_time=flips.tolist(),
    )  # fmt: skip


def _panel(shown: Shows, reference: WallReference, panel: Panel, k: int) -> tuple[float, float, float]:
    """Mean square error, FLIP and SSIM of a panel at moment k."""
    a: Float32 = shown.codes(panel, reference.times[k]).astype(np.float32) / np.float32(255.0)
    b = reference.display(panel.id, k)
    return mean_square(a, b), flip(a, b), ssim(a, b)
