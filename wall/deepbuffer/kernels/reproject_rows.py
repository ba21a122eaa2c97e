"""Reproject hits to an image whose rows are seen one after the other: each sample to the moment of its own row.

A sample is projected at the moments of the image's first and last row. Between them it moves straight and evenly, and
its row's moment is where that motion meets the scan:

    t = a + b x + c y,  x = x0 + t (x1 - x0),  y = y0 + t (y1 - y0)
    t = (a + b x0 + c y0) / (1 - b (x1 - x0) - c (y1 - y0))

Bound: a motion with accelerations below s pixels a squared scan leaves that line by at most s / 8 pixels.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from wall.core.data import Float32
from wall.core.jit import inline_kernel, kernel
from wall.deepbuffer.kernels.columns import DEPTH, X, Y, Z
from wall.deepbuffer.kernels.reproject import FAR, NEAREST, ONE, OUTSIDE, ZERO, end_of_run, pixel_of

SLOWEST = np.float32(0.25)  # of the scan past a surface: one that keeps up with it would be seen in all rows


class RowTables(NamedTuple):
    """How an image goes on from its first row's moment to its last row's."""

    last: Float32  # (n + 1, 12) panel_from_object when the last row is seen; the image's own is of its first row
    scan: Float32  # (3,) a, b, c: the moment of image pixel (x, y) is a + b x + c y, 0 of the first row, 1 of the last


@kernel
def reproject_rows(store, count, table, rows, moved, width, height):
    """Bring the screen positions of samples of moved objects up to date, each to its row's moment.

    store : SampleStore, `screen_position` updated; count : int, samples stored
    table : (n + 1, 12) float32, panel_from_object of the first row; rows : RowTables
    moved : (n + 1,) uint8, rows of either table that differ from the time before; width, height : float32, image pixels
    """
    objects = store.object_id
    first = 0
    while first < count:
        object_id, last = objects[first], end_of_run(objects, first, count)
        if moved[object_id] != 0:
            reproject_run(store, first, last, table[object_id], rows.last[object_id], rows.scan, width, height)
        first = last


@inline_kernel
def reproject_run(store, first, last, m, n, scan, width, height):
    """Reproject samples first..last-1, all of one object, by row m of the first row's table and row n of the last's."""
    position, screen = store.position, store.screen_position
    a, b, c = position[X][first:last], position[Y][first:last], position[Z][first:last]
    x, y, depth = screen[X][first:last], screen[Y][first:last], screen[DEPTH][first:last]
    sky = store.object_id[first] == 0
    s0, s1, s2 = scan[0], scan[1], scan[2]
    for k in range(last - first):
        w0 = m[0] * a[k] + m[1] * b[k] + m[2] * c[k] + m[3]
        w1 = n[0] * a[k] + n[1] * b[k] + n[2] * c[k] + n[3]
        i0, i1 = ONE / w0, ONE / w1
        u0, u1 = (
            (m[4] * a[k] + m[5] * b[k] + m[6] * c[k] + m[7]) * i0,
            (n[4] * a[k] + n[5] * b[k] + n[6] * c[k] + n[7]) * i1,
        )
        v0, v1 = (
            (m[8] * a[k] + m[9] * b[k] + m[10] * c[k] + m[11]) * i0,
            (n[8] * a[k] + n[9] * b[k] + n[10] * c[k] + n[11]) * i1,
        )
        t = moment_of(s0, s1, s2, u0, v0, u1, v1)
        u, v, w = u0 + t * (u1 - u0), v0 + t * (v1 - v0), w0 + t * (w1 - w0)
        inside = (w0 > NEAREST) & (w1 > NEAREST) & (u >= ZERO) & (v >= ZERO) & (u < width) & (v < height)
        x[k], y[k], depth[k] = u, v, (FAR if sky else w) if inside else OUTSIDE


@inline_kernel
def moment_of(a, b, c, x0, y0, x1, y1):
    """When a sample's row is seen, 0 to 1, see above."""
    t = (a + b * x0 + c * y0) / max(ONE - b * (x1 - x0) - c * (y1 - y0), SLOWEST)
    return min(max(t, ZERO), ONE)


@inline_kernel
def pixel_in(a, b, c, object_id, table, rows):
    """As reproject.pixel_of: a point's screen position, at the moment of its row unless `rows` is None."""
    u, v, depth = pixel_of(a, b, c, object_id, table)
    if rows is not None:
        u1, v1, depth1 = pixel_of(a, b, c, object_id, rows.last)
        if not (depth > ZERO and depth1 > ZERO):
            return ZERO, ZERO, OUTSIDE
        scan = rows.scan
        t = moment_of(scan[0], scan[1], scan[2], u, v, u1, v1)
        u, v, depth = u + t * (u1 - u), v + t * (v1 - v), depth + t * (depth1 - depth)
    return u, v, depth
