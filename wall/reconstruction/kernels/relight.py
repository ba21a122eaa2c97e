"""Light stored samples anew when lights or objects move; see deepbuffer.kernels.lights for the model."""

from __future__ import annotations

import math

import numpy as np

from wall.core.jit import inline_kernel, kernel
from wall.deepbuffer.kernels.columns import SQRT_IRRADIANCE, X, Y, Z
from wall.deepbuffer.kernels.lights import LEAST_SQUARE, LIGHT_RED, unpack_normal
from wall.deepbuffer.kernels.reproject import end_of_run

uint32 = np.uint32  # as indices: no test whether they count from the end
ZERO, ONE = np.float32(0.0), np.float32(1.0)
CHUNK = 256  # samples at a time
NX, NY, NZ, RED, GREEN, BLUE, WEIGHT, ROWS = 0, 1, 2, 3, 4, 5, 6, 7  # rows of a chunk: normal, light, of one light


@kernel
def relight(store, first, last, changed, lights, irradiance):
    """Light the samples first to last - 1 of changed objects anew: `reflected_light`, in loops of vector code.

    store : SampleStore, `radiance` updated where the albedo is known; first, last : int, `first` a multiple of CHUNK
    changed : (n + 1,) uint8, objects; lights : ObjectLights
    irradiance : (k, 3) float32, of the sky by the normal's height
    """
    rows = np.empty((ROWS, CHUNK), np.float32)
    sky = np.ascontiguousarray(irradiance.T)
    while first < last:
        object_id, next_chunk = store.object_id[first], first - first % CHUNK + CHUNK
        end = end_of_run(store.object_id, first, min(last, next_chunk))
        if changed[object_id] != 0:
            unpack_normals(store.normal[first:end], rows)
            light_from_sky(lights.up[object_id], sky, end - first, rows)
            for n in range(lights.rows.shape[1]):
                light = lights.rows[object_id, n]
                if n < lights.directional:
                    light_from_direction(light, end - first, rows)
                else:
                    light_from_point(light, store.position, first, end, rows)
                add_visible(light, store.light_visibility[first:end], uint32(n), rows)
            write_radiance(store, first, end, rows)
        first = end


@inline_kernel
def unpack_normals(normals, rows):
    """Write rows NX to NZ."""
    nx, ny, nz = rows[NX], rows[NY], rows[NZ]
    for k in range(normals.shape[0]):
        nx[k], ny[k], nz[k] = unpack_normal(normals[k])


@inline_kernel
def light_from_sky(up, sky, count, rows):
    """Write rows RED to BLUE. sky : (3, k) float32, by the normal's height"""
    nx, ny, nz, height = rows[NX], rows[NY], rows[NZ], rows[WEIGHT]
    steps = sky.shape[1] - 1
    half, highest = np.float32(0.5) * np.float32(steps), np.float32(steps - 1)
    ux, uy, uz = up[X], up[Y], up[Z]
    for k in range(count):
        height[k] = (nx[k] * ux + ny[k] * uy + nz[k] * uz + ONE) * half
    r, g, b, red, green, blue = sky[0], sky[1], sky[2], rows[RED], rows[GREEN], rows[BLUE]
    for k in range(count):
        i = uint32(np.int32(min(max(height[k], ZERO), highest)))
        j, f = i + uint32(1), height[k] - np.float32(i)
        red[k] = r[i] + f * (r[j] - r[i])
        green[k] = g[i] + f * (g[j] - g[i])
        blue[k] = b[i] + f * (b[j] - b[i])


@inline_kernel
def light_from_direction(light, count, rows):
    """Write row WEIGHT: the cosine."""
    nx, ny, nz, weight = rows[NX], rows[NY], rows[NZ], rows[WEIGHT]
    lx, ly, lz = light[X], light[Y], light[Z]
    for k in range(count):
        weight[k] = max(nx[k] * lx + ny[k] * ly + nz[k] * lz, ZERO)


@inline_kernel
def light_from_point(light, position, first, last, rows):
    """Write row WEIGHT: the cosine over the squared distance."""
    nx, ny, nz, weight = rows[NX], rows[NY], rows[NZ], rows[WEIGHT]
    x, y, z = position[X][first:last], position[Y][first:last], position[Z][first:last]
    lx, ly, lz = light[X], light[Y], light[Z]
    for k in range(last - first):
        dx, dy, dz = lx - x[k], ly - y[k], lz - z[k]
        square = max(dx * dx + dy * dy + dz * dz, LEAST_SQUARE)
        weight[k] = max(nx[k] * dx + ny[k] * dy + nz[k] * dz, ZERO) * (ONE / (square * math.sqrt(square)))


@inline_kernel
def add_visible(light, visibility, number, rows):
    """Add a light of these weights to rows RED to BLUE where it is visible."""
    weight = rows[WEIGHT]
    for k in range(visibility.shape[0]):
        weight[k] *= np.float32((visibility[k] >> number) & uint32(1))
    for c in range(3):
        colour, out = light[LIGHT_RED + c], rows[RED + c]
        for k in range(visibility.shape[0]):
            out[k] += weight[k] * colour


@inline_kernel
def write_radiance(store, first, last, rows):
    """Write albedo times light where the albedo is known, and the square root of irradiance beside."""
    albedo, radiance = store.albedo, store.radiance[first:last]
    a, b, c = albedo[0][first:last], albedo[1][first:last], albedo[2][first:last]
    red, green, blue, root = rows[RED], rows[GREEN], rows[BLUE], rows[WEIGHT]
    for k in range(last - first):
        total = a[k] + b[k] + c[k]
        red[k], green[k], blue[k] = a[k] * red[k], b[k] * green[k], c[k] * blue[k]
        light = math.sqrt(max(red[k] + green[k] + blue[k], ZERO) / max(total, LEAST_SQUARE))
        root[k] = light if (a[k] >= ZERO) & (total > ZERO) else -ONE
    for k in range(last - first):
        if root[k] >= ZERO:
            radiance[k, 0], radiance[k, 1], radiance[k, 2] = red[k], green[k], blue[k]
            radiance[k, SQRT_IRRADIANCE] = root[k]
