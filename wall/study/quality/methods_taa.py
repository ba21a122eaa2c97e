"""Framed rendering with all that reprojection can do for it: the sceptic's methods.

`taa_*`: every frame's jittered samples are blended into a history at the panel's own resolution. The history follows
each surface (camera and rigid motion), is resampled by Catmull-Rom, clipped to the variance of the 3x3 samples around,
and given up where object or depth say that something else was there (Karis 2014; Yang, Liu, Salvi 2020). Beyond common
practice, in the baseline's favour: a young history weighs as many samples as it has, and while nothing moves nothing
is clipped and every sample weighs the same, so an image at rest converges.

Each image is then warped to every refresh, under the camera and objects of that very moment.
`framed_warp`: the same warp of plain frames.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from wall.core.data import Event, Float32, Samples
from wall.study.quality.baseline import FramedMethod, fill_holes, object_maps
from wall.study.quality.kernels import taa as kernels_taa
from wall.study.quality.kernels import warp as kernels_warp
from wall.study.quality.kernels.maps import PointMaps
from wall.study.quality.method import Method, Setup

GAMMA = np.float32(1.0)  # deviations that a history may differ; Karis's and the survey's usual 1
ALPHA = 0.1


class TemporalDisplay:
    """History, and its warp to the moment of display. With `alpha` = 1 there is no history."""

    def __init__(self, setup: Setup, *, alpha: float, warp: bool, jittered: bool = True, behind: bool = False) -> None:
        """`behind`: what is uncovered shows what is behind, else whatever is around."""
        width, height = setup.size
        self.jittered = jittered
        self._setup, self._warp, self._behind = setup, warp, behind
        self._limit = np.float32(1.0 / alpha - 1.0)
        self._keep = alpha < 1.0
        self.shown = np.zeros((height, width, 4), np.float32)  # radiance and the samples that it stands for
        self._found = np.zeros((height, width, 5), np.float32)
        self._moved = np.zeros((height, width, 3), np.float32)
        self._nearest, self._fallback = np.zeros((2, height, width), np.float32)
        self._origin = np.zeros((height, width, 3), np.float32)
        self._warped = np.zeros((height, width, 4), np.float32)
        self._event: Event | None = None
        self._pose: PointMaps | None = None

    def take(self, raster: Samples, event: Event) -> None:
        """Blends a frame, (h, w) samples, into the reprojected history."""
        still = self._event is not None and event.number == self._event.number and self._keep
        pose = self._pose if still and self._pose is not None else object_maps(self._setup, event)
        frame = kernels_taa.Frame(
            raster=raster, position=np.empty((*raster.shape, 4), np.float32), depth=np.empty(raster.shape, np.float32),
            spacing=np.array(self._setup.size, np.float32) / np.array(raster.shape[::-1], np.float32),
        )  # fmt: skip
        kernels_taa.locate_samples(frame, pose)
        then = pose if self._pose is None else self._pose
        surface = np.ascontiguousarray(self._found[:, :, 3:])
        history = kernels_taa.History(self.shown * np.float32(self._keep), surface)
        kernels_taa.accumulate(
            frame, pose, then.panel_from_object, still, history, self._limit, GAMMA, self.shown, self._found
        )
        self._event, self._pose = event, pose

    def image(self, event: Event) -> Float32:
        """Returns the history, warped to `event` where asked for, (h, w, 3) linear RGB."""
        if not self._warp or self._event is None or event.number == self._event.number:
            return self.shown[:, :, :3]
        table = object_maps(self._setup, event).panel_from_object
        kernels_warp.move_surfaces(self._found, table, self._moved, self._nearest, self._fallback)
        kernels_warp.sources(self._moved, self._nearest, self._fallback, self._origin)
        if kernels_warp.gather(self.shown, self._origin, self._warped):
            self._fill()
        return self._warped[:, :, :3]

    def _fill(self) -> None:
        if self._behind:
            kernels_warp.fill_from_behind(self._warped, np.minimum(self._nearest, self._fallback))
        else:
            fill_holes(self._warped)


def temporal(divisor: int, alpha: float, warp: bool, setup: Setup) -> FramedMethod:
    """TAA of frames with 1 / divisor of the panel's columns and rows."""
    width, height = setup.size
    grid = (max(1, round(width / divisor)), max(1, round(height / divisor)))
    return FramedMethod(setup, grid, TemporalDisplay(setup, alpha=alpha, warp=warp))


def framed_warp(divisor: int, setup: Setup) -> FramedMethod:
    """Frames, each warped until the next is complete."""
    width, height = setup.size
    grid = (max(1, round(width / divisor)), max(1, round(height / divisor)))
    return FramedMethod(setup, grid, TemporalDisplay(setup, alpha=1.0, warp=True, jittered=False))


METHODS: dict[str, Callable[[Setup], Method]] = {
    "framed_warp": partial(framed_warp, 1),
    "taa_full": partial(temporal, 1, ALPHA, True),
    "taa_half": partial(temporal, 2, ALPHA, True),
    "taa_quarter": partial(temporal, 4, ALPHA, True),
    "taa_full_a30": partial(temporal, 1, 0.3, True),
    "taa_half_a30": partial(temporal, 2, 0.3, True),
    "taa_quarter_a30": partial(temporal, 4, 0.3, True),
    "taa_nowarp": partial(temporal, 1, ALPHA, False),
}
