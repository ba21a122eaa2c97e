"""What tiles of an image cost, and which of them changed visibly."""

from __future__ import annotations

import numpy as np

from wall.core.jit import kernel

EVERY = 4  # rows of a tile from one that is looked at to the next
COLOURS = 256  # that are told apart
DROPPED = 16  # of a step from pixel to pixel, summed over channels and two neighbours: what a JPEG hardly keeps
LOG = np.log2(1.0 + np.arange(6 * 255 // DROPPED + 1)).astype(np.float32)


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
def measure_tiles(rgb, edge, tiles, colours, steps):
    """Count the colours of the marked tiles, and measure their steps from pixel to pixel, in every fourth row.

    rgb : (h, w, 3) uint8; edge : int, of a tile, pixels; tiles : (rows, columns) bool
    colours : (rows, columns) float32, up to COLOURS, which a hash tells apart, written
    steps : (rows, columns) float32, mean of log2(1 + step / DROPPED), rounded down inside, written
    """
    height, width = rgb.shape[:2]
    seen = np.zeros(COLOURS, np.bool_)
    for row in range(tiles.shape[0]):
        for column in range(tiles.shape[1]):
            if not tiles[row, column]:
                continue
            left, right = column * edge, min((column + 1) * edge, width)
            seen[:] = False
            bits, count = np.float32(0.0), 0
            for i in range(row * edge + 1, min((row + 1) * edge, height), EVERY):
                for j in range(left, right):
                    red, green, blue = int(rgb[i, j, 0]), int(rgb[i, j, 1]), int(rgb[i, j, 2])
                    seen[(red + 5 * green + 25 * blue) & (COLOURS - 1)] = True
                    if j > left:
                        step = abs(red - int(rgb[i, j - 1, 0])) + abs(red - int(rgb[i - 1, j, 0]))
                        step += abs(green - int(rgb[i, j - 1, 1])) + abs(green - int(rgb[i - 1, j, 1]))
                        step += abs(blue - int(rgb[i, j - 1, 2])) + abs(blue - int(rgb[i - 1, j, 2]))
                        bits += LOG[step // DROPPED]
                        count += 1
            colours[row, column] = seen.sum()
            steps[row, column] = bits / max(count, 1)
