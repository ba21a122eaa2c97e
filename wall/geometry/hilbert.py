"""Hilbert order of the pixels of a rectangle of any size."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wall.geometry.kernels import hilbert as kernels


def hilbert_order(width: int, height: int) -> NDArray[np.int32]:
    """Every pixel of a width x height rectangle once, along a generalised Hilbert curve.

    Starts at (0, 0) and ends at the other end of the longer edge (of x, if they are equal). Consecutive pixels
    share an edge, with one exception: if the longer edge is odd and the shorter even there is no such path
    between these corners (on a chess board they have the same colour, and the number of squares is even), so one
    step is diagonal. Only where the shorter edge is 2, no step is, and the end is one pixel before that corner.

    Parameters
    ----------
    width, height : pixels, at least 0

    Returns
    -------
    order : (width * height, 2) int32, x and y of the pixels in order
    """
    order = np.empty((width * height, 2), dtype=np.int32)
    kernels.fill_hilbert(order, width, height)
    return order
