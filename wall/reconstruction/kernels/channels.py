"""Channels that compositing needs beside colour: depth, object id, time and alpha of every pixel."""

from __future__ import annotations

import math

import numpy as np

from wall.core.jit import inline_kernel, kernel
from wall.deepbuffer.kernels.columns import DEPTH, X, Y
from wall.deepbuffer.kernels.pixel_buffer import TILE
from wall.deepbuffer.kernels.reproject import FAR

INFINITE = np.float32(np.inf)
ZERO, ONE = np.float32(0.0), np.float32(1.0)


@kernel
def channels_of_records(records, dirty, moment, transparent, gain, colour, depth, alpha, time, object_id):
    """Write the channels of newest samples, in the dirty tiles. Channels that are not wanted come as None.

    Parameters
    ----------
    records : (h, w) deepbuffer PIXEL
    dirty : (rows, columns) bool
    moment : float64, seconds, the zero of `time`
    transparent : bool, pixels that show no object get alpha 0 and no colour
    gain : float32, colours are multiplied by it
    colour : (h, w, 3) float32; depth, alpha, time : (h, w) float32; object_id : (h, w) uint32; written
    """
    for row in range(dirty.shape[0]):
        for column in range(dirty.shape[1]):
            if not dirty[row, column]:
                continue
            for y in range(row * TILE, min((row + 1) * TILE, records.shape[0])):
                for x in range(column * TILE, min((column + 1) * TILE, records.shape[1])):
                    pixel = records[y, x]
                    nothing = transparent and pixel["object_id"] == 0
                    if colour is not None:
                        for c in range(3):
                            colour[y, x, c] = ZERO if nothing else gain * pixel["shown"][c]
                    if depth is not None:
                        depth[y, x] = pixel["depth"]
                    if alpha is not None:
                        alpha[y, x] = ZERO if nothing else ONE
                    if time is not None:
                        time[y, x] = pixel["time"] - moment
                    if object_id is not None:
                        object_id[y, x] = pixel["object_id"]


@kernel
def channels_of_nearest(nearest, frame, corner, covered, dirty, colour, alpha, depth, object_id):
    """Write depth and object id of an image of reprojected samples, in the dirty tiles.

    A pixel has those of its nearest sample; without a sample of an object, where it is covered all the same, those of
    the nearest among its eight neighbours. A pixel that shows the background, and so do its neighbours, is not covered,
    whatever was filled in from afar.

    Parameters
    ----------
    nearest : NearestSamples
    frame : (3, 3) float64, see geometry.frusta.ray_frame; corner : (2,) float64, of the panel in the virtual screen
    covered : (h, w, 3) float32, share of each pixel that objects cover, first of three | None: all is covered
    dirty : (rows, columns) bool
    colour : (h, w, 3), times coverage, cleared where nothing is; alpha : (h, w) float32 | None, written
    depth : (h, w) float32, written: distance from the eye, inf = background; object_id : (h, w) uint32 | None, written
    """
    shown, depths = nearest.object_id, nearest.depth
    height, width = depths.shape
    for row in range(dirty.shape[0]):
        for column in range(dirty.shape[1]):
            if not dirty[row, column]:
                continue
            for i in range(row * TILE, min((row + 1) * TILE, height)):
                for j in range(column * TILE, min((column + 1) * TILE, width)):
                    near, near_id, share = INFINITE, np.float32(0.0), ONE
                    if covered is not None:
                        share = min(max(covered[i, j, 0], ZERO), ONE)
                    if share > ZERO:
                        own_id = shown[i, j]
                        if own_id > ZERO or (own_id == ZERO and covered is None):
                            near, near_id = depths[i, j], own_id
                        else:
                            for di in range(max(i - 1, 0), min(i + 2, height)):
                                for dj in range(max(j - 1, 0), min(j + 2, width)):
                                    if shown[di, dj] > ZERO and depths[di, dj] < near:
                                        near, near_id = depths[di, dj], shown[di, dj]
                    if covered is not None and near == INFINITE and shown[i, j] == ZERO:
                        share = ZERO
                        for c in range(3):
                            colour[i, j, c] = 0
                    if alpha is not None:
                        alpha[i, j] = share
                    if not near < FAR:
                        depth[i, j] = INFINITE
                    else:
                        dx, dy, dz = direction_of(frame, corner, i, j)
                        depth[i, j] = near * math.sqrt(dx * dx + dy * dy + dz * dz)
                    if object_id is not None:
                        object_id[i, j] = np.uint32(near_id)


@inline_kernel
def direction_of(frame, corner, i, j):
    """The direction through the centre of pixel (i, j), depth 1 along the panel's axis; see channels_of_nearest."""
    x, y = corner[0] + j + 0.5, corner[1] + i + 0.5
    return (
        frame[0, 0] + x * frame[1, 0] + y * frame[2, 0],
        frame[0, 1] + x * frame[1, 1] + y * frame[2, 1],
        frame[0, 2] + x * frame[1, 2] + y * frame[2, 2],
    )


@kernel
def newest_times(times, confidence, screen, count, later, time):
    """Find the time of the newest sample in every pixel; -inf where there is none.

    times, confidence : (capacity,) float32, screen : (3, capacity) float32, see SampleStore
    later : float64, seconds to add; time : (h, w) float32, written
    """
    time[:] = -INFINITE
    for k in range(count):
        if screen[DEPTH, k] > ZERO and confidence[k] > ZERO:
            i, j = int(screen[Y, k]), int(screen[X, k])
            when = np.float32(times[k] + later)
            if when > time[i, j]:
                time[i, j] = when


@kernel
def copy_tiles(source, dirty, gain, out):
    """Copy the dirty tiles of (h, w, 3) float32, times `gain`, float32."""
    for row in range(dirty.shape[0]):
        for column in range(dirty.shape[1]):
            if dirty[row, column]:
                top, left = row * TILE, column * TILE
                bottom, right = min(top + TILE, source.shape[0]), min(left + TILE, source.shape[1])
                for y in range(top, bottom):
                    for x in range(left, right):
                        for c in range(3):
                            out[y, x, c] = gain * source[y, x, c]


@kernel
def sky_of_panel(frame, corner, zenith, horizon, ground, colour):
    """Write the gradient sky that a panel's pixel centres see; see scene.sky.

    frame : (3, 3) float64; corner : (2,) float64; zenith, horizon, ground : (3,) float64; colour : (h, w, 3) float32,
    written
    """
    for i in range(colour.shape[0]):
        for j in range(colour.shape[1]):
            dx, dy, dz = direction_of(frame, corner, i, j)
            up = dy / math.sqrt(dx * dx + dy * dy + dz * dz)
            for c in range(3):
                other = zenith[c] if up > 0.0 else ground[c]
                colour[i, j, c] = horizon[c] + (other - horizon[c]) * abs(up)
