"""Choose how tiles are sent: as JPEG, or without losses where that costs no more.

Both are estimated from every fourth row of a tile, not tried. Lossless WebP costs by how many colours a tile has, a JPEG
by its edges: text, legends, test patterns and plain surfaces are smaller without losses, photographs 2 to 4 times larger.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wall.display.kernels.tiles import measure_tiles
from wall.display.tiles import TILE

# bytes a tile, fitted to 5,500 tiles of renderings, photographs, diagrams and test patterns; JPEG of stream.QUALITY
PER_COLOUR = 12.0  # lossless,
MANY = 128  # or, from so many colours in the rows that are looked at, as much as noise
FLAT, PER_STEP = 60.0, 320.0  # JPEG
JPEG_HEAD = 600.0  # of any JPEG: its tables
SPLIT = 80.0  # of a second message


def exact_tiles(rgb: NDArray[np.uint8], tiles: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Which of the marked tiles of an image (h, w, 3) are to be sent without losses; both (rows, columns)."""
    colours, steps = np.zeros(tiles.shape, np.float32), np.zeros(tiles.shape, np.float32)
    measure_tiles(rgb, TILE, tiles, colours, steps)
    lossless = np.where(colours < MANY, PER_COLOUR * colours, 3.0 * TILE * TILE)
    more = np.where(tiles, lossless - PER_STEP * steps - FLAT, 0.0)  # bytes, than as JPEG
    exact = more < 0.0
    both, alone = more[exact].sum() + SPLIT, more.sum() - JPEG_HEAD
    if min(both, alone) >= 0.0:
        return np.zeros_like(tiles)
    return tiles if alone <= both else exact
