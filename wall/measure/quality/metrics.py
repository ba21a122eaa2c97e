"""How far a picture is from the ideal one."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wall.data import Float32


def display_values(linear: NDArray[Any]) -> Float32:
    """sRGB-coded values in 0..1 (IEC 61966-2-1) of linear RGB, clipped to what a display shows."""
    clipped = np.clip(np.asarray(linear, np.float32), 0.0, 1.0)
    coded: Float32 = np.where(clipped <= 0.0031308, 12.92 * clipped, 1.055 * clipped ** (1 / 2.4) - 0.055)
    return coded.astype(np.float32)


def mean_square(a: NDArray[Any], b: NDArray[Any]) -> float:
    """Mean over pixels and channels of the squared difference."""
    difference = np.asarray(a, np.float32) - np.asarray(b, np.float32)
    return float(np.mean(np.square(difference), dtype=np.float64))


def flip(ideal: Float32, shown: Float32) -> float:
    """Mean FLIP (Andersson et al. 2020) of two display pictures at its default 67 pixels a degree."""
    import flip_evaluator

    _, mean, _ = flip_evaluator.evaluate(
        np.ascontiguousarray(ideal), np.ascontiguousarray(shown), "LDR", inputsRGB=True, applyMagma=False
    )
    return float(mean)


def ssim(ideal: Float32, shown: Float32) -> float:
    """Structural similarity (Wang et al. 2004) of two display pictures, mean over the channels."""
    from skimage.metrics import structural_similarity

    return float(structural_similarity(ideal, shown, channel_axis=2, data_range=1.0))


def latency_equivalent(ideals: list[Float32], step_s: float, target: float) -> float:
    """The pure delay of the ideal sequence that gives an RMSE of `target` in display values; seconds.

    Linear between the delays that can be measured (whole steps). inf where even the longest delay, a quarter of the
    sequence, is better than the target (or where nothing moves).
    """
    last = 0.0
    for delay in range(1, max(2, len(ideals) // 4 + 1)):
        pairs = zip(ideals[delay:], ideals[:-delay], strict=True)
        error = math.sqrt(float(np.mean([mean_square(a, b) for a, b in pairs])))
        if error >= target:
            return (delay - 1 + (target - last) / max(error - last, 1e-12)) * step_s
        last = error
    return math.inf
