"""Move a framelet's pixels to another moment: each with its object, to where that is then."""

from __future__ import annotations

import numpy as np

from wall.deepbuffer.kernels_reproject import FAR, pixel_of, place_of
from wall.jit import kernel

INFINITE = np.float32(np.inf)
ZERO = np.float32(0.0)


@kernel
def move_pixels(depth, thing, frame, corner, object_from_eye, panel_from_object, near, source):
    """Which pixel of the old picture is seen at each pixel of the new one.

    Each pixel's centre goes where its object is; what falls on one pixel is decided by depth. A pixel that nothing
    reached takes its nearest neighbour's (of eight) source: cracks of one pixel close.

    Parameters
    ----------
    depth : (h, w) float32, distance from the eye; thing : (h, w) uint32, object ids
    frame, corner, object_from_eye : of the old moment, see object_tables; panel_from_object : of the new one
    near : (h, w) float32, written: depth along the panel's axis of what is seen; inf where nothing is
    source : (h, w) int32, written: index of the old pixel; -1 where nothing is
    """
    height, width = depth.shape
    near[:] = INFINITE
    source[:] = -1
    for i in range(height):
        for j in range(width):
            name = int(thing[i, j])
            if name >= panel_from_object.shape[0] or (name > 0 and not depth[i, j] < FAR):
                continue
            a, b, c = place_of(corner[0] + j + 0.5, corner[1] + i + 0.5, depth[i, j], name, frame, object_from_eye)
            u, v, z = pixel_of(a, b, c, name, panel_from_object)
            if not (z > ZERO and u >= ZERO and v >= ZERO and u < width and v < height):
                continue
            y, x = int(v), int(u)
            if z < near[y, x]:
                near[y, x] = z
                source[y, x] = i * width + j
    for i in range(height):
        for j in range(width):
            if source[i, j] >= 0:
                continue
            best, found = INFINITE, -1
            for di in range(max(i - 1, 0), min(i + 2, height)):
                for dj in range(max(j - 1, 0), min(j + 2, width)):
                    if source[di, dj] >= 0 and near[di, dj] < best:
                        best, found = near[di, dj], source[di, dj]
            if found >= 0:
                near[i, j] = -best  # not a neighbour's source for others
                source[i, j] = -2 - found
    for i in range(height):
        for j in range(width):
            if source[i, j] < -1:
                source[i, j] = -2 - source[i, j]
                near[i, j] = -near[i, j]


@kernel
def gather(source, values, out):
    """out[k] = values[source[k]], pixels whose source is negative stay. values, out : (n, c); source : (n,) int32"""
    for k in range(source.shape[0]):
        if source[k] >= 0:
            for c in range(out.shape[1]):
                out[k, c] = values[source[k], c]


@kernel
def true_depth(near, frame, corner, depth):
    """Distances from the eye of depths along the panel's axis; see move_pixels. frame, corner : of the new moment."""
    for i in range(near.shape[0]):
        for j in range(near.shape[1]):
            if not near[i, j] < FAR:
                depth[i, j] = INFINITE
                continue
            x, y = corner[0] + j + 0.5, corner[1] + i + 0.5
            dx = frame[0, 0] + x * frame[1, 0] + y * frame[2, 0]
            dy = frame[0, 1] + x * frame[1, 1] + y * frame[2, 1]
            dz = frame[0, 2] + x * frame[1, 2] + y * frame[2, 2]
            depth[i, j] = near[i, j] * np.float32(np.sqrt(dx * dx + dy * dy + dz * dz))
