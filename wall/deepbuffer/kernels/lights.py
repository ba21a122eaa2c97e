"""Lights in the frames of objects, and what they add to a diffuse surface: everything but shadows, which samples know.

The model is the tracer's own: diffuse surfaces, the sky unoccluded. A shadow stays until rays find it moved.
"""

from __future__ import annotations

import math

import numpy as np

from wall.core.jit import inline_kernel, kernel
from wall.deepbuffer.kernels.columns import X, Y, Z
from wall.deepbuffer.kernels.reproject import invert3

ZERO, ONE = np.float32(0.0), np.float32(1.0)
NORMAL_STEPS = np.float32(127.0)
BYTE = 255  # of a packed normal
DARKEST = np.float32(1e-4)  # reflected light below it says nothing about the albedo
LEAST_SQUARE = np.float32(1e-20)  # squared distance: a light in the very position of a sample lights nothing
LIGHT_RED, LIGHT_GREEN, LIGHT_BLUE = 3, 4, 5  # columns of a light, after its direction or position
NOT_RELIT = np.float32(-1.0)  # albedo of a sample that keeps its radiance when lights change


@kernel
def light_tables(world_from_object, directions, irradiances, positions, intensities, lights, up):
    """Write every light in the frame of every object.

    Parameters
    ----------
    world_from_object : (n, 4, 4) float64, rotation, uniform scale and shift, else its rows are left zero
    directions, irradiances : (s, 3) float64; positions, intensities : (p, 3) float64, world
    lights : (n + 1, s + p, 6) float32, written: direction or position, then what a white surface reflects
        at distance 1 if the light meets it at a right angle
    up : (n + 1, 3) float32, written: the world's y axis, unit; zero where the object cannot be relit
    """
    inverse = np.empty((3, 3))
    lights[:] = 0.0
    up[:] = 0.0
    for k in range(world_from_object.shape[0]):
        m = world_from_object[k]
        square = m[0, 0] ** 2 + m[1, 0] ** 2 + m[2, 0] ** 2
        if not is_similarity(m, square):
            continue
        invert3(m[:3, :3], inverse)
        scale = math.sqrt(square)
        for c in range(3):
            up[k + 1, c] = m[1, c] / scale
        directional = directions.shape[0]
        for n in range(directional):
            for c in range(3):
                along = m[0, c] * directions[n, 0] + m[1, c] * directions[n, 1] + m[2, c] * directions[n, 2]
                lights[k + 1, n, c] = along / scale
                lights[k + 1, n, 3 + c] = irradiances[n, c] / math.pi
        for n in range(positions.shape[0]):
            x, y, z = positions[n, 0] - m[0, 3], positions[n, 1] - m[1, 3], positions[n, 2] - m[2, 3]
            for c in range(3):
                lights[k + 1, directional + n, c] = inverse[c, 0] * x + inverse[c, 1] * y + inverse[c, 2] * z
                lights[k + 1, directional + n, 3 + c] = intensities[n, c] / (math.pi * square)


@inline_kernel
def is_similarity(m, square):
    """Whether a matrix keeps angles (to 1e-4)."""
    off = 0.0
    for a in range(3):
        for b in range(3):
            dot = m[0, a] * m[0, b] + m[1, a] * m[1, b] + m[2, a] * m[2, b]
            off = max(off, abs(dot - (square if a == b else 0.0)))
    return square > 0.0 and off <= 1e-4 * square


@inline_kernel
def reflected_light(px, py, pz, normal, visibility, lights, object_id, irradiance):
    """Red, green and blue light that a diffuse surface of albedo 1 reflects.

    px, py, pz : float32, object space; normal : uint16, see pack_normal; visibility : uint32, light visibility mask
    lights : ObjectLights, the rows of `object_id`; irradiance : (k, 3) float32, of the sky, by the normal's height
    """
    rows, up, directional = lights.rows[object_id], lights.up[object_id], lights.directional
    x, y, z = unpack_normal(normal)
    steps = irradiance.shape[0] - 1
    height = (x * up[X] + y * up[Y] + z * up[Z] + ONE) * np.float32(0.5) * np.float32(steps)
    i = min(max(int(height), 0), steps - 1)
    f = height - np.float32(i)
    red = irradiance[i, 0] + f * (irradiance[i + 1, 0] - irradiance[i, 0])
    green = irradiance[i, 1] + f * (irradiance[i + 1, 1] - irradiance[i, 1])
    blue = irradiance[i, 2] + f * (irradiance[i + 1, 2] - irradiance[i, 2])
    for n in range(rows.shape[0]):
        if not (visibility >> np.uint32(n)) & np.uint32(1):
            continue
        lx, ly, lz = rows[n, X], rows[n, Y], rows[n, Z]
        weight = ONE
        if n >= directional:
            lx, ly, lz = lx - px, ly - py, lz - pz
            square = max(lx * lx + ly * ly + lz * lz, LEAST_SQUARE)
            weight = ONE / (square * math.sqrt(square))
        weight *= max(x * lx + y * ly + z * lz, ZERO)
        red += weight * rows[n, LIGHT_RED]
        green += weight * rows[n, LIGHT_GREEN]
        blue += weight * rows[n, LIGHT_BLUE]
    return red, green, blue


@inline_kernel
def pack_normal(u, v):
    """Two int8 of an octahedral normal as one uint16, u in the low byte."""
    return np.uint16((np.int32(u) & BYTE) | ((np.int32(v) & BYTE) << 8))


@inline_kernel
def unpack_normal(normal):
    """The unit vector of an octahedral uint16, see pack_normal."""
    low, high = np.int32(normal) & BYTE, (np.int32(normal) >> 8) & BYTE
    u = np.float32(low - ((low >> 7) << 8)) * (ONE / NORMAL_STEPS)
    v = np.float32(high - ((high >> 7) << 8)) * (ONE / NORMAL_STEPS)
    z = ONE - abs(u) - abs(v)
    fold = max(-z, ZERO)
    x = u - (fold if u >= ZERO else -fold)
    y = v - (fold if v >= ZERO else -fold)
    size = ONE / math.sqrt(x * x + y * y + z * z)
    return x * size, y * size, z * size


@inline_kernel
def demodulate(sample, lights, diffuse, store, k):
    """Write a sample's albedo: its radiance over the light of its own moment, where there is any, else NOT_RELIT."""
    store.albedo[0, k] = NOT_RELIT
    object_id = int(sample["object_id"])
    if diffuse.objects[object_id] == 0:
        return
    px, py, pz = store.position[X, k], store.position[Y, k], store.position[Z, k]
    red, green, blue = reflected_light(
        px, py, pz, store.normal[k], store.light_visibility[k], lights, object_id, diffuse.sky_irradiance
    )
    if min(red, min(green, blue)) > DARKEST:
        store.albedo[0, k] = sample["radiance"][0] / red
        store.albedo[1, k] = sample["radiance"][1] / green
        store.albedo[2, k] = sample["radiance"][2] / blue
