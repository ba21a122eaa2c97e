"""The light field of a noisy image: how much light each pixel's surface receives, and what its samples differ by.

*Light* is radiance over albedo: textures are divided out, so that a mean over neighbours does not blur them. A pixel
speaks for the object of its nearest sample alone. The samples are shown in the filtered light of their pixel.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from wall.core.jit import inline_kernel, kernel
from wall.deepbuffer.kernels.accumulation import luminance
from wall.deepbuffer.kernels.columns import BLUE, COUNT, DEVIATIONS, GREEN, NEAREST_OBJECT, RED, X, Y, Z
from wall.deepbuffer.kernels.lights import unpack_normal
from wall.deepbuffer.kernels.pixel_buffer import TILE
from wall.deepbuffer.kernels.reproject_rows import pixel_in

uint32 = np.uint32
ZERO, ONE = np.float32(0.0), np.float32(1.0)
# columns of LightField.sums, weighted, but for SQUARES, of the weights
WEIGHT, SQUARES, LIGHT, LUMINANCE_SQUARES, SUMS = 0, 1, 2, 5, 6
# rows of LightField.pixels
OBJECT, NORMAL_X, NORMAL_Y, NORMAL_Z, POSITION_X, POSITION_Y, POSITION_Z, VARIANCE, BIAS, ROWS = range(10)
# rows of LightField.light and .filtered
L_RED, L_GREEN, L_BLUE, L_COUNT, LIGHTS = 0, 1, 2, 3, 4
# rows of LightField.spread
DEVIATION_SUM, FREEDOM, SPREADS = 0, 1, 2

BIAS_REACH = 2  # pixels around that tell of a filter's bias
SURELY = np.float32(1.3)  # times the variance of a mean: what is beyond it counts as bias
SAME_SURFACE = np.float32(0.9)  # cosine between neighbours' normals, about 26 degrees
# samples of which the mean counts at least half, however well the filter fits, inside a surface and at its edge: there
# the filtered image mixes what lies beside, as wide as a sample is shown
ENOUGH, ENOUGH_AT_EDGES = np.float32(48.0), np.float32(4.0)


class LightField(NamedTuple):
    """The light of (h, w) pixels; float32."""

    sums: np.ndarray  # (h, w, SUMS)
    surface: np.ndarray  # (h, w) uint32, a sample of the surface that the pixel speaks for
    pixels: np.ndarray  # (ROWS, h, w) what surface a pixel shows, the variance of one sample's
    # luminance, and the squared bias of the filtered one
    light: np.ndarray  # (LIGHTS, h, w) mean light and the number of samples that it is worth
    filtered: np.ndarray  # (LIGHTS, h, w) the same, of a pixel and those around that its surface reaches
    scratch: np.ndarray  # (LIGHTS, h, w)
    spread: np.ndarray  # (SPREADS, h, w) squared deviations of samples inside pixels, and their degrees of freedom
    spread_scratch: np.ndarray  # (SPREADS, h, w)


@kernel
def gather_light(store, weight, count, nearest, field):
    """Sum up the light of each pixel's samples that lie on the object of its nearest one.

    store : SampleStore; weight : (capacity,) float32, see weigh; count : int, samples stored
    nearest : (h, w, 4) float32, see PixelHistory; field : LightField, `sums` and `surface` written
    """
    screen, light, sums, surface = store.screen_position, store.light, field.sums, field.surface
    sums[:] = ZERO
    for k in range(count):
        w = weight[k]
        if not w > ZERO:
            continue
        i, j = uint32(screen[Y, k]), uint32(screen[X, k])
        if nearest[i, j, NEAREST_OBJECT] != np.float32(store.object_id[k]):
            continue
        pixel, red, green, blue = sums[i, j], light[k, 0], light[k, 1], light[k, 2]
        own = luminance(red, green, blue)
        pixel[WEIGHT] += w
        pixel[SQUARES] += w * w
        pixel[LIGHT] += w * red
        pixel[LIGHT + 1] += w * green
        pixel[LIGHT + 2] += w * blue
        pixel[LUMINANCE_SQUARES] += w * own * own
        surface[i, j] = k


@kernel
def resolve_light(store, history, field):
    """Write what each pixel knows alone: its surface, its light, and what its samples differ by.

    Samples that a pixel accumulated at rest count all; of those stored, as many are older.

    store : SampleStore; history : PixelHistory
    field : LightField; `sums` and `surface` are read, `pixels`, `light`, `spread` written
    """
    nearest, accumulation, means = history.nearest, history.accumulation, history.light
    for i in range(nearest.shape[0]):
        for j in range(nearest.shape[1]):
            pixel, rested = field.sums[i, j], accumulation[i, j, COUNT]
            w = pixel[WEIGHT]
            found = ONE / w if w > ZERO else ZERO
            field.pixels[OBJECT, i, j] = nearest[i, j, NEAREST_OBJECT] if w > ZERO else -ONE
            if w > ZERO:
                k = field.surface[i, j]
                x, y, z = unpack_normal(store.normal[k])
                field.pixels[NORMAL_X, i, j], field.pixels[NORMAL_Y, i, j], field.pixels[NORMAL_Z, i, j] = x, y, z
                for c in range(3):
                    field.pixels[POSITION_X + c, i, j] = store.position[c, k]
            red, green, blue = pixel[LIGHT] * found, pixel[LIGHT + 1] * found, pixel[LIGHT + 2] * found
            number = w * w / pixel[SQUARES] if w > ZERO else ZERO
            mean = luminance(red, green, blue)
            deviations = max(pixel[LUMINANCE_SQUARES] - w * mean * mean, ZERO)
            freedom = max(w - pixel[SQUARES] * found, ZERO)
            if rested > ZERO and w > ZERO:
                older = max(number - rested, ZERO)
                own = rested / (rested + older)
                red += own * (means[i, j, RED] - red)
                green += own * (means[i, j, GREEN] - green)
                blue += own * (means[i, j, BLUE] - blue)
                number = rested + older
                if rested > ONE:
                    deviations, freedom = means[i, j, DEVIATIONS], rested - ONE
            field.light[L_RED, i, j] = red
            field.light[L_GREEN, i, j] = green
            field.light[L_BLUE, i, j] = blue
            field.light[L_COUNT, i, j] = number
            field.spread[DEVIATION_SUM, i, j] = deviations
            field.spread[FREEDOM, i, j] = freedom


@kernel
def show_light(store, weight, count, since, table, rows, field):
    """Show the samples in the filtered light of their pixel: `radiance` becomes albedo times that.

    A sample whose surface the field does not show keeps the light that it found.

    store : SampleStore; weight : (capacity,) float32, only samples with weight are shown; count : int, samples stored
    since : float32 seconds of the store's clock, only later samples are shown anew
    table : (n + 1, 12) float32, panel_from_object when the light was filtered; rows : RowTables of then, or None
    """
    for k in range(count):
        if not weight[k] > ZERO or store.time[k] < since:
            continue
        found, i, j = find_surface(store, k, table, rows, field.pixels)
        for c in range(3):
            store.radiance[k, c] = store.albedo[c, k] * (field.filtered[c, i, j] if found else store.light[k, c])


@inline_kernel
def find_surface(store, k, table, rows, pixels):
    """Whether the field shows the surface of sample k where that was when the light was filtered, and in which pixel.

    That is its own or one of the eight around.
    """
    object_id = np.int64(store.object_id[k])
    x, y, depth = pixel_in(store.position[X, k], store.position[Y, k], store.position[Z, k], object_id, table, rows)
    if not (depth > ZERO and x >= ZERO and y >= ZERO and x < pixels.shape[2] and y < pixels.shape[1]):
        return False, 0, 0
    i, j, wanted = int(y), int(x), np.float32(object_id)
    if pixels[OBJECT, i, j] == wanted:
        return True, i, j
    for di in range(max(i - 1, 0), min(i + 2, pixels.shape[1])):
        for dj in range(max(j - 1, 0), min(j + 2, pixels.shape[2])):
            if pixels[OBJECT, di, dj] == wanted:
                return True, di, dj
    return False, 0, 0


@kernel
def estimate_bias(history, field):
    """Write the squared bias of the filtered luminance: what it differs by, around a pixel, beyond the means' noise.

    history : PixelHistory; field : LightField
    """
    means, accumulation = history.light, history.accumulation
    pixels, filtered = field.pixels, field.filtered
    height, width = accumulation.shape[0], accumulation.shape[1]
    for i in range(height):
        for j in range(width):
            pixels[BIAS, i, j] = ZERO
            if not accumulation[i, j, COUNT] > ZERO:
                continue
            square, count = ZERO, ZERO
            for y in range(max(i - BIAS_REACH, 0), min(i + BIAS_REACH + 1, height)):
                for x in range(max(j - BIAS_REACH, 0), min(j + BIAS_REACH + 1, width)):
                    n = accumulation[y, x, COUNT]
                    if n > ZERO and pixels[OBJECT, y, x] == pixels[OBJECT, i, j]:
                        own = luminance(means[y, x, RED], means[y, x, GREEN], means[y, x, BLUE])
                        other = luminance(filtered[L_RED, y, x], filtered[L_GREEN, y, x], filtered[L_BLUE, y, x])
                        square += (own - other) ** 2 - SURELY * pixels[VARIANCE, y, x] / n
                        count += ONE
            pixels[BIAS, i, j] = max(square / max(count, ONE), ZERO)


@kernel
def mix_filtered(resolved, history, field, shown):
    """Mix the accumulated means of a noisy image at rest into the filtered one, each by what it is expected to be off.

    resolved : (h, w, 3) float32, filtered; history : PixelHistory, its dirty tiles are redone
    field : LightField, whose light the filtered image shows; shown : (h, w, 3) float32, written
    """
    dirty, accumulation, pixels = history.dirty, history.accumulation, field.pixels
    height, width = resolved.shape[0], resolved.shape[1]
    for row in range(dirty.shape[0]):
        for column in range(dirty.shape[1]):
            if not dirty[row, column]:
                continue
            for i in range(row * TILE, min((row + 1) * TILE, height)):
                for j in range(column * TILE, min((column + 1) * TILE, width)):
                    n, bias = accumulation[i, j, COUNT], pixels[BIAS, i, j]
                    own = ZERO
                    if n > ZERO:
                        enough = ENOUGH_AT_EDGES if at_edge(pixels, i, j) else ENOUGH
                        own = n / (n + min(field.filtered[L_COUNT, i, j], enough))
                        if bias > ZERO:
                            own = max(own, bias / (bias + pixels[VARIANCE, i, j] / n))
                    for c in range(3):
                        shown[i, j, c] = resolved[i, j, c] + own * (accumulation[i, j, c] - resolved[i, j, c])


@inline_kernel
def at_edge(pixels, i, j):
    """Whether one of the eight pixels around a pixel shows another object, or a surface that is turned away."""
    nx, ny, nz = pixels[NORMAL_X, i, j], pixels[NORMAL_Y, i, j], pixels[NORMAL_Z, i, j]
    edge = False
    for y in range(max(i - 1, 0), min(i + 2, pixels.shape[1])):
        for x in range(max(j - 1, 0), min(j + 2, pixels.shape[2])):
            turn = nx * pixels[NORMAL_X, y, x] + ny * pixels[NORMAL_Y, y, x] + nz * pixels[NORMAL_Z, y, x]
            edge |= (pixels[OBJECT, y, x] != pixels[OBJECT, i, j]) | (turn < SAME_SURFACE)
    return edge
