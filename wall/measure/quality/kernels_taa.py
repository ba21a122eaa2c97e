"""Temporal antialiasing and upsampling: one frame's samples into a history that follows every surface.

After Karis, "High-quality temporal supersampling" (SIGGRAPH 2014 course), and Yang, Liu and Salvi, "A survey of temporal
antialiasing techniques" (CGF 2020).
"""

from __future__ import annotations

import math

import numpy as np

from wall.deepbuffer.kernels_reproject import FAR, OUTSIDE, pixel_of, place_of
from wall.jit import inline_kernel, kernel
from wall.measure.quality.kernels_warp import catmull_rom

ZERO, ONE, HALF = np.float32(0.0), np.float32(1.0), np.float32(0.5)
NARROW = np.float32(1.0 / (2.0 * 0.4 * 0.4))  # Gaussian of a sample's share of a pixel, sigma 0.4 pixels: Karis's width
SAME_DEPTH = np.float32(0.1)  # of the depth: a history pixel further off shows another surface
PRIOR = np.float32(0.3)  # samples that a pixel's neighbours count for where it has no history


@kernel
def place_samples(raster, frame, corner, object_from_eye, table, place, depth):
    """A frame's hits as points of their objects, and their depth along the panel's axis.

    raster : (rows, columns) SAMPLE; frame, corner, object_from_eye, table : of its event, see object_tables
    place : (rows, columns, 4) float32 object-local point and id, depth : (rows, columns) float32; written
    """
    for i in range(raster.shape[0]):
        for j in range(raster.shape[1]):
            sample = raster[i, j]
            name = int(sample["object"])
            x, y = corner[0] + sample["xy"][0], corner[1] + sample["xy"][1]
            a, b, c = place_of(x, y, sample["depth"], name, frame, object_from_eye)
            place[i, j, 0], place[i, j, 1], place[i, j, 2], place[i, j, 3] = a, b, c, np.float32(name)
            depth[i, j] = pixel_of(a, b, c, name, table)[2]


@inline_kernel
def clip_to_box(r, g, b, mean, deviation, gamma):
    """Pull a colour towards the mean until it is within gamma deviations of it in Y, Co and Cg (Karis 2014)."""
    y, o, p = r - mean[0], g - mean[1], b - mean[2]
    furthest = ONE
    luma = (y + np.float32(2.0) * o + p) * np.float32(0.25)
    orange = (y - p) * HALF
    green = (np.float32(2.0) * o - y - p) * np.float32(0.25)
    small = np.float32(1e-5)
    furthest = max(furthest, abs(luma) / (gamma * deviation[0] + small))
    furthest = max(furthest, abs(orange) / (gamma * deviation[1] + small))
    furthest = max(furthest, abs(green) / (gamma * deviation[2] + small))
    scale = ONE / furthest
    return mean[0] + y * scale, mean[1] + o * scale, mean[2] + p * scale


@kernel
def accumulate(
    raster,
    place,
    depth,
    spacing,
    frame,
    corner,
    object_from_eye,
    then,
    still,
    colour,
    about,
    limit,
    gamma,
    shown,
    found,
):
    """Mix one frame into the history, each at the panel's pixels.

    Parameters
    ----------
    raster, place, depth : the frame, see place_samples
    spacing : (2,) float32, panel pixels between neighbouring rays
    frame, corner, object_from_eye : of the frame's event
    then : (n + 1, 12) float32, panel_from_object of the history's event
    still : bool, the history is of the same event: it is kept as it is and grows without limit
    colour : (h, w, 4) float32, the history: radiance and the samples it stands for; 0 where there is none
    about : (h, w, 2) float32, the history's object id and depth along the panel's axis
    limit : float32, samples that a history that moves can stand for: 1 / alpha - 1
    gamma : float32, deviations of the 3x3 samples around that it may differ from their mean
    shown : (h, w, 4) float32, the next history, written
    found : (h, w, 5) float32, object-local point at the pixel's centre, object id, depth; written

    Returns
    -------
    fresh : int, pixels without a history
    """
    height, width = shown.shape[0], shown.shape[1]
    rows, columns = raster.shape
    wide = ONE / (HALF * max(spacing[0], spacing[1]) ** 2)  # sigma: half the spacing
    mean, deviation, sums = np.empty(3, np.float32), np.empty(3, np.float32), np.empty(6, np.float32)
    fresh = 0
    for i in range(height):
        y = np.float32(i) + HALF
        middle_row = min(int(y / spacing[1]), rows - 1)
        top, bottom = max(middle_row - 1, 0), min(middle_row + 2, rows)
        for j in range(width):
            x = np.float32(j) + HALF
            middle = min(int(x / spacing[0]), columns - 1)
            left, right = max(middle - 1, 0), min(middle + 2, columns)
            # the nearest sample says which surface this is, the foremost which way the pixel moves
            best, near = np.float32(np.inf), np.float32(np.inf)
            own_i = own_j = front_i = front_j = 0
            for k in range(top, bottom):
                for m in range(left, right):
                    dx, dy = raster[k, m]["xy"][0] - x, raster[k, m]["xy"][1] - y
                    square = dx * dx + dy * dy
                    if square < best:
                        best, own_i, own_j = square, k, m
                    if depth[k, m] < near:
                        near, front_i, front_j = depth[k, m], k, m
            name = int(place[own_i, own_j, 3])
            sums[:] = ZERO
            mean[:] = ZERO
            r = g = b = weight = wr = wg = wb = wide_weight = slope = slope_weight = ZERO
            count = np.float32((bottom - top) * (right - left))
            for k in range(top, bottom):
                for m in range(left, right):
                    dx, dy = raster[k, m]["xy"][0] - x, raster[k, m]["xy"][1] - y
                    square = dx * dx + dy * dy
                    red, green, blue = (
                        raster[k, m]["radiance"][0],
                        raster[k, m]["radiance"][1],
                        raster[k, m]["radiance"][2],
                    )
                    part = math.exp(-square * NARROW)
                    r, g, b, weight = r + part * red, g + part * green, b + part * blue, weight + part
                    part = math.exp(-square * wide)
                    wr, wg, wb, wide_weight = wr + part * red, wg + part * green, wb + part * blue, wide_weight + part
                    if int(place[k, m, 3]) == name:
                        slope += part / depth[k, m]
                        slope_weight += part
                    mean[0] += red
                    mean[1] += green
                    mean[2] += blue
                    luma = (red + np.float32(2.0) * green + blue) * np.float32(0.25)
                    orange, leaf = (red - blue) * HALF, (np.float32(2.0) * green - red - blue) * np.float32(0.25)
                    sums[0] += luma
                    sums[1] += orange
                    sums[2] += leaf
                    sums[3] += luma * luma
                    sums[4] += orange * orange
                    sums[5] += leaf * leaf
            z = slope_weight / slope if name > 0 else FAR  # 1 / depth is linear over a plane
            a, c, e = point_at(corner[0] + x, corner[1] + y, z, name, frame, object_from_eye)
            found[i, j, 0], found[i, j, 1], found[i, j, 2] = a, c, e
            found[i, j, 3], found[i, j, 4] = np.float32(name), z
            hr = hg = hb = n = ZERO
            if still:
                hr, hg, hb, n = colour[i, j, 0], colour[i, j, 1], colour[i, j, 2], colour[i, j, 3]
            else:
                own = pixel_of(a, c, e, name, then)
                front = place[front_i, front_j]
                u, v, w = pixel_of(front[0], front[1], front[2], int(front[3]), then)
                if w != OUTSIDE and own[2] != OUTSIDE:
                    u += x - raster[front_i, front_j]["xy"][0]
                    v += y - raster[front_i, front_j]["xy"][1]
                    n = min(known(about, colour, u, v, name, own[2]), limit)
                if n > ZERO:
                    hr, hg, hb = catmull_rom(colour, u, v)
                    for k in range(3):
                        mean[k] /= count
                        deviation[k] = math.sqrt(max(sums[3 + k] / count - (sums[k] / count) ** 2, ZERO))
                    hr, hg, hb = clip_to_box(hr, hg, hb, mean, deviation, gamma)
            if n <= ZERO:
                fresh += 1
                n = PRIOR
                scale = ONE / max(wide_weight, np.float32(1e-20))
                hr, hg, hb = wr * scale, wg * scale, wb * scale
            total = ONE / (n + weight)
            shown[i, j, 0] = (hr * n + r) * total
            shown[i, j, 1] = (hg * n + g) * total
            shown[i, j, 2] = (hb * n + b) * total
            shown[i, j, 3] = n + weight
    return fresh


@inline_kernel
def point_at(x, y, z, name, frame, table):
    """The object-local point (a direction for the sky) at virtual-screen position (x, y) and depth z along the axis."""
    scale = z if name > 0 else ONE
    dx = np.float32((frame[0, 0] + x * frame[1, 0] + y * frame[2, 0]) * scale)
    dy = np.float32((frame[0, 1] + x * frame[1, 1] + y * frame[2, 1]) * scale)
    dz = np.float32((frame[0, 2] + x * frame[1, 2] + y * frame[2, 2]) * scale)
    m = table[name]
    return (
        m[0] * dx + m[1] * dy + m[2] * dz + m[3],
        m[4] * dx + m[5] * dy + m[6] * dz + m[7],
        m[8] * dx + m[9] * dy + m[10] * dz + m[11],
    )


@inline_kernel
def known(about, colour, u, v, name, z):
    """Samples of the history at (u, v) if one of the four pixels around shows object `name` at about depth z, else 0."""
    height, width = about.shape[0], about.shape[1]
    if not (u >= ZERO and v >= ZERO and u < np.float32(width) and v < np.float32(height)):
        return ZERO
    i, j = int(math.floor(v - HALF)), int(math.floor(u - HALF))
    samples = ZERO
    for k in range(max(i, 0), min(i + 2, height)):
        for m in range(max(j, 0), min(j + 2, width)):
            if int(about[k, m, 0]) == name and abs(about[k, m, 1] - z) <= SAME_DEPTH * z:
                samples = max(samples, colour[k, m, 3])
    return samples
