"""Matrices between the rays of an event, points of objects and pixels, for the kernels of rival methods."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np


class PointMaps(NamedTuple):
    """Of one event. Row 0 of the tables is the sky, whose points are directions; row n is object n."""

    frame: np.ndarray  # (3, 3) float64: ray directions, see geometry.frusta.ray_frame
    corner: np.ndarray  # (2,) float64: virtual-screen position of the panel's first pixel
    object_from_eye: np.ndarray  # (n + 1, 12) float32: 3 x 4 matrices, row by row
    panel_from_object: np.ndarray  # (n + 1, 12) float32
