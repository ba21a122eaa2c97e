"""Move a framelet's pixels to another moment: each with its object, to where that is then."""

from __future__ import annotations

import numpy as np

from wall.core.jit import inline_kernel, kernel
from wall.deepbuffer.kernels.reproject import FAR, pixel_of, position_of

INFINITE = np.float32(np.inf)
ZERO = np.float32(0.0)
MOST = 5  # of eight neighbours


@kernel
def move_pixels(depth, object_ids, frame, corner, object_from_eye, panel_from_object, near, source):
    """Which pixel of the old image is seen at each pixel of the new one.

    Each pixel's centre goes where its object is; what falls on one pixel is decided by depth. Cracks of one pixel
    close, see between: surfaces stay whole until they are seen twice as large.

    Parameters
    ----------
    depth : (h, w) float32, distance from the eye; object_ids : (h, w) uint32
    frame, corner, object_from_eye : of the old moment, see object_tables; panel_from_object : of the new one
    near : (h, w) float32, written: depth along the panel's axis of what is seen; inf where nothing is
    source : (h, w) int32, written: index of the old pixel; -1 where nothing is
    """
    height, width = depth.shape
    near[:] = INFINITE
    source[:] = -1
    for i in range(height):
        for j in range(width):
            object_id = int(object_ids[i, j])
            if object_id >= panel_from_object.shape[0] or (object_id > 0 and not depth[i, j] < FAR):
                continue
            x, y = corner[0] + j + 0.5, corner[1] + i + 0.5
            a, b, c = position_of(x, y, depth[i, j], object_id, frame, object_from_eye)
            u, v, z = pixel_of(a, b, c, object_id, panel_from_object)
            if not (z > ZERO and u >= ZERO and v >= ZERO and u < width and v < height):
                continue
            row, column = int(v), int(u)
            if z < near[row, column]:
                near[row, column] = z
                source[row, column] = i * width + j
    for i in range(height):
        for j in range(width):
            if source[i, j] == -1:
                far, found = between(near, source, i, j)
                if found >= 0:
                    near[i, j] = -far  # not a neighbour's source for others
                    source[i, j] = -2 - found
    for i in range(height):
        for j in range(width):
            if source[i, j] < -1:
                source[i, j] = -2 - source[i, j]
                near[i, j] = -near[i, j]


@inline_kernel
def between(near, source, i, j):
    """What a pixel lies amidst: of opposite neighbours that were both reached the farther, of such pairs the nearest.

    A crack in a surface has that surface on both sides. A gap that opened behind a silhouette has it on one side only,
    and where it is one pixel wide, what is behind belongs there. At the border of the image, where pixels have one
    side only, and amidst five others, it is the farthest neighbour.
    """
    height, width = source.shape
    best, found = INFINITE, -1
    for di, dj in ((0, 1), (1, 0), (1, 1), (1, -1)):
        a, b, c, d = i - di, j - dj, i + di, j + dj
        inside = a >= 0 and 0 <= b < width and c < height and 0 <= d < width
        if inside and source[a, b] >= 0 and source[c, d] >= 0:
            if near[c, d] < near[a, b]:
                c, d = a, b
            if near[c, d] < best:
                best, found = near[c, d], source[c, d]
    if found >= 0:
        return best, found
    best, reached = ZERO, 0
    for a in range(max(i - 1, 0), min(i + 2, height)):
        for b in range(max(j - 1, 0), min(j + 2, width)):
            if source[a, b] >= 0:
                reached += 1
                if near[a, b] > best:
                    best, found = near[a, b], source[a, b]
    border = i == 0 or j == 0 or i == height - 1 or j == width - 1
    return best, found if border or reached >= MOST else -1


@kernel
def fill_unseen(near, source):
    """Give pixels that nothing reached what is farther of what stands beside them in their row: that was hidden there.

    Rows that nothing reached are as the nearest row above that something did, or else below. See move_pixels.
    """
    height, width = source.shape
    for i in range(height):
        j = 0
        while j < width:
            end = j
            while end < width and source[i, end] < 0:
                end += 1
            if end > j and not (j == 0 and end == width):
                taken = end
                if end == width or (j > 0 and near[i, j - 1] >= near[i, end]):
                    taken = j - 1
                for k in range(j, end):
                    near[i, k], source[i, k] = near[i, taken], source[i, taken]
            j = end + 1
    known = 0
    while known < height and source[known, 0] < 0:
        known += 1
    if known == height:
        return
    for i in range(height):
        if source[i, 0] < 0:
            near[i], source[i] = near[known], source[known]
        else:
            known = i


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
