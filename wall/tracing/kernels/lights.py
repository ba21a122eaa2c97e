"""Light on a packet's hits: sky, directional, point and spot lights with shadow rays, emission."""

from __future__ import annotations

import math

import numpy as np

from wall.core.jit import lane_kernel
from wall.scene.sky import SKY_STEPS
from wall.tracing import embree
from wall.tracing.kernels import rows
from wall.tracing.kernels.bsdf import diffuse, start_off_surface
from wall.tracing.kernels.cuts import shorten_rays
from wall.tracing.kernels.environment import add_environment_light, see_environment
from wall.tracing.kernels.rows import SHADOW_PACKET, set_xyz, xyz
from wall.tracing.kernels.terminator import facing, raise_towards
from wall.tracing.kernels.textures import emission_of
from wall.tracing.kernels.trees import any_hits
from wall.tracing.kernels.values import INF, ONE, ZERO

SHADOW_ORIGIN, SHADOW_DIRECTION = SHADOW_PACKET + embree.ORIGIN_X, SHADOW_PACKET + embree.DIRECTION_X
SHADOW_T_FAR = SHADOW_PACKET + embree.T_FAR
DIRECTIONAL, POINT, SPOT = 0, 1, 2  # kinds of lights
MASK_BITS = 32  # of a light visibility mask


@lane_kernel
def see_sky(environment, lights, work):
    """Sets radiance to the environment's where rays leave the scene; without one, to the sky's: ground to horizon to
    zenith, linear in the direction's height."""
    if environment is not None:
        see_environment(environment, work)
    else:
        see_gradient(lights.sky, work)


@lane_kernel
def see_gradient(sky, work):
    """Sets all radiance to that of a sky (3, 3): zenith, horizon, ground."""
    p = work.packet
    zr, zg, zb = sky[0, 0] - sky[1, 0], sky[0, 1] - sky[1, 1], sky[0, 2] - sky[1, 2]
    gr, gg, gb = sky[2, 0] - sky[1, 0], sky[2, 1] - sky[1, 1], sky[2, 2] - sky[1, 2]
    hr, hg, hb = sky[1, 0], sky[1, 1], sky[1, 2]
    for lane in range(16):
        y = p[embree.DIRECTION_Y + lane]
        up, down = max(y, ZERO), max(-y, ZERO)
        set_xyz(p, rows.RADIANCE_R, lane, hr + up * zr + down * gr, hg + up * zg + down * gg, hb + up * zb + down * gb)


@lane_kernel
def add_ambient(environment, lights, work):
    """Sets hits' radiance to light from the whole sky, or environment, unoccluded: albedo * E(normal) / pi."""
    if environment is not None:
        add_environment_light(environment, work)
    else:
        add_gradient_light(lights.sky_irradiance, work)


@lane_kernel
def add_gradient_light(table, work):
    """Sets hits' radiance to a gradient sky's light from `table` (SKY_STEPS + 1, 3), by the normal's height."""
    p = work.packet
    for lane in range(16):
        if p[rows.HIT + lane] != ZERO:
            x = (p[rows.SHADING_NORMAL_Y + lane] + ONE) * np.float32(SKY_STEPS / 2)
            i = np.uint32(min(max(int(x), 0), SKY_STEPS - 1))
            j = i + np.uint32(1)
            f = x - np.float32(i)
            r, g, b = xyz(p, rows.ALBEDO_R, lane)
            p[rows.RADIANCE_R + lane] = r * (table[i, 0] + f * (table[j, 0] - table[i, 0]))
            p[rows.RADIANCE_G + lane] = g * (table[i, 1] + f * (table[j, 1] - table[i, 1]))
            p[rows.RADIANCE_B + lane] = b * (table[i, 2] + f * (table[j, 2] - table[i, 2]))


@lane_kernel
def add_emission(emits, textures, table, work):
    """Adds what hit surfaces emit; emits = None does nothing.

    textures : Materials.emission_textures; table : (k,) MATERIAL
    """
    if emits is not None:
        p = work.packet
        for lane in range(16):
            if p[rows.HIT + lane] != ZERO:
                emission = emission_of(textures, table, lane, work)
                p[rows.RADIANCE_R + lane] += emission[0]
                p[rows.RADIANCE_G + lane] += emission[1]
                p[rows.RADIANCE_B + lane] += emission[2]


@lane_kernel
def add_lights(kind, lights, first, rounded, scene, work):
    """Adds `lights` (n, 6 or more), numbered from `first`; None does nothing. Returns shadow rays.

    kind : DIRECTIONAL, POINT or SPOT; rounded : Scattering.rounded
    """
    rays = 0
    if lights is not None:
        for lane in range(16):
            start_off_surface(work.packet, SHADOW_ORIGIN, lane)
        for k in range(lights.shape[0]):
            aim(kind, lights[k], rounded, work)
            for lane in range(16):
                raise_shadow_ray(rounded, lane, work.packet)
            rays += add_light(lights[k], first + k, scene, work)
    return rays


@lane_kernel
def raise_shadow_ray(rounded, lane, p):
    """Moves the start of a lane's shadow ray to where a smooth surface would be, and keeps where the ray ends.

    rounded : Scattering.rounded; None does nothing
    """
    if rounded is not None:
        ox, oy, oz = xyz(p, SHADOW_ORIGIN, lane)  # still raised towards the light before this one
        dx, dy, dz = xyz(p, SHADOW_DIRECTION, lane)
        rx, ry, rz = raise_towards(dx, dy, dz, lane, p)
        start_off_surface(p, SHADOW_ORIGIN, lane)
        x, y, z = xyz(p, SHADOW_ORIGIN, lane)
        x, y, z = x + rx, y + ry, z + rz
        set_xyz(p, SHADOW_ORIGIN, lane, x, y, z)
        ends = p[SHADOW_T_FAR + lane] < INF
        dx, dy, dz = dx + (ox - x) if ends else dx, dy + (oy - y) if ends else dy, dz + (oz - z) if ends else dz
        set_xyz(p, SHADOW_DIRECTION, lane, dx, dy, dz)


@lane_kernel
def light_count(lights):
    """The number of lights of a kind (n, 6), 0 for None."""
    if lights is None:
        return 0
    return lights.shape[0]


@lane_kernel
def aim(kind, light, rounded, work):
    """Aims shadow rays at a light of a kind that is known when this is compiled."""
    if kind == DIRECTIONAL:
        aim_directional(light, rounded, work)
    elif kind == POINT:
        aim_point(light, rounded, work)
    else:
        aim_spot(light, rounded, work)


@lane_kernel
def aim_directional(light, rounded, work):
    """Aims shadow rays at a directional light; writes LIGHT_WEIGHT, the factor of its irradiance."""
    p = work.packet
    lx, ly, lz = light[0], light[1], light[2]
    for lane in range(16):
        nx, ny, nz = xyz(p, rows.SHADING_NORMAL_X, lane)
        gx, gy, gz = xyz(p, rows.GEOMETRIC_NORMAL_X, lane)
        cosine = nx * lx + ny * ly + nz * lz
        side = gx * lx + gy * ly + gz * lz
        p[rows.LIGHT_WEIGHT + lane] = diffuse(cosine) if facing(rounded, cosine, side, lane, p) > ZERO else ZERO
        set_xyz(p, SHADOW_DIRECTION, lane, lx, ly, lz)
        p[SHADOW_T_FAR + lane] = INF


@lane_kernel
def aim_point(light, rounded, work):
    """Aims shadow rays at a point light (position relative to the eye); writes LIGHT_WEIGHT, the factor of its
    intensity.

    Rays end an offset before the light, so that a light in a surface is not shaded by it. Weights are those of the hit
    itself: the start off the surface would brighten what lies close to a light.
    """
    p = work.packet
    x, y, z = light[0], light[1], light[2]
    reach = abs(x) + abs(y) + abs(z)
    for lane in range(16):
        px, py, pz = xyz(p, rows.POSITION_X, lane)
        nx, ny, nz = xyz(p, rows.SHADING_NORMAL_X, lane)
        gx, gy, gz = xyz(p, rows.GEOMETRIC_NORMAL_X, lane)
        lx, ly, lz = x - px, y - py, z - pz
        square = lx * lx + ly * ly + lz * lz
        scale = ONE / math.sqrt(square)
        cosine = nx * lx + ny * ly + nz * lz
        side = gx * lx + gy * ly + gz * lz
        weight = diffuse(cosine * scale) / square
        p[rows.LIGHT_WEIGHT + lane] = weight if facing(rounded, cosine, side, lane, p) > ZERO else ZERO
        sx, sy, sz = xyz(p, SHADOW_ORIGIN, lane)
        set_xyz(p, SHADOW_DIRECTION, lane, x - sx, y - sy, z - sz)
        p[SHADOW_T_FAR + lane] = end_before(p, reach, scale, lane)


@lane_kernel
def aim_spot(light, rounded, work):
    """Aims shadow rays at a spot light; writes LIGHT_WEIGHT, as aim_point does, 0 outside its cone."""
    aim_point(light, rounded, work)
    p = work.packet
    for lane in range(16):
        px, py, pz = xyz(p, rows.POSITION_X, lane)
        lx, ly, lz = light[0] - px, light[1] - py, light[2] - pz
        scale = ONE / math.sqrt(lx * lx + ly * ly + lz * lz)
        p[rows.LIGHT_WEIGHT + lane] *= spot_share(light, lx * scale, ly * scale, lz * scale)


@lane_kernel
def spot_share(light, x, y, z):
    """The share of a spot's intensity that goes to a place from which it lies in the unit direction (x, y, z)."""
    cosine = -(x * light[6] + y * light[7] + z * light[8])
    share = min(max(light[9] * cosine + light[10], ZERO), ONE)
    return share * share


@lane_kernel
def end_before(p, reach, scale, lane):
    """Where a shadow ray ends, of its way: an offset before a point light.

    reach : |x| + |y| + |z| of the light relative to the eye; scale : one over its distance from the hit
    """
    gap = p[rows.RAY_OFFSET + lane] + p[rows.OFFSET_SLOPE + lane] * reach
    return max(ONE - gap * scale, ZERO)


@lane_kernel
def add_light(light, number, scene, work):
    """Traces the shadow rays that were aimed, and adds the light (6,) to every lane that sees it. Returns rays traced.

    number : int, the light's bit in row LIGHT_VISIBILITY; lights from 32 on have none
    """
    p, bits, valid = work.packet, work.bits, work.shadow_valid
    rays = 0
    for lane in range(16):
        lit = p[rows.LIGHT_WEIGHT + lane] * p[rows.HIT + lane] > ZERO
        valid[lane] = -1 if lit else 0
        rays += 1 if lit else 0
    if rays == 0:
        return 0
    shorten_rays(scene.cuts, SHADOW_PACKET, work)
    any_hits(scene, work)
    red, green, blue = light[3], light[4], light[5]
    bit = np.uint32(1) << np.uint32(number) if number < MASK_BITS else np.uint32(0)
    for lane in range(16):
        seen = p[SHADOW_T_FAR + lane] >= ZERO  # Embree sets it to -inf where something is in the way
        weight = p[rows.LIGHT_WEIGHT + lane] if seen and p[rows.HIT + lane] > ZERO else ZERO
        bits[rows.LIGHT_VISIBILITY + lane] ^= np.uint32(0) if seen or valid[lane] == 0 else bit
        r, g, b = xyz(p, rows.ALBEDO_R, lane)
        p[rows.RADIANCE_R + lane] += r * red * weight
        p[rows.RADIANCE_G + lane] += g * green * weight
        p[rows.RADIANCE_B + lane] += b * blue * weight
    return rays
