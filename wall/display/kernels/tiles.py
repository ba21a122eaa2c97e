"""What tiles of an image cost, and which of them changed visibly."""

from __future__ import annotations

import numpy as np

from wall.core.jit import kernel

int64 = np.int64  # a uint8 would become unsigned, and differences of these wrap around
EVERY = 4  # rows of a tile from one that is looked at to the next
COLOURS = 256  # that are told apart
DROPPED = 16  # of a step from pixel to pixel: what a JPEG hardly keeps
LOG = np.log2(1.0 + np.arange(6 * 255 + 1)).astype(np.float32)  # by three channels' differences


@kernel
def take_visible(shown, new, edge, most, tiles):
    """Of the marked tiles keep those in which some value differs by more than `most`, and copy these.

    shown : (h, w, 3) uint8, such tiles become those of new; new : (h, w, 3) uint8
    edge : int, of a tile, pixels; most : uint8; tiles : (rows, columns) bool, updated
    """
    height, width = new.shape[:2]
    for row in range(tiles.shape[0]):
        for column in range(tiles.shape[1]):
            if not tiles[row, column]:
                continue
            top, left = row * edge, column * edge
            bottom, right = min(top + edge, height), min(left + edge, width)
            differs = False
            i = top
            while i < bottom and not differs:
                for j in range(left, right):
                    for k in range(3):
                        a, b = shown[i, j, k], new[i, j, k]
                        differs |= (max(a, b) - min(a, b)) > most
                i += 1
            tiles[row, column] = differs
            if differs:
                shown[top:bottom, left:right] = new[top:bottom, left:right]


@kernel
def measure_tiles(rgb, edge, tiles, colours, residuals, steps):
    """Measure what the marked tiles cost, in every fourth row; what differs is summed over the channels.

    rgb : (h, w, 3) uint8; edge : int, of a tile, pixels; tiles : (rows, columns) bool
    colours : (rows, columns) float32, how many, up to COLOURS, which a hash tells apart, written
    residuals : (rows, columns) float32, mean log2(1 + difference from the plane through three neighbours), written
    steps : (rows, columns) float32, mean log2(1 + floor(differences from left and upper neighbour / DROPPED)), written
    """
    height, width = rgb.shape[:2]
    seen = np.zeros(COLOURS, np.bool_)
    for row in range(tiles.shape[0]):
        for column in range(tiles.shape[1]):
            if not tiles[row, column]:
                continue
            left, right = column * edge, min((column + 1) * edge, width)
            seen[:] = False
            residual, step, count = np.float32(0.0), np.float32(0.0), 0
            for i in range(row * edge + 1, min((row + 1) * edge, height), EVERY):
                for j in range(left, right):
                    if j > left:
                        own, apart = 0, 0
                        for k in range(3):
                            a, b = int64(rgb[i, j - 1, k]), int64(rgb[i - 1, j, k])
                            here = int64(rgb[i, j, k])
                            own += abs(here - a - b + int64(rgb[i - 1, j - 1, k]))
                            apart += abs(here - a) + abs(here - b)
                        residual += LOG[own]
                        step += LOG[apart // DROPPED]
                        count += 1
                    seen[(int64(rgb[i, j, 0]) + 5 * int64(rgb[i, j, 1]) + 25 * int64(rgb[i, j, 2])) % COLOURS] = True
            colours[row, column] = seen.sum()
            residuals[row, column], steps[row, column] = residual / max(count, 1), step / max(count, 1)
