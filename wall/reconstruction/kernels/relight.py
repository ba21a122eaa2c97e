"""Light stored samples anew when lights or objects move; see deepbuffer.kernels.lights for the model."""

from __future__ import annotations

import math

import numpy as np

from wall.core.jit import inline_kernel, kernel
from wall.deepbuffer.kernels.columns import SQRT_IRRADIANCE, X, Y, Z
from wall.deepbuffer.kernels.lights import BYTE, LEAST_SQUARE, LIGHT_BLUE, LIGHT_GREEN, LIGHT_RED, NORMAL_STEPS

ZERO, ONE = np.float32(0.0), np.float32(1.0)
CHUNK = 256  # samples at a time


@kernel
def relight(store, count, changed, lights, irradiance):
    """Light the samples of changed objects anew.

    store : SampleStore, `radiance` updated where the albedo is known; count : int, samples stored
    changed : (n + 1,) uint8, objects; lights : ObjectLights
    irradiance : (k, 3) float32, of the sky by the normal's height
    """
    rows = np.empty(6 * CHUNK, np.float32)
    first = 0
    while first < count:
        object_id = store.object_id[first]
        last = first + 1
        while last < count and last - first < CHUNK and store.object_id[last] == object_id:
            last += 1
        if changed[object_id] != 0:
            light_from_sky(store.normal, first, last, lights.up[object_id], irradiance, rows)
            for n in range(lights.rows.shape[1]):
                add_light(store, first, last, lights.rows[object_id, n], n, n < lights.directional, rows)
            write_radiance(store, first, last, rows)
        first = last


@inline_kernel
def light_from_sky(normals, first, last, up, irradiance, rows):
    """Write rows of CHUNK: normals (3), and the sky's light (3). `reflected_light` without branches."""
    steps = irradiance.shape[0] - 1
    half = np.float32(0.5) * np.float32(steps)
    ux, uy, uz = up[X], up[Y], up[Z]
    for k in range(last - first):
        normal = np.int32(normals[first + k])
        low, high = normal & BYTE, (normal >> 8) & BYTE
        u = np.float32(low - ((low >> 7) << 8)) * (ONE / NORMAL_STEPS)
        v = np.float32(high - ((high >> 7) << 8)) * (ONE / NORMAL_STEPS)
        z = ONE - abs(u) - abs(v)
        fold = max(-z, ZERO)
        x = u - (fold if u >= ZERO else -fold)
        y = v - (fold if v >= ZERO else -fold)
        size = ONE / math.sqrt(x * x + y * y + z * z)
        rows[k], rows[CHUNK + k], rows[2 * CHUNK + k] = x * size, y * size, z * size
    for k in range(last - first):
        height = (rows[k] * ux + rows[CHUNK + k] * uy + rows[2 * CHUNK + k] * uz + ONE) * half
        i = min(max(int(height), 0), steps - 1)
        f = height - np.float32(i)
        rows[3 * CHUNK + k] = irradiance[i, 0] + f * (irradiance[i + 1, 0] - irradiance[i, 0])
        rows[4 * CHUNK + k] = irradiance[i, 1] + f * (irradiance[i + 1, 1] - irradiance[i, 1])
        rows[5 * CHUNK + k] = irradiance[i, 2] + f * (irradiance[i + 1, 2] - irradiance[i, 2])


@inline_kernel
def add_light(store, first, last, light, number, directional, rows):
    """Add one light to the rows of a chunk, where it is visible."""
    lx, ly, lz, red, green, blue = light[X], light[Y], light[Z], light[LIGHT_RED], light[LIGHT_GREEN], light[LIGHT_BLUE]
    here = ZERO if directional else ONE  # a direction is the same wherever the sample is
    position, visibility = store.position, store.light_visibility
    for k in range(last - first):
        dx = lx - here * position[X, first + k]
        dy = ly - here * position[Y, first + k]
        dz = lz - here * position[Z, first + k]
        square = max(dx * dx + dy * dy + dz * dz, LEAST_SQUARE)
        fall = ONE if directional else ONE / (square * math.sqrt(square))
        dot = max(rows[k] * dx + rows[CHUNK + k] * dy + rows[2 * CHUNK + k] * dz, ZERO)
        seen = np.float32((visibility[first + k] >> np.uint32(number)) & np.uint32(1))
        weight = seen * dot * fall
        rows[3 * CHUNK + k] += weight * red
        rows[4 * CHUNK + k] += weight * green
        rows[5 * CHUNK + k] += weight * blue


@inline_kernel
def write_radiance(store, first, last, rows):
    """Write albedo times light where the albedo is known, and the square root of irradiance beside."""
    albedo, radiance = store.albedo, store.radiance
    for k in range(last - first):
        i = first + k
        red, green, blue = albedo[0, i], albedo[1, i], albedo[2, i]
        total = red + green + blue
        red, green, blue = red * rows[3 * CHUNK + k], green * rows[4 * CHUNK + k], blue * rows[5 * CHUNK + k]
        if albedo[0, i] >= ZERO and total > ZERO:
            radiance[i, 0], radiance[i, 1], radiance[i, 2] = red, green, blue
            radiance[i, SQRT_IRRADIANCE] = math.sqrt((red + green + blue) / total)
