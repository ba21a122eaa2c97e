"""What lamps add to the colour of stored samples when lamps or objects move: everything but who is in whose shadow.

A sample remembers its surface colour, its normal and which lights reach it; lamps come in each object's own
frame. The model is the tracer's own (matt surfaces, the sky unoccluded); shadows stay until rays find them moved.
"""

from __future__ import annotations

import math

import numpy as np

from wall.core.jit import inline_kernel, kernel
from wall.deepbuffer.kernels.reproject import invert3

ZERO, ONE = np.float32(0.0), np.float32(1.0)
NORMAL_STEPS = np.float32(127.0)
DARKEST = np.float32(1e-4)  # lighting below it says nothing about the surface's colour
TINY = np.float32(1e-20)  # a lamp in the very place of a sample lights nothing
CHUNK = 256  # samples at a time
NOT_RELIT = np.float32(-1.0)  # in place of the surface colour


@kernel
def lamp_tables(world_from_object, directions, irradiances, positions, intensities, lamps, up):
    """Every lamp in the frame of every object.

    Parameters
    ----------
    world_from_object : (n, 4, 4) float64, rotation, uniform scale and shift, else its rows are left zero
    directions, irradiances : (s, 3) float64; positions, intensities : (p, 3) float64, world
    lamps : (n + 1, s + p, 6) float32, written: direction or position, then what a surface facing it at 1 reflects
    up : (n + 1, 3) float32, written: the world's y axis, unit; zero where the object cannot be relit
    """
    inverse = np.empty((3, 3))
    lamps[:] = 0.0
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
        suns = directions.shape[0]
        for n in range(suns):
            for c in range(3):
                along = m[0, c] * directions[n, 0] + m[1, c] * directions[n, 1] + m[2, c] * directions[n, 2]
                lamps[k + 1, n, c] = along / scale
                lamps[k + 1, n, 3 + c] = irradiances[n, c] / math.pi
        for n in range(positions.shape[0]):
            x, y, z = positions[n, 0] - m[0, 3], positions[n, 1] - m[1, 3], positions[n, 2] - m[2, 3]
            for c in range(3):
                lamps[k + 1, suns + n, c] = inverse[c, 0] * x + inverse[c, 1] * y + inverse[c, 2] * z
                lamps[k + 1, suns + n, 3 + c] = intensities[n, c] / (math.pi * square)


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
def lighting(px, py, pz, surface, lamps, suns, up, irradiance):
    """Red, green and blue light that a matt surface of colour 1 sends out.

    px, py, pz : float32, object-local; surface : int32, see surface_of; lamps, up : one object's, see lamp_tables
    suns : int, rows of `lamps` that are directions; irradiance : (k, 3) float32, of the sky, by the normal's height
    """
    u = np.float32(np.int8(surface & 255)) * (ONE / NORMAL_STEPS)
    v = np.float32(np.int8((surface >> 8) & 255)) * (ONE / NORMAL_STEPS)
    z = ONE - abs(u) - abs(v)
    fold = max(-z, ZERO)
    x = u - (fold if u >= ZERO else -fold)
    y = v - (fold if v >= ZERO else -fold)
    size = ONE / math.sqrt(x * x + y * y + z * z)
    x, y, z = x * size, y * size, z * size
    steps = irradiance.shape[0] - 1
    height = (x * up[0] + y * up[1] + z * up[2] + ONE) * np.float32(0.5) * np.float32(steps)
    i = min(max(int(height), 0), steps - 1)
    f = height - np.float32(i)
    red = irradiance[i, 0] + f * (irradiance[i + 1, 0] - irradiance[i, 0])
    green = irradiance[i, 1] + f * (irradiance[i + 1, 1] - irradiance[i, 1])
    blue = irradiance[i, 2] + f * (irradiance[i + 1, 2] - irradiance[i, 2])
    for n in range(lamps.shape[0]):
        if not (surface >> (16 + n)) & 1:
            continue
        lx, ly, lz = lamps[n, 0], lamps[n, 1], lamps[n, 2]
        weight = ONE
        if n >= suns:
            lx, ly, lz = lx - px, ly - py, lz - pz
            square = max(lx * lx + ly * ly + lz * lz, TINY)
            weight = ONE / (square * math.sqrt(square))
        weight *= max(x * lx + y * ly + z * lz, ZERO)
        red += weight * lamps[n, 3]
        green += weight * lamps[n, 4]
        blue += weight * lamps[n, 5]
    return red, green, blue


@inline_kernel
def surface_of(sample):
    """A sample's normal (2 x 8 bits) and the first 16 bits of its light visibility mask in one int32."""
    u, v = np.int32(sample["normal"][0]) & 255, np.int32(sample["normal"][1]) & 255
    return u | (v << 8) | (np.int32(sample["light_visibility"] & np.uint32(0xFFFF)) << 16)


@inline_kernel
def remember_colour(sample, px, py, pz, lamps, suns, up, irradiance, surface, albedo, k):
    """The surface colour beneath a sample's radiance, in the light of its own moment, where there is any."""
    red, green, blue = lighting(px, py, pz, surface[k], lamps, suns, up, irradiance)
    if min(red, min(green, blue)) > DARKEST:
        albedo[0, k] = sample["radiance"][0] / red
        albedo[1, k] = sample["radiance"][1] / green
        albedo[2, k] = sample["radiance"][2] / blue


@kernel
def relight(place, name, colour, surface, albedo, count, changed, lamps, suns, up, irradiance):
    """Light stored samples of those objects anew for which something changed.

    count : int, samples stored; place : (3, capacity) float32; name : (capacity,) int32
    colour : (capacity, 4) float32, written
    surface : (capacity,) int32, see surface_of; albedo : (3, capacity) float32, NOT_RELIT where it is not known
    changed : (n + 1,) uint8; lamps, suns, up, irradiance : see lamp_tables and lighting
    """
    rows = np.empty(6 * CHUNK, np.float32)
    first = 0
    while first < count:
        thing = name[first]
        last = first + 1
        while last < count and last - first < CHUNK and name[last] == thing:
            last += 1
        if changed[thing] != 0:
            from_sky(surface, first, last, up[thing], irradiance, rows)
            for n in range(lamps.shape[1]):
                add_lamp(place, surface, first, last, lamps[thing, n], n, n < suns, rows)
            colour_anew(albedo, first, last, rows, colour)
        first = last


@inline_kernel
def from_sky(surface, first, last, up, irradiance, rows):
    """Rows of CHUNK: normals (3), and the sky's light (3). As in `lighting`, but without branches: vector code."""
    steps = irradiance.shape[0] - 1
    half = np.float32(0.5) * np.float32(steps)
    ux, uy, uz = up[0], up[1], up[2]
    for k in range(last - first):
        low, high = surface[first + k] & 255, (surface[first + k] >> 8) & 255
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
def add_lamp(place, surface, first, last, lamp, number, sun, rows):
    lx, ly, lz, red, green, blue = lamp[0], lamp[1], lamp[2], lamp[3], lamp[4], lamp[5]
    here = ZERO if sun else ONE  # a direction is the same wherever the sample is
    for k in range(last - first):
        dx = lx - here * place[0, first + k]
        dy = ly - here * place[1, first + k]
        dz = lz - here * place[2, first + k]
        square = max(dx * dx + dy * dy + dz * dz, TINY)
        fall = ONE if sun else ONE / (square * math.sqrt(square))
        facing = max(rows[k] * dx + rows[CHUNK + k] * dy + rows[2 * CHUNK + k] * dz, ZERO)
        seen = np.float32((surface[first + k] >> (16 + number)) & 1)
        weight = seen * facing * fall
        rows[3 * CHUNK + k] += weight * red
        rows[4 * CHUNK + k] += weight * green
        rows[5 * CHUNK + k] += weight * blue


@inline_kernel
def colour_anew(albedo, first, last, rows, colour):
    for k in range(last - first):
        i = first + k
        red, green, blue = albedo[0, i], albedo[1, i], albedo[2, i]
        total = red + green + blue
        red, green, blue = red * rows[3 * CHUNK + k], green * rows[4 * CHUNK + k], blue * rows[5 * CHUNK + k]
        if albedo[0, i] >= ZERO and total > ZERO:
            colour[i, 0], colour[i, 1], colour[i, 2] = red, green, blue
            colour[i, 3] = math.sqrt((red + green + blue) / total)
