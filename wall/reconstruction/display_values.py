"""Linear radiance to 8-bit sRGB, only where it changed."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wall.core.colour import srgb_curve
from wall.core.data import Float32
from wall.core.tone_mapping import AS_IT_IS, Tone
from wall.reconstruction.kernels import display_values as kernels

_CURVE = srgb_curve()


def update_display(
    radiance: Float32, dirty: NDArray[np.bool_], tile: int, rgb: NDArray[np.uint8], *, tone: Tone = AS_IT_IS
) -> int:
    """Redo the dirty tiles of `rgb` (h, w, 3) uint8 from `radiance` (h, w, 3) float32, exposed and mapped.

    Returns pixels redone.
    """
    assert rgb.strides[1:] == (3, 1)  # else its rows would be copies
    rows, codes = radiance.reshape(len(rgb), -1), rgb.reshape(len(rgb), -1)
    return int(kernels.display_tiles(rows, dirty, tile, _CURVE, tone.gain, tone.code, codes))
