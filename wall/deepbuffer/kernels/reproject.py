"""Reproject hits: from the event they were traced under to points of their objects, and to the image of another event.

Everything is relative to the eye: matrices are made in float64 and only then rounded to float32, so a scene far from
the origin reprojects as well as one at it. Row 0 of a matrix table is the sky, whose points are directions.
"""

from __future__ import annotations

import math

import numpy as np

from wall.core.jit import inline_kernel, kernel
from wall.deepbuffer.kernels.columns import DEPTH, X, Y, Z

FAR = np.float32(1e30)  # depth of the sky
NEAREST = np.float32(1e-20)  # depths below it are not before the eye
OUTSIDE = np.float32(-1.0)  # depth of a point that is not in the image
BLOCK = 4096  # samples; ranges of them begin at multiples of it, so that vectors, and roundings, do not hang on ranges
ZERO, ONE = np.float32(0.0), np.float32(1.0)


@kernel
def object_tables(world_from_object, eye, frame, corner, object_from_eye, panel_from_object):
    """Matrices in both directions for every object under one event.

    Parameters
    ----------
    world_from_object : (n, 4, 4) float64
    eye : (3,) float64, world
    frame : (3, 3) float64, rows A, B, C; see geometry.frusta.ray_frame
    corner : (2,) float64, virtual-screen pixels of the image's top left corner
    object_from_eye : (n + 1, 12) float32, written: rows of 3x4, from points relative to the eye (world axes)
    panel_from_object : (n + 1, 12) float32, written: rows w, x w, y w of 3x4; w is the depth along the panel's axis
        in units of the ray frame, x and y are pixels of the image. A matrix of zeros hides an object: w is -1
    """
    inverse = np.empty((3, 3))
    invert3(frame.T, inverse)
    window = np.empty((3, 3))
    for c in range(3):
        window[0, c] = inverse[0, c]
        window[1, c] = inverse[1, c] - corner[0] * inverse[0, c]
        window[2, c] = inverse[2, c] - corner[1] * inverse[0, c]
    part = np.empty((3, 3))
    for row in range(3):
        for c in range(3):
            object_from_eye[0, 4 * row + c] = 1.0 if row == c else 0.0
            panel_from_object[0, 4 * row + c] = window[row, c]
        object_from_eye[0, 4 * row + 3] = panel_from_object[0, 4 * row + 3] = 0.0
    for k in range(world_from_object.shape[0]):
        m = world_from_object[k]
        invert3(m[:3, :3], part)
        tx, ty, tz = m[0, 3] - eye[0], m[1, 3] - eye[1], m[2, 3] - eye[2]
        size = 0.0
        for row in range(3):
            size += abs(m[row, 0]) + abs(m[row, 1]) + abs(m[row, 2])
            a, b, c = part[row, 0], part[row, 1], part[row, 2]
            object_from_eye[k + 1, 4 * row] = a
            object_from_eye[k + 1, 4 * row + 1] = b
            object_from_eye[k + 1, 4 * row + 2] = c
            object_from_eye[k + 1, 4 * row + 3] = -(a * tx + b * ty + c * tz)
            a, b, c = window[row, 0], window[row, 1], window[row, 2]
            for column in range(3):
                panel_from_object[k + 1, 4 * row + column] = a * m[0, column] + b * m[1, column] + c * m[2, column]
            panel_from_object[k + 1, 4 * row + 3] = a * tx + b * ty + c * tz
        if size == 0.0:  # hidden: behind the eye from everywhere
            panel_from_object[k + 1, :] = 0.0
            panel_from_object[k + 1, 3] = -1.0


@inline_kernel
def invert3(m, out):
    """Inverse of a 3x3 matrix by cofactors; zeros if it has none."""
    c0 = m[1, 1] * m[2, 2] - m[1, 2] * m[2, 1]
    c1 = m[1, 2] * m[2, 0] - m[1, 0] * m[2, 2]
    c2 = m[1, 0] * m[2, 1] - m[1, 1] * m[2, 0]
    determinant = m[0, 0] * c0 + m[0, 1] * c1 + m[0, 2] * c2
    scale = 1.0 / determinant if determinant != 0.0 else 0.0
    out[0, 0], out[1, 0], out[2, 0] = c0 * scale, c1 * scale, c2 * scale
    out[0, 1] = (m[0, 2] * m[2, 1] - m[0, 1] * m[2, 2]) * scale
    out[1, 1] = (m[0, 0] * m[2, 2] - m[0, 2] * m[2, 0]) * scale
    out[2, 1] = (m[0, 1] * m[2, 0] - m[0, 0] * m[2, 1]) * scale
    out[0, 2] = (m[0, 1] * m[1, 2] - m[0, 2] * m[1, 1]) * scale
    out[1, 2] = (m[0, 2] * m[1, 0] - m[0, 0] * m[1, 2]) * scale
    out[2, 2] = (m[0, 0] * m[1, 1] - m[0, 1] * m[1, 0]) * scale


@inline_kernel
def position_of(x, y, depth, object_id, frame, table):
    """The object-local point (a direction for the sky) of a hit at virtual-screen position (x, y)."""
    dx = frame[0, 0] + x * frame[1, 0] + y * frame[2, 0]
    dy = frame[0, 1] + x * frame[1, 1] + y * frame[2, 1]
    dz = frame[0, 2] + x * frame[1, 2] + y * frame[2, 2]
    scale = 1.0 / math.sqrt(dx * dx + dy * dy + dz * dz)
    if object_id > 0:
        scale *= depth
    px, py, pz = np.float32(dx * scale), np.float32(dy * scale), np.float32(dz * scale)
    m = table[object_id]
    return (
        m[0] * px + m[1] * py + m[2] * pz + m[3],
        m[4] * px + m[5] * py + m[6] * pz + m[7],
        m[8] * px + m[9] * py + m[10] * pz + m[11],
    )


@inline_kernel
def pixel_of(a, b, c, object_id, table):
    """The screen position of a point of an object: x, y in image pixels, and its depth; OUTSIDE = behind the eye."""
    m = table[object_id]
    w = m[0] * a + m[1] * b + m[2] * c + m[3]
    if not w > NEAREST:
        return np.float32(0.0), np.float32(0.0), OUTSIDE
    inverse = np.float32(1.0) / w
    x = (m[4] * a + m[5] * b + m[6] * c + m[7]) * inverse
    y = (m[8] * a + m[9] * b + m[10] * c + m[11]) * inverse
    return x, y, FAR if object_id == 0 else w


@kernel
def reproject(store, first, last, table, moved, width, height):
    """Bring the screen positions of the samples first to last - 1 up to date where their objects moved.

    store : SampleStore, `screen_position` updated; first, last : int, `first` a multiple of BLOCK
    table : (n + 1, 12) float32, panel_from_object; moved : (n + 1,) uint8, rows that differ from the time before
    width, height : float32, image pixels
    """
    objects = store.object_id
    while first < last:
        object_id, end = objects[first], end_of_run(objects, first, min(last, first - first % BLOCK + BLOCK))
        if moved[object_id] != 0:
            reproject_run(store, first, end, table[object_id], width, height)
        first = end


@inline_kernel
def end_of_run(objects, first, count):
    """The first sample behind `first`, or `count`, that is of another object than it. objects : (capacity,)"""
    last = first + 1
    while last < count and objects[last] == objects[first]:
        last += 1
    return last


@inline_kernel
def reproject_run(store, first, last, m, width, height):
    """Reproject samples first..last-1, all of one object, by row m of the table: nothing but vector code."""
    position, screen = store.position, store.screen_position
    a, b, c = position[X][first:last], position[Y][first:last], position[Z][first:last]
    x, y, depth = screen[X][first:last], screen[Y][first:last], screen[DEPTH][first:last]
    sky = store.object_id[first] == 0
    wa, wb, wc, wd = m[0], m[1], m[2], m[3]  # in registers
    xa, xb, xc, xd = m[4], m[5], m[6], m[7]
    ya, yb, yc, yd = m[8], m[9], m[10], m[11]
    for k in range(last - first):
        w = wa * a[k] + wb * b[k] + wc * c[k] + wd
        inverse = ONE / w
        u = (xa * a[k] + xb * b[k] + xc * c[k] + xd) * inverse
        v = (ya * a[k] + yb * b[k] + yc * c[k] + yd) * inverse
        inside = (w > NEAREST) & (u >= ZERO) & (v >= ZERO) & (u < width) & (v < height)
        x[k], y[k], depth[k] = u, v, (FAR if sky else w) if inside else OUTSIDE
