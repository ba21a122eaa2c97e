"""The environment as a light: seen by rays that leave, aimed at by its brightness, and summed up for diffuse surfaces.

A direction is chosen by row and then by texel of the image, by the chances of tracing/environment.py, and evenly in
(u, v) within the texel (M. Pharr et al., Physically Based Rendering, 4th ed., 12.5). Radiance is bilinear between
texels. Where nothing is aimed, as at the image's darker part, rays that leave by themselves bring all of the light.
"""

from __future__ import annotations

import math

import numpy as np

from wall.core.jit import inline_kernel
from wall.scene.kernels.environment import image_position, radiance_at
from wall.tracing import embree
from wall.tracing.kernels import rows
from wall.tracing.kernels.rows import set_xyz, xyz
from wall.tracing.kernels.values import INF, MISS, ONE, ZERO

PI, TWO_PI, HALF = np.float32(math.pi), np.float32(2.0 * math.pi), np.float32(0.5)
PER_AREA = np.float32(0.5 / math.pi**2)  # from density over the image to density over directions, at the horizon


@inline_kernel
def see_environment(environment, work):
    """Sets radiance to what rays see that hit nothing."""
    p, bits, strength = work.packet, work.bits, environment.strength
    for lane in range(16):
        if bits[embree.GEOMETRY + lane] == MISS:
            x, y, z = xyz(p, embree.DIRECTION_X, lane)
            u, v = image_position(x, y, z, environment.middle)
            r, g, b = radiance_at(environment.texels, u, v)
            set_xyz(p, rows.RADIANCE_R, lane, strength * r, strength * g, strength * b)


@inline_kernel
def add_environment_light(environment, work):
    """Sets hits' radiance to albedo times irradiance over pi from a table (n, n, 3), bilinear on an unfolded octahedron
    whose middle is +y."""
    table, strength = environment.irradiance, environment.strength
    p, steps = work.packet, np.float32(table.shape[0] - 1) * HALF
    for lane in range(16):
        if p[rows.HIT + lane] != ZERO:
            nx, ny, nz = xyz(p, rows.SHADING_NORMAL_X, lane)
            size = ONE / (abs(nx) + abs(ny) + abs(nz))
            s, t = nx * size, nz * size
            if ny < ZERO:
                s, t = (ONE - abs(t)) * (ONE if s >= ZERO else -ONE), (ONE - abs(s)) * (ONE if t >= ZERO else -ONE)
            x, y = (s + ONE) * steps, (t + ONE) * steps
            i, j = min(max(int(x), 0), table.shape[0] - 2), min(max(int(y), 0), table.shape[0] - 2)
            fx, fy = x - np.float32(i), y - np.float32(j)
            a, b, c, d = (ONE - fx) * (ONE - fy), fx * (ONE - fy), (ONE - fx) * fy, fx * fy
            for k in range(3):
                light = a * table[j, i, k] + b * table[j, i + 1, k]
                light += c * table[j + 1, i, k] + d * table[j + 1, i + 1, k]
                p[rows.RADIANCE_R + 16 * k + lane] = strength * light * p[rows.ALBEDO_R + 16 * k + lane]


@inline_kernel
def aim_at_environment(environment, pick, share):
    """A unit direction, the radiance from there, RGB, and the direction's density, 1/sr; pick, share : random, 0..1."""
    texels, row_sums = environment.texels, environment.row_sums
    h, w = texels.shape[0], texels.shape[1]
    j = min(np.searchsorted(row_sums, pick, side="right") - 1, h - 1)
    column_sums = environment.column_sums[j]
    i = min(np.searchsorted(column_sums, share, side="right") - 1, w - 1)
    row_chance, chance = row_sums[j + 1] - row_sums[j], column_sums[i + 1] - column_sums[i]
    v = (np.float32(j) + (pick - row_sums[j]) / row_chance) / np.float32(h)
    u = (np.float32(i) + (share - column_sums[i]) / chance) / np.float32(w)
    sine, turn = np.float32(math.sin(v * PI)), (u - environment.middle) * TWO_PI
    way = sine * np.float32(math.sin(turn)), np.float32(math.cos(v * PI)), -sine * np.float32(math.cos(turn))
    density = row_chance * chance * np.float32(h) * np.float32(w) * PER_AREA / sine if sine > ZERO else ZERO
    return way, radiance_at(texels, u, v), density


@inline_kernel
def way_to_environment(environment, lane, work):
    """A direction of the environment by the random numbers LIGHT_U and LIGHT_V, as way_to_emitter gives a point."""
    p, strength = work.packet, environment.strength
    way, radiance, density = aim_at_environment(environment, p[rows.LIGHT_U + lane], p[rows.LIGHT_V + lane])
    return way, (strength * radiance[0], strength * radiance[1], strength * radiance[2]), density, INF


@inline_kernel
def density_of_environment(environment, x, y, z):
    """Density with which aim_at_environment finds the unit direction (x, y, z), 1/sr."""
    row_sums, column_sums = environment.row_sums, environment.column_sums
    h, w = environment.texels.shape[0], environment.texels.shape[1]
    u, v = image_position(x, y, z, environment.middle)
    j, i = min(int(v * np.float32(h)), h - 1), min(int(u * np.float32(w)), w - 1)
    sine = math.sqrt(x * x + z * z)
    chance = (row_sums[j + 1] - row_sums[j]) * (column_sums[j, i + 1] - column_sums[j, i])
    return chance * np.float32(h) * np.float32(w) * PER_AREA / sine if sine > ZERO else ZERO
