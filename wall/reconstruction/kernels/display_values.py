"""Display values from radiance."""

from __future__ import annotations

from wall.core.jit import kernel
from wall.operators.kernels.pixels import display_code


@kernel
def display_tiles(radiance, dirty, tile, curve, rgb):
    """Encode the changed tiles of an image for display: clip to 0..1, sRGB curve, 8 bits; NaN shows as 0.

    Parameters
    ----------
    radiance : (h, w, 3) float32, linear RGB
    dirty : (rows, columns) bool, tiles to redo; tile : int, their edge in pixels
    curve : (4097,) uint8, sRGB code of (k / 4096)^2: looking up by square root keeps dark steps fine
    rgb : (h, w, 3) uint8, updated in place

    Returns
    -------
    redone : int, pixels written
    """
    redone = 0
    for row in range(dirty.shape[0]):
        for column in range(dirty.shape[1]):
            if not dirty[row, column]:
                continue
            for y in range(row * tile, min((row + 1) * tile, radiance.shape[0])):
                for x in range(column * tile, min((column + 1) * tile, radiance.shape[1])):
                    for c in range(3):
                        rgb[y, x, c] = display_code(radiance[y, x, c], curve)
                    redone += 1
    return redone
