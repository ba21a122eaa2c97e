"""Temporal antialiasing and upsampling: one frame's samples into a history that follows every surface.

After Karis, "High-quality temporal supersampling" (SIGGRAPH 2014 course), and Yang, Liu and Salvi, "A survey of
temporal antialiasing techniques" (CGF 2020).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from wall.core.jit import inline_kernel, kernel
from wall.deepbuffer.kernels.reproject import FAR, OUTSIDE, pixel_of, position_of
from wall.study.quality.kernels.warp import catmull_rom

ZERO, ONE, HALF = np.float32(0.0), np.float32(1.0), np.float32(0.5)
NARROW = np.float32(2.0)  # 1 / pixels^2, 1 / (2 sigma^2): Gaussian of a sample's share, sigma 0.5; Karis's is 0.47
SAME_DEPTH = np.float32(0.1)  # of the depth: a history pixel that differs by more shows another surface
PRIOR = np.float32(0.3)  # samples that a pixel's neighbours count for where it has no history
DISTRUST = np.float32(2.0)  # a history that clipping changed by its own size stands for a third of the samples
DARK = np.float32(0.05)  # W sr^-1 m^-2: below it a change by clipping is small whatever its ratio

# sums over the 3x3 samples around a pixel: colour and weight by the narrow and by the wide Gaussian; inverse depth and
# weight of those of its object; colour and number; squares of Y, Co, Cg
NARROW_SUM, WIDE_SUM, DEPTH_SUM, MEAN, SQUARES = 0, 4, 8, 10, 14
AROUND = 17


class Frame(NamedTuple):
    """One frame of (rows, columns) rays."""

    raster: np.ndarray  # (rows, columns) SAMPLE
    position: np.ndarray  # (rows, columns, 4) float32: point in its object's space, object id
    depth: np.ndarray  # (rows, columns) float32: along the panel's axis
    spacing: np.ndarray  # (2,) float32: panel pixels between neighbouring rays


class History(NamedTuple):
    """What earlier frames have accumulated at the panel's pixels."""

    radiance: np.ndarray  # (h, w, 4) float32: linear RGB and the samples that it stands for; 0 where there is none
    surface: np.ndarray  # (h, w, 2) float32: object id, depth along the panel's axis


@kernel
def locate_samples(frame, maps):
    """Write position and depth of a frame's hits. frame : Frame; maps : PointMaps of its event"""
    raster, position, corner = frame.raster, frame.position, maps.corner
    for i in range(raster.shape[0]):
        for j in range(raster.shape[1]):
            sample = raster[i, j]
            object_id = int(sample["object_id"])
            x, y = corner[0] + sample["xy"][0], corner[1] + sample["xy"][1]
            a, b, c = position_of(x, y, sample["depth"], object_id, maps.frame, maps.object_from_eye)
            position[i, j, 0], position[i, j, 1], position[i, j, 2] = a, b, c
            position[i, j, 3] = np.float32(object_id)
            frame.depth[i, j] = pixel_of(a, b, c, object_id, maps.panel_from_object)[2]


@kernel
def accumulate(frame, maps, then, still, history, limit, gamma, shown, found):
    """Blend one frame into the history.

    Parameters
    ----------
    frame : Frame; maps : PointMaps of its event
    then : (n + 1, 12) float32, panel_from_object of the history's event
    still : bool, the history is of the same event: it is kept as it is and grows without limit
    history : History
    limit : float32, samples that a history that moves can stand for: 1 / alpha - 1
    gamma : float32, deviations of the 3x3 samples around that it may differ from their mean
    shown : (h, w, 4) float32, the next history's radiance, written
    found : (h, w, 5) float32, object-local point at the pixel's centre, object id, depth; written

    Returns
    -------
    fresh : int, pixels without a history
    """
    colour, corner = history.radiance, maps.corner
    around = np.empty(AROUND, np.float32)
    fresh = 0
    for i in range(shown.shape[0]):
        y = np.float32(i) + HALF
        for j in range(shown.shape[1]):
            x = np.float32(j) + HALF
            object_id = look_around(frame, x, y, still, around)
            z = around[DEPTH_SUM + 1] / around[DEPTH_SUM] if object_id > 0 else FAR  # 1 / depth is linear over a plane
            a, b, c = point_at(corner[0] + x, corner[1] + y, z, object_id, maps.frame, maps.object_from_eye)
            found[i, j, 0], found[i, j, 1], found[i, j, 2] = a, b, c
            found[i, j, 3], found[i, j, 4] = np.float32(object_id), z
            if still:
                red, green, blue, n = colour[i, j, 0], colour[i, j, 1], colour[i, j, 2], colour[i, j, 3]
            else:
                red, green, blue, n = reproject(a, b, c, object_id, then, history, limit, gamma, around)
            if n <= ZERO:
                fresh += 1
                n, scale = PRIOR, ONE / max(around[WIDE_SUM + 3], np.float32(1e-20))
                red, green, blue = around[WIDE_SUM] * scale, around[WIDE_SUM + 1] * scale, around[WIDE_SUM + 2] * scale
            scale = ONE / (n + around[NARROW_SUM + 3])
            shown[i, j, 0] = (red * n + around[NARROW_SUM]) * scale
            shown[i, j, 1] = (green * n + around[NARROW_SUM + 1]) * scale
            shown[i, j, 2] = (blue * n + around[NARROW_SUM + 2]) * scale
            shown[i, j, 3] = n + around[NARROW_SUM + 3]
    return fresh


@inline_kernel
def look_around(frame, x, y, still, around):
    """Sum up the 3x3 samples around (x, y) into `around` (AROUND,) float32; returns the nearest one's object id.

    Where all is still only samples of the pixel itself count, so that it converges to its own mean.
    """
    raster, spacing = frame.raster, frame.spacing
    rows, columns = raster.shape
    i, j = min(int(y / spacing[1]), rows - 1), min(int(x / spacing[0]), columns - 1)
    top, bottom, left, right = max(i - 1, 0), min(i + 2, rows), max(j - 1, 0), min(j + 2, columns)
    best = np.float32(np.inf)
    object_id = 0
    for k in range(top, bottom):
        for m in range(left, right):
            dx, dy = raster[k, m]["xy"][0] - x, raster[k, m]["xy"][1] - y
            if dx * dx + dy * dy < best:
                best = dx * dx + dy * dy
                object_id = int(frame.position[k, m, 3])
    wide = ONE / (HALF * max(spacing[0], spacing[1]) ** 2)  # sigma: half the spacing
    around[:] = ZERO
    for k in range(top, bottom):
        for m in range(left, right):
            dx, dy = raster[k, m]["xy"][0] - x, raster[k, m]["xy"][1] - y
            square = dx * dx + dy * dy
            light = raster[k, m]["radiance"]
            r, g, b = light[0], light[1], light[2]
            part = math.exp(-square * NARROW)
            if still:
                part = ONE if max(abs(dx), abs(dy)) <= HALF else ZERO
            add_weighted(around, NARROW_SUM, part, r, g, b)
            part = math.exp(-square * wide)
            add_weighted(around, WIDE_SUM, part, r, g, b)
            if int(frame.position[k, m, 3]) == object_id:
                around[DEPTH_SUM] += part / frame.depth[k, m]
                around[DEPTH_SUM + 1] += part
            add_weighted(around, MEAN, ONE, r, g, b)
            luma, co, cg = ycocg(r, g, b)
            around[SQUARES] += luma * luma
            around[SQUARES + 1] += co * co
            around[SQUARES + 2] += cg * cg
    return object_id


@inline_kernel
def add_weighted(around, at, weight, r, g, b):
    """Add a weighted colour and its weight to four sums from `at` on."""
    around[at] += weight * r
    around[at + 1] += weight * g
    around[at + 2] += weight * b
    around[at + 3] += weight


@inline_kernel
def ycocg(r, g, b):
    """YCoCg of a colour (luma, two chroma); linear."""
    two, quarter = np.float32(2.0), np.float32(0.25)
    return (r + two * g + b) * quarter, (r - b) * HALF, (two * g - r - b) * quarter


@inline_kernel
def reproject(a, b, c, object_id, then, history, limit, gamma, around):
    """The history of an object's point: clipped radiance and how many samples it stands for, 0 = none."""
    u, v, z = pixel_of(a, b, c, object_id, then)
    n = min(known(history, u, v, object_id, z), limit) if z != OUTSIDE else ZERO
    if n <= ZERO:
        return ZERO, ZERO, ZERO, ZERO
    red, green, blue = catmull_rom(history.radiance, u, v)
    r, g, b = clip_to_box(red, green, blue, around, gamma)
    change = abs(red - r) + abs(green - g) + abs(blue - b)
    n *= ONE / (ONE + DISTRUST * change / (red + green + blue + DARK))
    return r, g, b, n


@inline_kernel
def clip_to_box(red, green, blue, around, gamma):
    """Pull a colour towards the mean until it is within gamma deviations of it in Y, Co and Cg (Karis 2014)."""
    share = ONE / around[MEAN + 3]
    r, g, b = around[MEAN] * share, around[MEAN + 1] * share, around[MEAN + 2] * share
    middle, away = ycocg(r, g, b), ycocg(red - r, green - g, blue - b)
    furthest = ONE
    for k in range(3):
        deviation = math.sqrt(max(around[SQUARES + k] * share - middle[k] * middle[k], ZERO))
        furthest = max(furthest, abs(away[k]) / (gamma * deviation + np.float32(1e-5)))
    scale = ONE / furthest
    return r + (red - r) * scale, g + (green - g) * scale, b + (blue - b) * scale


@inline_kernel
def point_at(x, y, z, object_id, frame, table):
    """The object-local point (a direction for the sky) at virtual-screen position (x, y) and depth z along the axis."""
    scale = z if object_id > 0 else ONE
    dx = np.float32((frame[0, 0] + x * frame[1, 0] + y * frame[2, 0]) * scale)
    dy = np.float32((frame[0, 1] + x * frame[1, 1] + y * frame[2, 1]) * scale)
    dz = np.float32((frame[0, 2] + x * frame[1, 2] + y * frame[2, 2]) * scale)
    m = table[object_id]
    return (
        m[0] * dx + m[1] * dy + m[2] * dz + m[3],
        m[4] * dx + m[5] * dy + m[6] * dz + m[7],
        m[8] * dx + m[9] * dy + m[10] * dz + m[11],
    )


@inline_kernel
def known(history, u, v, object_id, z):
    """Samples of the history at (u, v) if one of the four pixels around shows the object at about depth z; or 0."""
    surface = history.surface
    height, width = surface.shape[0], surface.shape[1]
    if not (u >= ZERO and v >= ZERO and u < np.float32(width) and v < np.float32(height)):
        return ZERO
    i, j = math.floor(v - HALF), math.floor(u - HALF)
    samples = ZERO
    for k in range(max(i, 0), min(i + 2, height)):
        for m in range(max(j, 0), min(j + 2, width)):
            if int(surface[k, m, 0]) == object_id and abs(surface[k, m, 1] - z) <= SAME_DEPTH * z:
                samples = max(samples, history.radiance[k, m, 3])
    return samples
