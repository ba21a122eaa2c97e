"""Display values from radiance."""

from __future__ import annotations

import numpy as np

from wall.core.jit import kernel
from wall.core.kernels.tone_mapping import NONE, map_row
from wall.operators.kernels.pixels import encode_row


@kernel
def display_tiles(radiance, dirty, tile, curve, gain, mapping, rgb):
    """Encode the changed tiles of an image for display: map tones, clip to 0..1, sRGB curve, 8 bits; NaN shows as 0.

    Parameters
    ----------
    radiance : (h, 3 w) float32, linear RGB
    dirty : (rows, columns) bool, tiles to redo; tile : int, their edge in pixels
    curve : (4097,) uint8, sRGB code of (k / 4096)^2: looking up by square root keeps dark steps fine
    gain : float32, light is multiplied by it; mapping : int, see core.kernels.tone_mapping
    rgb : (h, 3 w) uint8, updated in place

    Returns
    -------
    redone : int, pixels written
    """
    redone = 0
    places, exposed = np.empty(radiance.shape[1], np.int32), np.empty(radiance.shape[1], np.float32)
    for row in range(dirty.shape[0]):
        first = 0
        while first < dirty.shape[1]:
            last = first + 1
            while last < dirty.shape[1] and dirty[row, last] == dirty[row, first]:  # a run of tiles
                last += 1
            left, right = 3 * first * tile, min(3 * last * tile, radiance.shape[1])
            for y in range(row * tile, min((row + 1) * tile, radiance.shape[0]) if dirty[row, first] else 0):
                row_of_light = radiance[y, left:right]
                for k in range(right - left):
                    exposed[k] = gain * row_of_light[k]
                if mapping != NONE:
                    map_row(exposed[: right - left], mapping)
                encode_row(exposed[: right - left], curve, places, rgb[y, left:right])
                redone += (right - left) // 3
            first = last
    return redone
