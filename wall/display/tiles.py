"""Which tiles of a panel's image have changed, so that displays get these alone.

An image says of each of its tiles in which version it last changed. A display that holds an older version needs the
tiles that are newer than it, however many versions it missed.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from wall.core.data import Rect
from wall.core.kernels.differences import mark_differing
from wall.display.base import PanelImage

TILE = 32  # pixels; a multiple of 8: JPEG blocks of one tile take nothing from another


def updated(old: PanelImage, rgb: NDArray[np.uint8], version: int) -> PanelImage:
    """Give a panel the image `rgb`: `old` itself if no pixel differs, else a new one of `version`.

    rgb : (h, w, 3) uint8 sRGB, the shape of old's
    """
    if old.tiles is None:  # what displays hold of an earlier image with this id is not known here
        return replace(old, rgb=rgb, version=version, tiles=np.full(_grid(rgb), version))
    differs = changed_tiles(old.rgb, rgb)
    return replace(old, rgb=rgb, version=version, tiles=np.where(differs, version, old.tiles)) if differs.any() else old


def changed_tiles(old: NDArray[np.uint8], new: NDArray[np.uint8]) -> NDArray[np.bool_]:
    """(rows, columns) bool: tiles in which two images (h, w, 3) differ. 480x270: 0.06 ms if none does, 3 us if all."""
    assert old.shape == new.shape
    differs = np.empty(_grid(new), np.bool_)
    mark_differing(old.reshape(len(old), -1), new.reshape(len(new), -1), TILE, 3 * TILE, differs)
    return differs


def changed_since(image: PanelImage, version: int | None) -> NDArray[np.bool_]:
    """(rows, columns) bool: the tiles that differ from an older version; all of them if that is None."""
    if version is None or image.tiles is None:
        return np.full(_grid(image.rgb), version != image.version)
    return np.asarray(image.tiles > version)


def _grid(rgb: NDArray[np.uint8]) -> tuple[int, int]:
    """Rows and columns of an image's tiles."""
    return -(-rgb.shape[0] // TILE), -(-rgb.shape[1] // TILE)


def tile_rects(tiles: NDArray[np.bool_], width: int, height: int) -> list[Rect]:
    """Rectangles of an image of width x height pixels that hold the marked tiles and no other, each pixel once.

    Runs of tiles in a row; the same runs in rows that follow each other are one.
    """
    found: list[Rect] = []
    above: dict[tuple[int, int], int] = {}  # runs of the row before, first and behind the last: where each one began
    for row, marked in enumerate([*tiles, np.zeros(tiles.shape[1], np.bool_)]):
        edges = np.flatnonzero(np.diff(marked, prepend=False, append=False)).tolist()
        runs = {run: above.pop(run, row) for run in zip(edges[::2], edges[1::2], strict=True)}
        found += [_pixels((*run, top, row), width, height) for run, top in above.items()]
        above = runs
    return found


def _pixels(run: tuple[int, int, int, int], width: int, height: int) -> Rect:
    left, right, top, bottom = (TILE * n for n in run)
    return Rect(x=left, y=top, width=min(right, width) - left, height=min(bottom, height) - top)


def packed(rgb: NDArray[np.uint8], tiles: NDArray[np.bool_]) -> NDArray[np.uint8]:
    """The marked tiles of an image, row by row, in one image that is at most as wide; tiles at edges are filled up.

    Tile k of them stands at column k % n and row k // n, n = min(their number, columns of `tiles`).

    Parameters
    ----------
    rgb : (h, w, 3) uint8
    tiles : (rows, columns) bool, at least one
    """
    places = np.argwhere(tiles)
    columns = min(len(places), tiles.shape[1])
    out = np.zeros((TILE * -(-len(places) // columns), TILE * columns, 3), np.uint8)
    for k, (row, column) in enumerate(places.tolist()):
        y, x = TILE * (k // columns), TILE * (k % columns)
        tile = rgb[TILE * row : TILE * (row + 1), TILE * column : TILE * (column + 1)]
        height, width = tile.shape[:2]
        out[y : y + height, x : x + width] = tile
        out[y + height : y + TILE, x : x + width] = tile[-1]  # what is cut off at the edge costs next to nothing
        out[y : y + TILE, x + width : x + TILE] = out[y : y + TILE, x + width - 1 : x + width]
    return out
