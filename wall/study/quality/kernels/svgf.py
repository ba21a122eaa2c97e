"""Filter one-sample frames of noisy light in time and over surfaces: SVGF.

After Schied et al., "Spatiotemporal variance-guided filtering" (HPG 2017), in its names. *Light* is radiance over
albedo, so that textures are not blurred. Arrays are of a frame's (rows, columns) rays.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from wall.core.jit import inline_kernel, kernel
from wall.core.kernels.albedo import light_of, unpack_albedo
from wall.deepbuffer.kernels.accumulation import luminance
from wall.deepbuffer.kernels.lights import pack_normal, unpack_normal
from wall.deepbuffer.kernels.reproject import OUTSIDE, pixel_of
from wall.reconstruction.kernels.edge_filter import tap_share

ZERO, ONE = np.float32(0.0), np.float32(1.0)
SAME_DEPTH = np.float32(0.1)  # of the depth: a history pixel that differs by more shows another surface
SAME_FACING = np.float32(0.9)  # cosine of normals: likewise
ENOUGH = np.float32(4.0)  # frames, from which on the variance in time is known; before it is that over 7x7 pixels
PLANE = np.float32(50.0)  # squared sine of the angle between the surface and the way to a neighbour, times this
TINY = np.float32(1e-20)
DARK = np.float32(1e-4)  # luminance: differences below it never stop the filter
GAUSS = (np.float32(0.375), np.float32(0.25), np.float32(0.0625))  # a-trous taps at distance 0, 1, 2
REACH = 3  # pixels, of the spatial variance
POOLS = 3  # levels of 3x3 taps that differences are pooled over
# planes of light, integrated over time: red, green, blue; first and second moment of one frame's luminance; how many
# frames it stands for
RED, GREEN, BLUE, FIRST, SECOND, FRAMES, PLANES = 0, 1, 2, 3, 4, 5, 6


class Surfaces(NamedTuple):
    """What a frame's rays hit."""

    position: np.ndarray  # (rows, columns, 4) float32: point in its object's space, object id
    depth: np.ndarray  # (rows, columns) float32: along the panel's axis
    normal: np.ndarray  # (rows, columns, 3) float32: unit, in the object's space


@kernel
def demodulate(raster, normal, light):
    """Write light and normals of a frame's hits.

    raster : (rows, columns) SAMPLE; normal : see Surfaces; light : (rows, columns, 3) float32
    """
    for i in range(raster.shape[0]):
        for j in range(raster.shape[1]):
            sample = raster[i, j]
            light[i, j, 0], light[i, j, 1], light[i, j, 2] = light_of(sample)
            x, y, z = unpack_normal(pack_normal(sample["normal"][0], sample["normal"][1]))
            normal[i, j, 0], normal[i, j, 1], normal[i, j, 2] = x, y, z


@kernel
def remodulate(light, raster):
    """Write light times albedo into a frame. light : (rows, columns, >= 3) float32; raster : (rows, columns) SAMPLE"""
    for i in range(raster.shape[0]):
        for j in range(raster.shape[1]):
            red, green, blue = unpack_albedo(raster[i, j]["albedo"])
            raster[i, j]["radiance"][0] = light[i, j, 0] * red
            raster[i, j]["radiance"][1] = light[i, j, 1] * green
            raster[i, j]["radiance"][2] = light[i, j, 2] * blue


@kernel
def follow(raster, now, before, history, then, spacing, followed):
    """Write the history of every surface point of the frame: bilinear over pixels that show the same surface.

    Parameters
    ----------
    raster : (rows, columns) SAMPLE; now, before : Surfaces of it, of the frame before
    history : (rows, columns, PLANES) float32, of the frame before
    then : (n + 1, 12) float32, panel_from_object of the frame before
    spacing : (2,) float32, panel pixels between rays
    followed : (rows, columns, PLANES) float32, written; FRAMES is 0 where there is no history

    Returns
    -------
    fresh : int, points without a history
    """
    fresh = 0
    for i in range(raster.shape[0]):
        for j in range(raster.shape[1]):
            followed[i, j, :] = ZERO
            p = now.position[i, j]
            object_id = int(p[3])
            u, v, z = pixel_of(p[0], p[1], p[2], object_id, then)
            if object_id == 0 or z == OUTSIDE:
                continue
            # by as much as the point moved, from the cell's middle: where nothing moves, a cell keeps its history
            x = np.float32(j) + (u - raster[i, j]["xy"][0]) / spacing[0]
            y = np.float32(i) + (v - raster[i, j]["xy"][1]) / spacing[1]
            total = gather_history(now, i, j, before, history, x, y, z, ONE, followed[i, j])
            if total <= np.float32(0.01):
                total = gather_history(now, i, j, before, history, x, y, z, np.float32(2.0), followed[i, j])
            if total <= ZERO:
                fresh += 1
                continue
            for c in range(PLANES):
                followed[i, j, c] /= total
    return fresh


@inline_kernel
def gather_history(now, i, j, before, history, x, y, z, reach, out):
    """Sum up history around cell (x, y), `reach` cells wide by a tent; the weights' sum. Of the same surface only."""
    height, width = now.depth.shape
    if not (x > -reach and y > -reach and x < np.float32(width) + reach and y < np.float32(height) + reach):
        return ZERO
    object_id = now.position[i, j, 3]
    total = ZERO
    out[:] = ZERO
    for k in range(max(math.floor(y - reach) + 1, 0), min(math.floor(y + reach) + 1, height)):
        for m in range(max(math.floor(x - reach) + 1, 0), min(math.floor(x + reach) + 1, width)):
            if before.position[k, m, 3] != object_id or abs(before.depth[k, m] - z) > SAME_DEPTH * z:
                continue
            if facing(now.normal[i, j], before.normal[k, m]) < SAME_FACING or history[k, m, FRAMES] <= ZERO:
                continue
            weight = (reach - abs(np.float32(m) - x)) * (reach - abs(np.float32(k) - y))
            if weight <= ZERO:
                continue
            total += weight
            for c in range(PLANES):
                out[c] += weight * history[k, m, c]
    return total


@inline_kernel
def facing(a, b):
    """Cosine of the angle between two normals."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@kernel
def integrate(light, followed, limit):
    """Add a frame to the history that follows it, in place.

    light : (rows, columns, 3) float32; followed : see follow
    limit : float32, frames that the history may stand for: 1 / alpha - 1
    """
    for i in range(light.shape[0]):
        for j in range(light.shape[1]):
            h = followed[i, j]
            n = min(h[FRAMES], limit)
            alpha = ONE / (n + ONE)
            own = luminance(light[i, j, 0], light[i, j, 1], light[i, j, 2])
            for c in range(3):
                h[c] += alpha * (light[i, j, c] - h[c])
            h[FIRST] += alpha * (own - h[FIRST])
            h[SECOND] += alpha * (own * own - h[SECOND])
            h[FRAMES] = n + ONE


@inline_kernel
def likeness(surfaces, i, j, k, m):
    """Weight by which cell (k, m) shows the same surface as cell (i, j): 0 for other objects; normal and plane."""
    p, q = surfaces.position[i, j], surfaces.position[k, m]
    if p[3] != q[3]:
        return ZERO
    normal = surfaces.normal[i, j]
    turn = max(facing(normal, surfaces.normal[k, m]), ZERO)
    for _ in range(7):  # to the 128th
        turn *= turn
    a, b, c = q[0] - p[0], q[1] - p[1], q[2] - p[2]
    off = normal[0] * a + normal[1] * b + normal[2] * c
    return turn / (ONE + PLANE * off * off / max(a * a + b * b + c * c, TINY))


@kernel
def estimate_variance(surfaces, integrated, variance):
    """Write the variance of the mean luminance that a history is: of one frame's luminance, in time where the history
    is long enough, else over 7x7 pixels; over the frames that it stands for.

    surfaces : Surfaces; integrated : (rows, columns, PLANES) float32
    variance : (rows, columns) float32, written
    """
    height, width = variance.shape
    for i in range(height):
        for j in range(width):
            h = integrated[i, j]
            first, second, n = h[FIRST], h[SECOND], h[FRAMES]
            if surfaces.position[i, j, 3] == ZERO:
                variance[i, j] = ZERO
                continue
            few = ONE
            if n < ENOUGH:
                total = first = second = ZERO
                for k in range(max(i - REACH, 0), min(i + REACH + 1, height)):
                    for m in range(max(j - REACH, 0), min(j + REACH + 1, width)):
                        weight = likeness(surfaces, i, j, k, m)
                        total += weight
                        first += weight * integrated[k, m, FIRST]
                        second += weight * integrated[k, m, SECOND]
                first, second = first / total, second / total
                few = ENOUGH / n
            variance[i, j] = few * max(second - first * first, ZERO) / n


@kernel
def filter_level(surfaces, light, variance, step, sigma, out, out_variance):
    """One a-trous level: 5x5 taps, `step` cells apart, held back by normal, plane and luminance.

    Parameters
    ----------
    surfaces : Surfaces; light : (rows, columns, >= 3) float32; variance : (rows, columns) float32, of its luminance
    step : int; sigma : float32, deviations at which a neighbour's share has fallen to 1 / e
    out : (rows, columns, 3) float32, out_variance : (rows, columns) float32; written
    """
    height, width = variance.shape
    for i in range(height):
        for j in range(width):
            red, green, blue = light[i, j, 0], light[i, j, 1], light[i, j, 2]
            out[i, j, 0], out[i, j, 1], out[i, j, 2], out_variance[i, j] = red, green, blue, variance[i, j]
            if surfaces.position[i, j, 3] == ZERO:
                continue
            own = luminance(red, green, blue)
            scale = ONE / (sigma * math.sqrt(smooth_variance(variance, i, j)) + DARK)
            red = green = blue = total = squares = ZERO
            for a in range(-2, 3):
                k = i + a * step
                if k < 0 or k >= height:
                    continue
                for b in range(-2, 3):
                    m = j + b * step
                    if m < 0 or m >= width:
                        continue
                    weight = GAUSS[abs(a)] * GAUSS[abs(b)]
                    r, g, blu = light[k, m, 0], light[k, m, 1], light[k, m, 2]
                    if a != 0 or b != 0:
                        weight *= likeness(surfaces, i, j, k, m)
                        if weight <= np.float32(1e-6):
                            continue
                        weight *= math.exp(-abs(luminance(r, g, blu) - own) * scale)
                    red, green, blue = red + weight * r, green + weight * g, blue + weight * blu
                    total += weight
                    squares += weight * weight * variance[k, m]
            found = ONE / total
            out[i, j, 0], out[i, j, 1], out[i, j, 2] = red * found, green * found, blue * found
            out_variance[i, j] = squares * found * found


@inline_kernel
def smooth_variance(variance, i, j):
    """3x3 Gaussian mean of the variance around a cell."""
    height, width = variance.shape
    total = weights = ZERO
    for k in range(max(i - 1, 0), min(i + 2, height)):
        for m in range(max(j - 1, 0), min(j + 2, width)):
            weight = tap_share(k - i, m - j)
            weights += weight
            total += weight * variance[k, m]
    return total / weights


@kernel
def judge_history(surfaces, light, followed, doubt, differences, scratch):
    """Shorten the history where the new frame contradicts it beyond noise, as in Schied et al. 2018, without gradients
    of their own: the frame less the history, pooled over about 15x15 cells of the surface, against its standard error.

    Parameters
    ----------
    surfaces : Surfaces; light : (rows, columns, 3) float32, of the new frame; followed : see follow, changed in place
    doubt : (2,) float32, standard errors that are taken for noise, squared; and how many a bias weighs against
    differences, scratch : (rows, columns, 4) float32, written: weight, its square, difference of luminance, its square
    """
    height, width = differences.shape[0], differences.shape[1]
    for i in range(height):
        for j in range(width):
            h = followed[i, j]
            differences[i, j, :] = ZERO
            if h[FRAMES] > ZERO:
                d = luminance(light[i, j, 0], light[i, j, 1], light[i, j, 2]) - luminance(h[0], h[1], h[2])
                differences[i, j, 0], differences[i, j, 1] = ONE, ONE
                differences[i, j, 2], differences[i, j, 3] = d, d * d
    a, b = differences, scratch
    for level in range(POOLS):
        pool(surfaces, a, 1 << level, b)
        a, b = b, a
    for i in range(height):
        for j in range(width):
            d, h = a[i, j], followed[i, j]
            if not d[0] > ZERO or not h[FRAMES] > ZERO:
                continue
            mean = d[2] / d[0]
            spread = max(d[3] / d[0] - mean * mean, ZERO)
            error = spread * d[1] / (d[0] * d[0])  # squared, of the mean
            bias = max(mean * mean - doubt[0] * error, ZERO)
            alpha = bias / (bias + doubt[1] * error + TINY)
            h[FRAMES] = min(h[FRAMES], ONE / max(alpha, np.float32(1e-3)) - ONE)


@inline_kernel
def pool(surfaces, source, step, out):
    """Sum up 3x3 cells `step` apart of the same surface: weights, their squares, weighted values."""
    height, width = source.shape[0], source.shape[1]
    for i in range(height):
        for j in range(width):
            weights = squares = first = second = ZERO
            for k in range(i - step, i + step + 1, step):
                for m in range(j - step, j + step + 1, step):
                    if k < 0 or m < 0 or k >= height or m >= width:
                        continue
                    weight = tap_share(k - i, m - j) * likeness(surfaces, i, j, k, m)
                    weights += weight * source[k, m, 0]
                    squares += weight * weight * source[k, m, 1]
                    first += weight * source[k, m, 2]
                    second += weight * source[k, m, 3]
            out[i, j, 0], out[i, j, 1], out[i, j, 2], out[i, j, 3] = weights, squares, first, second


@kernel
def rest(raster, sums):
    """Add a frame's samples to their panel pixels. raster : SAMPLE; sums : (h, w, 4) float32, radiance and number"""
    for i in range(raster.shape[0]):
        for j in range(raster.shape[1]):
            sample = raster[i, j]
            y = min(int(sample["xy"][1]), sums.shape[0] - 1)
            x = min(int(sample["xy"][0]), sums.shape[1] - 1)
            for c in range(3):
                sums[y, x, c] += sample["radiance"][c]
            sums[y, x, 3] += ONE


@kernel
def settle(sums, trust, shown):
    """Draw the image towards the plain means of samples at rest, by n / (n + trust) after n of them.

    sums : see rest; trust : float32; shown : (h, w, >= 3) float32, changed in place
    """
    for i in range(sums.shape[0]):
        for j in range(sums.shape[1]):
            n = sums[i, j, 3]
            if n > ZERO:
                share = n / (n + trust)
                for c in range(3):
                    shown[i, j, c] += share * (sums[i, j, c] / n - shown[i, j, c])


@kernel
def limit_radiance(raster, ceiling):
    """Scale down what is brighter than a display shows, in place. raster : (rows, columns) SAMPLE; ceiling : float32

    Where a lamp's few samples are spread over the pixels around it, its light would make all of them white.
    """
    for i in range(raster.shape[0]):
        for j in range(raster.shape[1]):
            light = raster[i, j]["radiance"]
            for c in range(3):
                light[c] = min(light[c], ceiling)
