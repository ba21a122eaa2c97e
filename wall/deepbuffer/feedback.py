"""What a sampler may read of the image that its own samples make."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wall.core.data import Float32


class Feedback(NamedTuple):
    """Measurements of one refresh. The arrays are the reconstruction's own: read them, write none.

    Every array is updated in place by the next insert or refresh; kernels can take the whole tuple.
    """

    resolved: Float32  # (h, w, 3) linear RGB, the image shown
    sample_density: Float32  # (h, w) strided, effective samples a pixel: their weights by age and confidence, summed
    accumulation: Float32  # (h, w, 8), see deepbuffer.kernels.accumulation
    accumulating: NDArray[np.bool_]  # (rows, columns) of 16-pixel tiles: whether any of their pixels accumulates
    temporal_gradient: Float32  # (rows, columns) of 16-pixel tiles: mean change of sqrt_irradiance that samples find
    nothing_moves: bool  # the last refresh showed the same event as the one before
