"""Compiled loops that resample images: separable filters, and look-ups through a table of positions."""

from __future__ import annotations

import numpy as np

from wall.core.jit import inline_kernel, kernel

ZERO, ONE = np.float32(0.0), np.float32(1.0)
SUBPIXELS = 4096  # steps a pixel of positions: rounding moves an edge of height 1 by 1/8192 at most
SUBPIXEL = np.float32(1.0 / SUBPIXELS)
NOWHERE = -(1 << 31)  # x of a display pixel that no cell of the mesh covers
FARTHEST = 1e5  # pixels, of positions beside an image: its edge is taken there
EDGE = 1e-9  # of a cell: what lies on the edge of two belongs to one of them at least


@kernel
def filter_rows(planes, top, first, weights, out):
    """Filter along rows. Weights that are 0 keep out what they are for, even NaN.

    planes : (h, w, c) float32; top : int, its row that becomes row 0
    first : (n,) int64, the first pixel of a row that each new one takes; weights : (n, taps) float32
    out : (rows, n, c) float32, written
    """
    for i in range(out.shape[0]):
        for j in range(out.shape[1]):
            for c in range(out.shape[2]):
                total = np.float32(0.0)
                for t in range(weights.shape[1]):
                    if weights[j, t] != np.float32(0.0):
                        total += weights[j, t] * planes[top + i, first[j] + t, c]
                out[i, j, c] = total


@kernel
def filter_columns(rows, first, weights, out):
    """Filter along columns.

    rows : (h, w, c) float32; first : (n,) int64; weights : (n, taps) float32; out : (n, w, c) float32, written
    """
    for i in range(out.shape[0]):
        out[i] = np.float32(0.0)
        for t in range(weights.shape[1]):
            weight = weights[i, t]
            if weight != np.float32(0.0):
                for j in range(out.shape[1]):
                    for c in range(out.shape[2]):
                        out[i, j, c] += weight * rows[first[i] + t, j, c]


@kernel
def look_up_bilinear(planes, positions, squared, out):
    """Interpolate each pixel between the four around its position in the source.

    planes : (h, w, c) float32
    positions : (n, m, 2) int32, x and y in 1/SUBPIXELS pixels from the centre of pixel (0, 0), or NOWHERE
    squared : bool, by squared weights, for variances
    out : (n, m, c) float32, written; untouched at NOWHERE
    """
    last_row, last_column = planes.shape[0] - 1, planes.shape[1] - 1
    for i in range(out.shape[0]):
        for j in range(out.shape[1]):
            if positions[i, j, 0] == NOWHERE:
                continue
            x = min(max(positions[i, j, 0], 0), last_column * SUBPIXELS)
            y = min(max(positions[i, j, 1], 0), last_row * SUBPIXELS)
            x0, y0 = x // SUBPIXELS, y // SUBPIXELS
            x1, y1 = min(x0 + 1, last_column), min(y0 + 1, last_row)
            fx, fy = np.float32(x - x0 * SUBPIXELS) * SUBPIXEL, np.float32(y - y0 * SUBPIXELS) * SUBPIXEL
            w00, w01 = (ONE - fx) * (ONE - fy), fx * (ONE - fy)
            w10, w11 = (ONE - fx) * fy, fx * fy
            if squared:
                w00, w01, w10, w11 = w00 * w00, w01 * w01, w10 * w10, w11 * w11
            for c in range(out.shape[2]):
                total = np.float32(0.0)
                if w00 > ZERO:
                    total += w00 * planes[y0, x0, c]
                if w01 > ZERO:
                    total += w01 * planes[y0, x1, c]
                if w10 > ZERO:
                    total += w10 * planes[y1, x0, c]
                if w11 > ZERO:
                    total += w11 * planes[y1, x1, c]
                out[i, j, c] = total


@kernel
def look_up_colours(colours, table, tetrahedral, out):
    """Colours through a 3D table, linear between its nodes.

    Parameters
    ----------
    colours : (n, 3) float32 in nodes, 0..N-1; outside and NaN are clipped
    table : (N, N, N, 3) float32, indexed blue, green, red
    tetrahedral : bool, between the four nodes of the tetrahedron around the colour instead of all eight of the cube
    out : (n, 3) float32, written

    Source: Kasson, Plouffe and Nin, A tetrahedral interpolation technique for color space conversion, SPIE 1909, 1993.
    """
    last = table.shape[0] - 1
    corner, fraction, order = np.empty(3, np.int64), np.empty(3, np.float32), np.empty(3, np.int64)
    for k in range(colours.shape[0]):
        for c in range(3):
            value = colours[k, c]
            value = min(value, np.float32(last)) if value > ZERO else ZERO
            corner[c] = min(int(value), last - 1)
            fraction[c] = value - np.float32(corner[c])
        if tetrahedral:
            descending(fraction, order)
            at0, at1, at2 = corner[2], corner[1], corner[0]
            weight = ONE - fraction[order[0]]
            for c in range(3):
                out[k, c] = weight * table[at0, at1, at2, c]
            for step in range(3):
                axis = order[step]
                at0, at1, at2 = at0 + (axis == 2), at1 + (axis == 1), at2 + (axis == 0)
                weight = fraction[axis] - (fraction[order[step + 1]] if step < 2 else ZERO)
                for c in range(3):
                    out[k, c] += weight * table[at0, at1, at2, c]
        else:
            for c in range(3):
                out[k, c] = ZERO
            for node in range(8):
                red, green, blue = node & 1, (node >> 1) & 1, node >> 2
                weight = fraction[0] if red else ONE - fraction[0]
                weight *= fraction[1] if green else ONE - fraction[1]
                weight *= fraction[2] if blue else ONE - fraction[2]
                for c in range(3):
                    out[k, c] += weight * table[corner[2] + blue, corner[1] + green, corner[0] + red, c]


@inline_kernel
def descending(values, order):
    """The order of three values, the largest first."""
    a, b, c = (0, 1, 2) if values[0] >= values[1] else (1, 0, 2)
    if values[c] > values[b]:
        b, c = c, b
    if values[b] > values[a]:
        a, b = b, a
    order[0], order[1], order[2] = a, b, c


@kernel
def project_points(points, eye, flat_from_wall, positions):
    """Where an eye sees points through an image.

    Parameters
    ----------
    points : (h, w, 3) float64; eye : (3,) float64, of the same frame
    flat_from_wall : (3, 3) float64, from what is seen, less the eye, to v, x v, y v of image pixels (x, y)
    positions : (h, w, 2) int32, written: see look_up_bilinear; NOWHERE for what is not before the eye
    """
    m = flat_from_wall
    for i in range(positions.shape[0]):
        for j in range(positions.shape[1]):
            x, y, z = points[i, j, 0] - eye[0], points[i, j, 1] - eye[1], points[i, j, 2] - eye[2]
            scale = m[0, 0] * x + m[0, 1] * y + m[0, 2] * z
            if not scale > 0.0:
                positions[i, j, 0], positions[i, j, 1] = NOWHERE, NOWHERE
                continue
            for c in range(2):
                at = (m[c + 1, 0] * x + m[c + 1, 1] * y + m[c + 1, 2] * z) / scale - 0.5
                at = min(max(at, -FARTHEST), FARTHEST)
                positions[i, j, c] = np.int32(np.floor(at * SUBPIXELS + 0.5))


@kernel
def rasterise_mesh(points, positions):
    """Invert a mesh, which gives the display position of image nodes: the image position of each display pixel.

    Parameters
    ----------
    points : (rows, columns, 2) float64, display pixels of the nodes of a regular grid over the image
    positions : (h, w, 2) int32, written: see look_up_bilinear; NOWHERE where no cell of the mesh lies. Of cells that
        overlap, the last counts

    Between its four nodes a cell is bilinear: p = A + u B + v C + u v D. Taking u out of the two equations leaves a
    quadratic in v, solved by the root that does not cancel.
    """
    rows, columns, (height, width) = points.shape[0] - 1, points.shape[1] - 1, positions.shape[:2]
    positions[:] = NOWHERE
    for row in range(rows):
        for column in range(columns):
            ax, ay = points[row, column]
            bx, by = points[row, column + 1, 0] - ax, points[row, column + 1, 1] - ay
            cx, cy = points[row + 1, column, 0] - ax, points[row + 1, column, 1] - ay
            dx, dy = points[row + 1, column + 1, 0] - ax - bx - cx, points[row + 1, column + 1, 1] - ay - by - cy
            right, bottom = ax + max(0.0, bx, cx, bx + cx + dx), ay + max(0.0, by, cy, by + cy + dy)
            left, top = ax + min(0.0, bx, cx, bx + cx + dx), ay + min(0.0, by, cy, by + cy + dy)
            for i in range(max(0, int(top - 0.5)), min(height, int(bottom + 1.5))):
                for j in range(max(0, int(left - 0.5)), min(width, int(right + 1.5))):
                    ex, ey = j + 0.5 - ax, i + 0.5 - ay
                    u, v = inverse_bilinear(ex, ey, bx, by, cx, cy, dx, dy)
                    if -EDGE <= u <= 1.0 + EDGE and -EDGE <= v <= 1.0 + EDGE:
                        x, y = (column + u) / columns * width - 0.5, (row + v) / rows * height - 0.5
                        positions[i, j, 0] = np.int32(np.floor(x * SUBPIXELS + 0.5))
                        positions[i, j, 1] = np.int32(np.floor(y * SUBPIXELS + 0.5))


@inline_kernel
def inverse_bilinear(ex, ey, bx, by, cx, cy, dx, dy):
    """u, v in the cell with u B + v C + u v D = E; 2 where there is none."""
    a, b, c = dx * cy - dy * cx, ex * dy - ey * dx - (cx * by - cy * bx), ex * by - ey * bx
    root = b * b - 4.0 * a * c
    if root < 0.0:
        return 2.0, 2.0
    q = -0.5 * (b + np.sqrt(root) if b >= 0.0 else b - np.sqrt(root))
    for k in range(2):
        above, below = (c, q) if k == 0 else (q, a)
        v = above / below if below != 0.0 else 2.0
        if -EDGE <= v <= 1.0 + EDGE:
            gx, gy = bx + v * dx, by + v * dy
            length = gx * gx + gy * gy
            u = ((ex - v * cx) * gx + (ey - v * cy) * gy) / length if length > 0.0 else 2.0
            if -EDGE <= u <= 1.0 + EDGE:
                return u, v
    return 2.0, 2.0
