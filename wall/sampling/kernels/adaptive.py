"""Adaptive sampling: a systematic draw over the scores of pixels."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from wall.core.jit import inline_kernel, kernel
from wall.core.kernels.hashing import hash_uint32
from wall.sampling.kernels.permutation import INSIDE, R2_X, R2_Y

PACKET = 16  # rays
BLOCK = 4  # pixels, edge of the blocks that tiles consist of, and are walked in
uint32, uint64 = np.uint32, np.uint64  # as indices: no test whether they count from the end
ZERO = np.float32(0.0)
X, Y, WIDTH, HEIGHT = 0, 1, 2, 3  # columns of a rectangle


class Tiles(NamedTuple):
    """A division of (h, w) pixels: every pixel lies in exactly one of the tiles in `order`.

    Tiles begin at multiples of BLOCK, and end there or at the border of the image.
    """

    rects: np.ndarray  # (capacity, 4) int32: X, Y, WIDTH, HEIGHT, pixels of the region
    sums: np.ndarray  # (capacity,) float64: sum of the scores of a tile's pixels, as of the last draw
    tile_of: np.ndarray  # (h, w) int32: tile of each pixel
    order: np.ndarray  # (n,) int32: the tiles there are, neighbours in a row


class Pixels(NamedTuple):
    """Where positions of a region are placed."""

    visits: np.ndarray  # (h, w) uint16: next index of each pixel in its R2 sequence
    seed: int
    x0: int  # panel pixel of visits[0, 0]
    y0: int


class Marks(NamedTuple):
    """The marks of a systematic draw inside one tile."""

    first: float  # where the first lies in the sum of the tile's scores
    step: float  # from one to the next


@kernel
def draw(score, tiles, pixels, sequence, xy):
    """Place rays by one systematic draw over the scores of all pixels, along a curve through the tiles.

    Marks at equal distances over the sum of all scores: every tile, block and pixel gets its share of the rays rounded
    down or up, so that few rays are spread as evenly as many. Neighbours on the curve share packets.

    Parameters
    ----------
    score : (h, w) float32
    tiles : Tiles; sums are written
    pixels : Pixels, visits are counted up
    sequence : int, random numbers are a hash of (pixels.seed, sequence)
    xy : (n, 2) float32, written: panel pixels

    Returns
    -------
    filled : int, positions written: all, or none where no pixel has a score
    """
    total, block_sums = sum_tiles(score, tiles)
    if not total > 0.0:
        return 0
    step = total / xy.shape[0]
    at = hash_uint32(hash_uint32(np.uint32(pixels.seed), np.uint32(sequence)), np.uint32(0)) * 2.0**-32 * step
    seen, filled = 0.0, 0
    for tile in tiles.order:
        marks, before = Marks(at - seen, step), filled
        seen += tiles.sums[tile]
        while at < seen and filled < xy.shape[0]:
            filled += 1
            at += step
        if filled > before:
            draw_inside(score, tiles.rects[tile], marks, block_sums, xy[before:filled])
    for k in range(filled):
        write_position(pixels, xy[k])
    return filled


@inline_kernel
def blocks_along(edge):
    """Blocks that an edge of so many pixels touches."""
    return (edge + BLOCK - 1) // BLOCK


@kernel
def sum_tiles(score, tiles):
    """Sum the scores (h, w) of each tile, whose sums are written.

    Returns
    -------
    total : float64, sum of all
    block_sums : (blocks_along(h), blocks_along(w)) float32, those of blocks of 4 x 4 pixels
    """
    block_sums = np.empty((blocks_along(score.shape[0]), blocks_along(score.shape[1])), np.float32)
    columns = np.zeros(BLOCK * block_sums.shape[1], np.float32)
    for row in range(block_sums.shape[0]):
        sum_blocks(score[BLOCK * row : min(BLOCK * row + BLOCK, score.shape[0])], columns, block_sums[row])
    total = 0.0
    for tile in tiles.order:
        first, top, across, down = blocks_in(tiles.rects[tile])
        tile_sum = 0.0
        for row in range(top, top + down):
            for column in range(first, first + across):
                tile_sum += block_sums[row, column]
        tiles.sums[tile] = tile_sum
        total += tile_sum
    return total, block_sums


@inline_kernel
def blocks_in(rect):
    """The blocks of a tile: column and row of the first, how many across and down. rect : (4,) int32, see Tiles"""
    first, top = int(rect[X]) // BLOCK, int(rect[Y]) // BLOCK
    return first, top, blocks_along(int(rect[WIDTH])), blocks_along(int(rect[HEIGHT]))


@inline_kernel
def sum_blocks(score, columns, sums):
    """Write the sums of a row of blocks, along the whole image: vector code, and what memory is fast at.

    score : (up to 4, w) float32; columns : (4 n,) float32, scratch, 0 from w on; sums : (n,) float32
    """
    columns[: score.shape[1]] = ZERO
    for i in range(score.shape[0]):
        line = score[i]
        for j in range(line.shape[0]):
            columns[j] += line[j]
    for k in range(sums.shape[0]):
        j = uint64(BLOCK) * uint64(k)
        sums[k] = (columns[j] + columns[j + uint64(1)]) + (columns[j + uint64(2)] + columns[j + uint64(3)])


@inline_kernel
def draw_inside(score, rect, marks, block_sums, xy):
    """Write the pixels of a tile's marks.

    The curve takes blocks of 4 x 4 pixels in a serpentine order, and the pixels of each in Morton order. So where all
    pixels score alike, 16 marks on 256 pixels are a grid of every fourth one.

    score : (h, w) float32; rect : (4,) int32, see Tiles; marks : Marks; block_sums : see sum_tiles
    xy : (n, 2) float32, written for all of its marks: column and row
    """
    first, top, across, down = blocks_in(rect)
    at, seen, filled = marks.first, 0.0, 0
    i, j = uint32(rect[Y]), uint32(rect[X])  # the last pixel with a score
    for row in range(top, top + down):
        for k in range(across):
            column = first + across - 1 - k if (row - top) & 1 else first + k
            before, seen = seen, seen + block_sums[uint32(row), uint32(column)]
            if not at < seen:
                continue
            for m in range(BLOCK * BLOCK):
                y, x = uint32(BLOCK * row + (m >> 1 & 1 | m >> 2 & 2)), uint32(BLOCK * column + (m & 1 | m >> 1 & 2))
                if y >= score.shape[0] or x >= score.shape[1] or not score[y, x] > ZERO:
                    continue
                i, j = y, x
                before += score[i, j]
                while at < before and filled < xy.shape[0]:
                    xy[filled, 0], xy[filled, 1] = j, i
                    filled += 1
                    at += marks.step
                if not at < seen:
                    break
    for k in range(filled, xy.shape[0]):  # rounding left some over
        xy[k, 0], xy[k, 1] = j, i


@inline_kernel
def write_position(pixels, position):
    """Replace a pixel by the next position in it: its R2 sequence, which a hash of the pixel shifts.

    position : (2,) float32: column and row of the pixel; panel pixels are written
    """
    j, i = uint32(position[0]), uint32(position[1])
    key = hash_uint32(hash_uint32(uint32(pixels.seed), i), j)
    n = pixels.visits[i, j]
    pixels.visits[i, j] = n + np.uint16(1)
    u = key * 2.0**-32 + n * R2_X
    v = hash_uint32(key, np.uint32(1)) * 2.0**-32 + n * R2_Y
    position[0] = pixels.x0 + j + (u - math.floor(u)) * INSIDE
    position[1] = pixels.y0 + i + (v - math.floor(v)) * INSIDE
