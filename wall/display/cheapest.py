"""Choose how tiles are sent: as JPEG, or without losses where that costs no more.

Both are estimated from every fourth row of a tile, not tried. Lossless WebP costs by how many colours a tile has, or by
how little its neighbours tell of a pixel; a JPEG by its edges. Text, legends and test patterns are smaller without
losses, photographs 2 to 5 times larger.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wall.display.kernels.tiles import measure_tiles
from wall.display.tiles import TILE

# bytes a tile, fitted to 5,500 tiles of renderings, photographs, diagrams and test patterns, at stream.QUALITY;
# of lossless ones a quarter more, and ANYHOW, since they take 3 times the time
ANYHOW, PER_COLOUR, SMOOTH, PER_RESIDUAL = 40.0, 15.0, 50.0, 640.0  # lossless
FLAT, PER_STEP = 60.0, 320.0  # JPEG
JPEG_HEAD = 600.0  # of each: its tables
SPLIT = 400.0  # of a second image: what its time is worth


def exact_tiles(rgb: NDArray[np.uint8], tiles: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Which of the marked tiles of an image (h, w, 3) are to be sent without losses; both (rows, columns)."""
    colours, residuals, steps = (np.zeros(tiles.shape, np.float32) for _ in range(3))
    measure_tiles(rgb, TILE, tiles, colours, residuals, steps)
    lossless = ANYHOW + np.minimum(PER_COLOUR * colours, SMOOTH + PER_RESIDUAL * residuals)
    more = np.where(tiles, lossless - PER_STEP * steps - FLAT, 0.0)  # bytes, than as JPEG
    exact = more < 0.0
    both, alone = more[exact].sum() + SPLIT, more.sum() - JPEG_HEAD
    if min(both, alone) >= 0.0:
        return np.zeros_like(tiles)
    return tiles if alone <= both else exact
