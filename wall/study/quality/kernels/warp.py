"""An image with its surfaces, seen from another pose: forward to find where from, then gathered there.

Two passes, as for asynchronous reprojection in object space: every pixel's surface is moved to the new pose and says
there where it came from; each target pixel then reads the source at the mean of these positions, so that colours are
resampled once and with a proper filter. Cf. Yang et al., "Image-based bidirectional scene reprojection" (2011).
"""

from __future__ import annotations

import math

import numpy as np

from wall.core.jit import inline_kernel, kernel
from wall.deepbuffer.kernels.reproject import pixel_of

ZERO, ONE, HALF = np.float32(0.0), np.float32(1.0), np.float32(0.5)
SAME_DEPTH = np.float32(1.05)  # ratio of depths up to which two pixels are one surface
LONE = np.float32(1 / 64)  # weight of what is met where there is nothing opposite: it may as well be before the hole
RIM = 2  # pixels beside an edge that resampling mixes with what is on its other side


@inline_kernel
def catmull_rom(image, u, v):
    """(r, g, b) of a (h, w, >= 3) image at (u, v) pixels: Catmull-Rom, kept within what the four nearest show."""
    height, width = image.shape[0], image.shape[1]
    x, y = u - HALF, v - HALF
    j, i = math.floor(x), math.floor(y)
    s, t = x - np.float32(j), y - np.float32(i)
    r = g = b = ZERO
    low_r = low_g = low_b = np.float32(np.inf)
    high_r = high_g = high_b = ZERO
    for k in range(4):
        down = cubic(t, k)
        row = min(max(i - 1 + k, 0), height - 1)
        for m in range(4):
            weight = down * cubic(s, m)
            p = image[row, min(max(j - 1 + m, 0), width - 1)]
            r += weight * p[0]
            g += weight * p[1]
            b += weight * p[2]
            if (k == 1 or k == 2) and (m == 1 or m == 2):
                low_r, low_g, low_b = min(low_r, p[0]), min(low_g, p[1]), min(low_b, p[2])
                high_r, high_g, high_b = max(high_r, p[0]), max(high_g, p[1]), max(high_b, p[2])
    return min(max(r, low_r), high_r), min(max(g, low_g), high_g), min(max(b, low_b), high_b)


@inline_kernel
def cubic(t, k):
    """Catmull-Rom's weight of point k of 0..3 at t in [0, 1) between points 1 and 2 (Keys 1981, a = -1/2)."""
    if k == 0:
        return HALF * t * (t * (np.float32(2.0) - t) - ONE)
    if k == 1:
        return ONE + HALF * t * t * (np.float32(3.0) * t - np.float32(5.0))
    if k == 2:
        return HALF * t * (ONE + t * (np.float32(4.0) - np.float32(3.0) * t))
    return HALF * t * t * (t - ONE)


@kernel
def move_surfaces(found, table, moved, nearest, fallback):
    """Every pixel's surface under another pose, and the least depth at each pixel there.

    found : (h, w, 5) float32 object-local point, object id, depth; table : (n + 1, 12) float32 panel_from_object
    moved : (h, w, 3) float32 x, y, depth there (OUTSIDE: behind the eye), written
    nearest : (h, w) float32 least depth whose centre falls into the pixel; fallback : the same of all that reach the
    pixel within one pixel, for the gaps where a surface is stretched; both inf where nothing is, written
    """
    height, width = nearest.shape
    nearest[:] = np.inf
    fallback[:] = np.inf
    for i in range(height):
        for j in range(width):
            p = found[i, j]
            x, y, z = pixel_of(p[0], p[1], p[2], int(p[3]), table)
            moved[i, j, 0], moved[i, j, 1], moved[i, j, 2] = x, y, z
            if not (z > ZERO and x > -ONE and y > -ONE and x < np.float32(width + 1) and y < np.float32(height + 1)):
                moved[i, j, 2] = -ONE
                continue
            m, k = math.floor(x - HALF), math.floor(y - HALF)
            for row in range(max(k, 0), min(k + 2, height)):
                for column in range(max(m, 0), min(m + 2, width)):
                    fallback[row, column] = min(fallback[row, column], z)
            k, m = math.floor(y), math.floor(x)
            if k >= 0 and m >= 0 and k < height and m < width:
                nearest[k, m] = min(nearest[k, m], z)


@kernel
def sources(moved, nearest, fallback, origin):
    """Where each pixel of the new pose comes from, as a sum over the surfaces that reach it.

    moved, nearest, fallback : see move_surfaces
    origin : (h, w, 3) float32, weighted displacement x, y from the pixel to its source, and weight (tent of one pixel);
    written, weight 0 where nothing came
    """
    height, width = nearest.shape
    origin[:] = ZERO
    for i in range(height):
        for j in range(width):
            x, y, z = moved[i, j, 0], moved[i, j, 1], moved[i, j, 2]
            if z < ZERO:
                continue
            dx, dy = np.float32(j) + HALF - x, np.float32(i) + HALF - y
            m, k = math.floor(x - HALF), math.floor(y - HALF)
            for row in range(max(k, 0), min(k + 2, height)):
                down = ONE - abs(np.float32(row) + HALF - y)
                for column in range(max(m, 0), min(m + 2, width)):
                    nearest_depth = nearest[row, column]
                    if nearest_depth == np.inf:
                        nearest_depth = fallback[row, column]
                    if z > nearest_depth * SAME_DEPTH or nearest_depth > z * SAME_DEPTH:
                        continue
                    weight = down * (ONE - abs(np.float32(column) + HALF - x))
                    origin[row, column, 0] += weight * dx
                    origin[row, column, 1] += weight * dy
                    origin[row, column, 2] += weight


@kernel
def gather(colour, origin, image):
    """Read the source where each pixel comes from.

    colour : (h, w, >= 3) float32 source; origin : see sources; image : (h, w, 4) float32, radiance and 1, or zeros
    where nothing came, written. Returns how many pixels are holes.
    """
    height, width = origin.shape[0], origin.shape[1]
    holes = 0
    for i in range(height):
        for j in range(width):
            weight = origin[i, j, 2]
            if weight <= np.float32(1e-6):
                holes += 1
                image[i, j, :] = ZERO
                continue
            u = np.float32(j) + HALF + origin[i, j, 0] / weight
            v = np.float32(i) + HALF + origin[i, j, 1] / weight
            r, g, b = catmull_rom(colour, u, v)
            image[i, j, 0], image[i, j, 1], image[i, j, 2], image[i, j, 3] = r, g, b, ONE
    return holes


@kernel
def pull(fine, coarse):
    """Half the size: weighted means of 2x2, their weights summed up to 1 (push-pull, Gortler et al. 1996).

    fine : (h, w, 4) float32 colour and weight, colour not multiplied by it; coarse : (ceil(h/2), ceil(w/2), 4), written
    """
    height, width = fine.shape[0], fine.shape[1]
    for i in range(coarse.shape[0]):
        for j in range(coarse.shape[1]):
            r = g = b = weight = ZERO
            for k in range(2 * i, min(2 * i + 2, height)):
                for m in range(2 * j, min(2 * j + 2, width)):
                    part = fine[k, m, 3]
                    r, g, b = r + part * fine[k, m, 0], g + part * fine[k, m, 1], b + part * fine[k, m, 2]
                    weight += part
            scale = ONE / weight if weight > ZERO else ZERO
            coarse[i, j, 0], coarse[i, j, 1], coarse[i, j, 2] = r * scale, g * scale, b * scale
            coarse[i, j, 3] = min(weight, ONE)


@kernel
def push(coarse, fine):
    """Fill what the weights leave open with the coarser level, bilinearly; all weights become 1. Arrays as for pull."""
    height, width = fine.shape[0], fine.shape[1]
    rows, columns = coarse.shape[0], coarse.shape[1]
    near, far = np.float32(0.75), np.float32(0.25)
    for i in range(height):
        k = i // 2
        other = min(max(k + (1 if i % 2 else -1), 0), rows - 1)
        for j in range(width):
            weight = fine[i, j, 3]
            if weight >= ONE:
                continue
            m = j // 2
            beside = min(max(m + (1 if j % 2 else -1), 0), columns - 1)
            for c in range(3):
                mixed = near * (near * coarse[k, m, c] + far * coarse[k, beside, c]) + far * (
                    near * coarse[other, m, c] + far * coarse[other, beside, c]
                )
                fine[i, j, c] = weight * fine[i, j, c] + (ONE - weight) * mixed
            fine[i, j, 3] = ONE


@kernel
def fill_from_behind(image, depth):
    """Fill holes with what is met in eight directions, near ones first; of two opposite ones the one that is further.

    What borders on a hole on its far side goes too: resampling has mixed it with what was before it.

    image : (h, w, 4) float32 colour and weight, 0 in holes, which are filled in place
    depth : (h, w) float32, of what is no hole
    """
    height, width = depth.shape
    for i in range(height):
        for j in range(width):
            for axis in range(4 if image[i, j, 3] <= ZERO else 0):
                down, right = (0, 1) if axis == 0 else (1, axis - 2)
                a, b = first_known(image, i, j, -down, -right)
                c, d = first_known(image, i, j, down, right)
                if a < 0 or c < 0:
                    continue
                if depth[c, d] > depth[a, b] * SAME_DEPTH:
                    open_rim(image, depth, c, d, down, right)
                elif depth[a, b] > depth[c, d] * SAME_DEPTH:
                    open_rim(image, depth, a, b, -down, -right)
    for i in range(height):
        for j in range(width):
            if image[i, j, 3] < ONE:
                image[i, j, :] = ZERO
    for i in range(height):
        for j in range(width):
            total = ZERO
            for axis in range(4 if image[i, j, 3] <= ZERO else 0):
                down, right = (0, 1) if axis == 0 else (1, axis - 2)
                k, m = first_known(image, i, j, -down, -right)
                c, d = first_known(image, i, j, down, right)
                lone = k < 0 or c < 0
                if k < 0 or (c >= 0 and depth[c, d] > depth[k, m]):
                    k, m = c, d
                if k < 0:
                    continue
                weight = (LONE if lone else ONE) / np.float32((k - i) ** 2 + (m - j) ** 2)
                total += weight
                for channel in range(3):
                    image[i, j, channel] += weight * image[k, m, channel]
            if total > ZERO:
                for channel in range(3):
                    image[i, j, channel] /= total


@inline_kernel
def first_known(image, i, j, down, right):
    """Row and column of the first pixel from (i, j) on that is no hole; -1 where the image ends before."""
    while i >= 0 and j >= 0 and i < image.shape[0] and j < image.shape[1]:
        if image[i, j, 3] > ZERO:
            return i, j
        i, j = i + down, j + right
    return -1, -1


@inline_kernel
def open_rim(image, depth, i, j, down, right):
    """Mark RIM pixels of a surface from (i, j) on as no longer known: their weight becomes 1/2."""
    far = depth[i, j]
    for _ in range(RIM):
        if i < 0 or j < 0 or i >= image.shape[0] or j >= image.shape[1] or image[i, j, 3] <= ZERO:
            return
        if depth[i, j] * SAME_DEPTH < far:
            return
        image[i, j, 3] = HALF
        i, j = i + down, j + right
