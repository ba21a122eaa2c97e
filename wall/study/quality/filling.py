"""Fill the holes of a picture from what is around them, near first: push-pull (Gortler et al. 1996)."""

from __future__ import annotations

import numpy as np

from wall.core.data import Float32
from wall.study.quality.kernels import warp as kernels_warp


def fill_holes(picture: Float32) -> None:
    """(h, w, 4) float32 colour and weight 0..1, in place: what the weight lacks comes from coarser levels."""
    levels = [picture]
    while max(levels[-1].shape[:2]) > 1:
        height, width = levels[-1].shape[:2]
        levels.append(np.empty((-(-height // 2), -(-width // 2), 4), np.float32))
        kernels_warp.pull(levels[-2], levels[-1])
    for fine, coarse in zip(levels[-2::-1], levels[:0:-1], strict=True):
        kernels_warp.push(coarse, fine)
