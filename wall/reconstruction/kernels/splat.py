"""Splat samples into an image, and mix in what pixels accumulated while nothing in them moved.

Splat sums have a border of one pixel on every side, so that a sample's four neighbours always exist.
"""

from __future__ import annotations

import numpy as np

from wall.core.jit import inline_kernel, kernel, strict_inline_kernel, strict_kernel
from wall.deepbuffer.kernels.accumulation import MEAN_ALONE
from wall.deepbuffer.kernels.columns import COUNT, IRRADIANCE, SQRT_IRRADIANCE, WEIGHT, X, Y
from wall.deepbuffer.kernels.pixel_buffer import TILE
from wall.reconstruction.kernels.visibility import SHARPNESS

uint32 = np.uint32  # as indices: no test whether they count from the end
ZERO, ONE, HALF = np.float32(0.0), np.float32(1.0), np.float32(0.5)
PRIOR, MOST_PRIOR = np.float32(8.0), np.float32(6.0)  # samples; with as many as the latter a pixel may be complete


@strict_kernel  # bands and whole images are specialisations of it, and have the same bits
def splat(store, weight, count, bounds, tiles, sums, irradiance, band):
    """Splat samples: each spreads over the four nearest pixel centres by a tent, or a steeper one.

    Between two centres its share goes from one to the other within 1 / sharpness pixels, about the edge between them:
    shares still sum to 1. At sharpness 1 that is a tent, far above it the box of which the ideal image is the mean.

    Parameters
    ----------
    store : SampleStore; weight : (capacity,) float32, see weigh; count : int, samples stored
    bounds : (3, h, w) float32, see visibility.bound_depths; sharpness is 1 or more
    tiles : (rows, columns) bool, whose samples these are, and those within REACH of them
    sums : (h + 2, w + 2, 4) float32, weighted radiance and weight, written
    irradiance : (h, w, 2) float32, weighted square root of irradiance and weight, written: a
        sample counts in its own pixel; or empty. Only that of `tiles`
    band : Band of rows that are written, by the samples that show in them and beside; None for the whole image
    """
    radiance, screen = store.radiance.reshape(-1), store.screen_position
    flat, row = sums.reshape(-1), uint32(4 * sums.shape[1])
    top, bottom = 0, bounds.shape[1]
    highest, lowest = uint32(0), uint32(bottom + 2)  # rows of the sums, from the border on
    if band is not None:
        count, top, bottom = band.listed, band.top, band.bottom
        highest = uint32(top + 1) if top > 0 else uint32(0)
        lowest = uint32(bottom + 1) if bottom < bounds.shape[1] else lowest
    flat[row * highest : row * lowest] = ZERO
    for i in range(top, min(bottom, irradiance.shape[0])):
        for column in range(tiles.shape[1]):
            if tiles[i // TILE, column]:
                irradiance[i, column * TILE : (column + 1) * TILE] = ZERO
    light, keeps_irradiance = irradiance.reshape(-1), irradiance.shape[0] > 0
    everywhere = tiles.all()
    sharpness, width = bounds[SHARPNESS].reshape(-1), uint32(bounds.shape[2])
    for m in range(count):
        k = m if band is None else band.indices[m]
        w = weight[k]
        if not w > ZERO:
            continue
        x, y, n = screen[X, k], screen[Y, k], uint32(4) * uint32(k)
        pixel = uint32(y) * width + uint32(x)
        sharp = sharpness[pixel]
        own = band is None or top <= np.int64(y) < bottom
        if own and keeps_irradiance and (everywhere or tiles[uint32(y) // uint32(TILE), uint32(x) // uint32(TILE)]):
            i = uint32(2) * pixel
            light[i + uint32(IRRADIANCE)] += w * radiance[n + uint32(SQRT_IRRADIANCE)]
            light[i + uint32(WEIGHT)] += w
        x += HALF  # border included
        y += HALF
        i, j = uint32(y), uint32(x)
        fx = min(max((x - np.float32(j) - HALF) * sharp + HALF, ZERO), ONE)
        fy = min(max((y - np.float32(i) - HALF) * sharp + HALF, ZERO), ONE)
        red, green, blue = radiance[n], radiance[n + uint32(1)], radiance[n + uint32(2)]
        w11 = fx * fy * w
        w10 = fy * w - w11
        w01 = fx * w - w11
        w00 = max(w - w01 - w10 - w11, ZERO)  # it may be rounded below
        at = i * row + j * uint32(4)
        if band is None or highest <= i < lowest:
            add_two(flat, at, red, green, blue, w00, w01)
        if band is None or highest <= i + uint32(1) < lowest:
            add_two(flat, at + row, red, green, blue, w10, w11)


@strict_inline_kernel
def add_two(flat, i, red, green, blue, u, v):
    """Add to two neighbours: eight numbers in a row, all read before any is written, so that they become vectors."""
    a, b, c, d = flat[i], flat[i + uint32(1)], flat[i + uint32(2)], flat[i + uint32(3)]
    e, f, g, h = flat[i + uint32(4)], flat[i + uint32(5)], flat[i + uint32(6)], flat[i + uint32(7)]
    a, b, c, d = a + u * red, b + u * green, c + u * blue, d + u
    e, f, g, h = e + v * red, f + v * green, g + v * blue, h + v
    flat[i], flat[i + uint32(1)], flat[i + uint32(2)], flat[i + uint32(3)] = a, b, c, d
    flat[i + uint32(4)], flat[i + uint32(5)], flat[i + uint32(6)], flat[i + uint32(7)] = e, f, g, h


@kernel
def copy_tiles(source, tiles, sums):
    """Copy splat sums (h + 2, w + 2, 4) of some tiles and of the pixels around, to which their samples spread."""
    height, width = sums.shape[0], sums.shape[1]
    for row in range(tiles.shape[0]):
        for column in range(tiles.shape[1]):
            if tiles[row, column]:
                right = min((column + 1) * TILE + 2, width)
                for i in range(row * TILE, min((row + 1) * TILE + 2, height)):
                    sums[i, column * TILE : right] = source[i, column * TILE : right]


@kernel
def mix_accumulation(under, history, shown, prior):
    """Mix the accumulated mean of n samples into the resolved splats, or into what an image of fewer pixels showed.

    Of splats 1 / (1 + n)^2 stay, from MEAN_ALONE samples on none: splats may show what is no longer there, and at rest
    none are redone. A prior counts as PRIOR samples, less from sample to sample, and no more from the MOST_PRIOR-th on:
    its pixels know nothing of details, yet are means of more samples.

    under : (h, w, 3) float32; history : PixelHistory, its dirty tiles are redone
    shown : (h, w, 3) float32, written
    prior : bool, `under` is one
    """
    dirty, accumulation = history.dirty, history.accumulation
    height, width = under.shape[0], under.shape[1]
    source, out = under.reshape(-1), shown.reshape(-1)
    for row in range(dirty.shape[0]):
        for column in range(dirty.shape[1]):
            if not dirty[row, column]:
                continue
            left, right = column * TILE, min((column + 1) * TILE, width)
            for i in range(row * TILE, min((row + 1) * TILE, height)):
                first = uint32(3 * (i * width + left))
                if not history.accumulating[row, column]:
                    for k in range(3 * (right - left)):
                        out[first + uint32(k)] = source[first + uint32(k)]
                    continue
                for j in range(left, right):
                    n = accumulation[i, j, COUNT]
                    part = share_of_prior(n) if prior else share_of_splats(n)
                    own = ONE - part
                    for c in range(3):
                        shown[i, j, c] = part * under[i, j, c] + own * accumulation[i, j, c]


@inline_kernel
def share_of_splats(n):
    """See mix_accumulation."""
    return ONE / ((ONE + n) * (ONE + n)) if n < MEAN_ALONE else ZERO


@inline_kernel
def share_of_prior(n):
    """See mix_accumulation."""
    return PRIOR / (PRIOR + n) * max(ONE - n / MOST_PRIOR, ZERO)
