"""SVGF: one-sample frames of noisy light, filtered in time and over surfaces, for scenes of paths.

After Schied et al., "Spatiotemporal variance-guided filtering" (HPG 2017): light without albedo and its moments follow
each surface (camera and rigid motion), their variance steers an a-trous filter, whose first level is the history of
the next frame. As there, TAA takes what the filter leaves: see methods_taa, which also shows it at every refresh under
the newest camera and objects, and makes panel pixels of coarser frames. Beyond common practice, in the baseline's
favour: the filter goes by the variance of the mean that the history is; lamps are no brighter than a display shows
before they are spread over pixels; what is uncovered shows what is behind. While nothing moves every frame weighs the
same, and the image is drawn towards the plain means of its samples, so it converges.

`svgf_two_thirds`, `svgf_half`, `svgf_quarter`: frames with so many of the panel's columns and rows, which come 2.25, 4
and 16 times as often. `..._adaptive`: the history is given up where new frames contradict it beyond
their standard error, cf. Schied et al., "Gradient estimation for real-time adaptive temporal filtering" (2018).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from wall.core.data import Event, Float32, Samples
from wall.study.quality.baseline import FramedMethod, object_maps
from wall.study.quality.kernels import svgf as kernels_svgf
from wall.study.quality.kernels import taa as kernels_taa
from wall.study.quality.kernels.maps import PointMaps
from wall.study.quality.method import Method, Setup
from wall.study.quality.methods_taa import TemporalDisplay

LEVELS = 5
SIGMA = np.float32(2.0)  # deviations of luminance, of the mean that a history is; the paper has 4, of a single frame
TAA_ALPHA = 0.5  # what the filter leaves is hardly noisy: more history only lags
CEILING = np.float32(1.0)  # of displays
TRUST = np.float32(64.0)  # samples of a pixel at rest that weigh as much as what the filter says
UNLIMITED = np.float32(1e9)  # frames of a history


@dataclass(frozen=True, slots=True, kw_only=True)
class Tuning:
    """What may be chosen by hindsight: the values are the best of those tried at 100k and 400k rays a second."""

    alpha: float = 0.2  # the least share of a new frame in a history that moves
    doubt: tuple[float, float] | None = None  # see kernels.svgf.judge_history; None keeps every history


class SvgfDisplay:
    """History of light, its filter, and the display of what that leaves."""

    jittered = True

    def __init__(self, setup: Setup, grid: tuple[int, int], tuning: Tuning) -> None:
        columns, rows = grid
        self._setup, self._tuning = setup, tuning
        self._display = TemporalDisplay(setup, alpha=TAA_ALPHA, warp=True, behind=True)
        self._spacing = np.array(setup.size, np.float32) / np.array(grid, np.float32)
        self._history, self._followed = np.zeros((2, rows, columns, kernels_svgf.PLANES), np.float32)
        self._light = np.zeros((3, rows, columns, 3), np.float32)
        self._variance = np.zeros((2, rows, columns), np.float32)
        self._differences = np.zeros((2, rows, columns, 4), np.float32)
        self._surfaces, self._before = (_surfaces(rows, columns) for _ in range(2))
        width, height = setup.size
        self._sums = np.zeros((height, width, 4), np.float32)  # of samples since the last event
        self._event: Event | None = None
        self._pose: PointMaps | None = None

    def take(self, raster: Samples, event: Event) -> None:
        """Filters a frame, (rows, columns) samples, and displays it."""
        still = self._event is not None and event.number == self._event.number
        pose = self._pose if still and self._pose is not None else object_maps(self._setup, event)
        then = pose if self._pose is None else self._pose
        self._surfaces, self._before = self._before, self._surfaces
        now, tuning = self._surfaces, self._tuning
        light = self._light[0]
        frame = kernels_taa.Frame(raster, now.position, now.depth, self._spacing)
        kernels_taa.locate_samples(frame, pose)
        kernels_svgf.demodulate(raster, now.normal, light)
        followed = self._followed
        kernels_svgf.follow(raster, now, self._before, self._history, then.panel_from_object, self._spacing, followed)
        if tuning.doubt is not None and not still:
            kernels_svgf.judge_history(now, light, followed, np.array(tuning.doubt, np.float32), *self._differences)
        kernels_svgf.integrate(light, followed, UNLIMITED if still else np.float32(1.0 / tuning.alpha - 1.0))
        self._filter(still)
        self._history, self._followed = followed, self._history
        shown = raster.copy()
        kernels_svgf.remodulate(self._light[1], shown)
        kernels_svgf.limit_radiance(shown, CEILING)
        self._display.take(shown, event)
        self._settle(raster, still)
        self._event, self._pose = event, pose

    def _filter(self, still: bool) -> None:
        """Filters what is integrated to `_light[1]`; the first level becomes the history."""
        integrated, (variance, other), (_, source, target) = self._followed, self._variance, self._light
        kernels_svgf.estimate_variance(self._surfaces, integrated, variance)
        source[:] = integrated[:, :, :3]
        for level in range(LEVELS):
            kernels_svgf.filter_level(self._surfaces, source, variance, 1 << level, SIGMA, target, other)
            source, target, variance, other = target, source, other, variance
            if level == 0 and not still:
                integrated[:, :, :3] = source
        self._light[1] = source

    def _settle(self, raster: Samples, still: bool) -> None:
        if not still:
            self._sums[:] = 0.0
        kernels_svgf.rest(raster, self._sums)
        if still:
            kernels_svgf.settle(self._sums, TRUST, self._display.shown)

    def image(self, event: Event) -> Float32:
        """Returns what is shown under `event`, (h, w, 3) linear RGB."""
        return self._display.image(event)


def _surfaces(rows: int, columns: int) -> kernels_svgf.Surfaces:
    return kernels_svgf.Surfaces(
        np.zeros((rows, columns, 4), np.float32),
        np.zeros((rows, columns), np.float32),
        np.zeros((rows, columns, 3), np.float32),
    )


def filtered(divisor: float, tuning: Tuning, setup: Setup) -> FramedMethod:
    """SVGF of frames with 1 / divisor of the panel's columns and rows."""
    width, height = setup.size
    grid = (max(1, round(width / divisor)), max(1, round(height / divisor)))
    return FramedMethod(setup, grid, SvgfDisplay(setup, grid, tuning))


ADAPTIVE = Tuning(doubt=(6.0, 10.0))

METHODS: dict[str, Callable[[Setup], Method]] = {
    "svgf": partial(filtered, 1.0, Tuning()),
    "svgf_a10": partial(filtered, 1.0, Tuning(alpha=0.1)),
    "svgf_a05": partial(filtered, 1.0, Tuning(alpha=0.05)),
    "svgf_two_thirds": partial(filtered, 1.5, Tuning()),
    "svgf_half": partial(filtered, 2.0, Tuning()),
    "svgf_quarter": partial(filtered, 4.0, Tuning()),
    "svgf_adaptive": partial(filtered, 1.0, ADAPTIVE),
    "svgf_two_thirds_adaptive": partial(filtered, 1.5, ADAPTIVE),
    "svgf_half_adaptive": partial(filtered, 2.0, ADAPTIVE),
    "svgf_quarter_adaptive": partial(filtered, 4.0, ADAPTIVE),
}
