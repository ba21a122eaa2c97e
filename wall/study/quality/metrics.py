"""How far shown images are from reference ones, at each scored refresh and over the run.

*Display values* are what a screen is sent before rounding: linear RGB clipped to [0, 1], then the sRGB curve
(IEC 61966-2-1). `rmse_display` is over pixels, channels and scored refreshes of those; `rmse` is the same of linear
RGB as it is, unclipped, so that highlights weigh in it. Both stand for lateness too: the reference image is the exact
refresh's.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from wall.core.colour import srgb_encoded
from wall.core.data import Float32


def display_values(linear: Float32) -> Float32:
    """(..., 3) float32 linear RGB to display values in [0, 1]."""
    return srgb_encoded(linear)


def mean_square(a: Float32, b: Float32) -> float:
    """Mean of the squared differences of two equal-shaped arrays; summed in float64."""
    difference = a - b
    return mean_product(difference, difference)


def mean_product(a: Float32, b: Float32) -> float:
    """Mean of the products of two equal-shaped arrays; summed in float64."""
    return float(np.einsum("i,i->", a.ravel(), b.ravel(), dtype=np.float64)) / max(a.size, 1)


@dataclass(slots=True, kw_only=True)
class Score:
    """Takes a run's images in the order of time: `add` for each scored refresh."""

    judged: frozenset[int]  # scored images, counted from 0, that the slow metrics are taken of
    over_time: list[float] = field(default_factory=list)  # RMSE of display values at each scored refresh
    _linear: float = 0.0
    _display: float = 0.0
    _change: float = 0.0
    _flip: list[float] = field(default_factory=list)
    _ssim: list[float] = field(default_factory=list)
    _last: tuple[Float32, Float32, Float32] | None = None

    def add(self, shown: Float32, *references: Float32) -> None:
        """(h, w, 3) float32 linear RGB each; two references are of independent noise, see Reference.halves."""
        first, second = references[0], references[-1]
        a, b, c = display_values(shown), display_values(first), display_values(second)
        square = mean_product(a - b, a - c)
        if len(self.over_time) in self.judged:
            reference = b if first is second else display_values((first + second) / np.float32(2.0))
            self._flip.append(flip(a, reference))
            self._ssim.append(ssim(a, reference))
        if self._last is not None:
            was = self._last
            change = a - was[0]
            self._change += mean_product(change - (b - was[1]), change - (c - was[2]))
        self._last = a, b, c
        self._linear += mean_product(shown - first, shown - second)
        self._display += square
        self.over_time.append(math.sqrt(max(square, 0.0)))

    @property
    def rmse(self) -> float:
        """Root mean square error in linear RGB, over all refreshes."""
        return math.sqrt(max(self._linear, 0.0) / max(len(self.over_time), 1))

    @property
    def rmse_display(self) -> float:
        """Root mean square error in display codes, over all refreshes."""
        return math.sqrt(max(self._display, 0.0) / max(len(self.over_time), 1))

    @property
    def flicker(self) -> float:
        """RMSE of the change from one scored refresh to the next, against the reference's change; display values."""
        return math.sqrt(max(self._change, 0.0) / max(len(self.over_time) - 1, 1))

    @property
    def flip(self) -> float:
        """Mean LDR-FLIP of the judged images, 0 (equal) to 1; 67 pixels a degree."""
        return float(np.mean(self._flip)) if self._flip else math.nan

    @property
    def ssim(self) -> float:
        """Mean structural similarity of the judged images, up to 1 (equal)."""
        return float(np.mean(self._ssim)) if self._ssim else math.nan


def flip(shown: Float32, reference: Float32) -> float:
    """FLIP of display values. Andersson et al., "FLIP: A Difference Evaluator for Alternating Images", 2020."""
    import flip_evaluator

    _, mean, _ = flip_evaluator.evaluate(reference, shown, "LDR", applyMagma=False)
    return float(mean)


def ssim(shown: Float32, reference: Float32) -> float:
    """SSIM of display values, 7x7 windows. Wang et al., "Image Quality Assessment", 2004."""
    from skimage.metrics import structural_similarity

    return float(structural_similarity(reference, shown, channel_axis=2, data_range=1.0))  # type: ignore[no-untyped-call]


def delay_of(error: float, errors: list[float], step_ms: float) -> float | None:
    """The pure delay of the reference image (ms) that has an error: the first at which the curve reaches it.

    `errors[k]` is the error of the reference image shown k steps late; linear in between. None: more than any in it.
    """
    for k in range(1, len(errors)):
        low, high = errors[k - 1], errors[k]
        if high >= error:
            share = (error - low) / (high - low) if high > low else 0.0
            return step_ms * (k - 1 + max(share, 0.0))
    return None
