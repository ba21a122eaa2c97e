"""Light that paths aim at: each surface on a path sends shadow rays to lights of every kind.

Lights are looked at one by one, chosen from many by a tree, or lie in one direction chosen at random.
"""

from __future__ import annotations

import math

import numpy as np

from wall.core.jit import lane_kernel
from wall.tracing.kernels import rows
from wall.tracing.kernels.bsdf import start_off_surface
from wall.tracing.kernels.cuts import is_cut_away, shorten_rays
from wall.tracing.kernels.emitters import choose_emitters, way_to_emitter
from wall.tracing.kernels.environment import way_to_environment
from wall.tracing.kernels.light_tree import choose_light
from wall.tracing.kernels.lights import (
    DIRECTIONAL,
    POINT,
    SHADOW_DIRECTION,
    SHADOW_ORIGIN,
    SHADOW_T_FAR,
    SPOT,
    raise_shadow_ray,
)
from wall.tracing.kernels.random_numbers import random_pair
from wall.tracing.kernels.rows import SHADOW_PACKET, set_xyz, xyz
from wall.tracing.kernels.scatter import leave_out, lit_by
from wall.tracing.kernels.trees import any_hits
from wall.tracing.kernels.values import INF, ONE, SHADOW_RAYS, ZERO
from wall.tracing.kernels.ways import SUN, way_to

POINT_PAIR, SPOT_PAIR = 1 << 14, 1 << 15  # of random numbers at bounce 0, beyond those of all bounces
ENVIRONMENT_PAIR, SUN_PAIR = 1 << 16, 2 << 16
PAIRS_APART = 1 << 16  # from a sun's pairs to the next one's


@lane_kernel
def add_aimed(bounce, lights, scene, surfaces, materials, work):
    """Adds the light of every kind of lights on a packet's hits."""
    table, scattering = materials.rows, materials.scattering
    add_deltas(DIRECTIONAL, lights.directional, scene, table, scattering, work)
    add_deltas(POINT, lights.points, scene, table, scattering, work)
    add_deltas(SPOT, lights.spots, scene, table, scattering, work)
    draw_light_numbers(lights.many_points, POINT_PAIR, bounce, work)
    add_one(POINT, lights.many_points, scene, table, scattering, work)
    draw_light_numbers(lights.many_spots, SPOT_PAIR, bounce, work)
    add_one(SPOT, lights.many_spots, scene, table, scattering, work)
    add_suns(bounce, lights.suns, scene, table, scattering, work)
    draw_light_numbers(lights.environment, ENVIRONMENT_PAIR, bounce, work)
    add_environment(lights.environment, scene, table, scattering, work)
    add_emitters(lights.emitters, scene, surfaces, materials, work)


@lane_kernel
def draw_light_numbers(light, pair, bounce, work):
    """Draws the random numbers of a light that not every scene has, for all lanes; None does nothing.

    pair : int, the light's pair of numbers at bounce 0; those of the next bounces follow
    """
    if light is not None:
        p, bits, number = work.packet, work.bits, np.uint32(pair + bounce)  # outside the loop, which is vectors so
        for lane in range(16):
            u, v = random_pair(bits[rows.KEY + lane], bits[rows.NUMBER + lane], number)
            p[rows.LIGHT_U + lane] = u
            p[rows.LIGHT_V + lane] = v


@lane_kernel
def add_light(lane, r, g, b, p):
    """Adds radiance to what a lane's path gains."""
    p[rows.GAINED_R + lane] += r
    p[rows.GAINED_G + lane] += g
    p[rows.GAINED_B + lane] += b


@lane_kernel
def add_deltas(kind, lights, scene, table, scattering, work):
    """Adds the light of each of `lights` (n, 6 or more), shadow rays only for lanes that face it; None does nothing.

    kind : of ways.way_to; table : (k,) MATERIAL; scattering : Scattering
    """
    if lights is not None:
        for k in range(lights.shape[0]):
            light = lights[k]
            for lane in range(16):
                dx, dy, dz, scale, share, far = way_to(kind, light, lane, work)
                r, g, b, _ = lit_by(dx * scale, dy * scale, dz * scale, lane, table, scattering, work)
                light_rgb = r * light[3] * share, g * light[4] * share, b * light[5] * share
                aim(scattering, share > ZERO, dx, dy, dz, far, light_rgb, lane, work.packet)
            add_unshadowed(scene, work)


@lane_kernel
def add_one(kind, many, scene, table, scattering, work):
    """Adds the light of one of many lights for each lane, chosen with the random number LIGHT_U; None does nothing.

    kind : POINT or SPOT; many : ManyLights; table : (k,) MATERIAL; scattering : Scattering
    """
    if many is not None:
        p = work.packet
        for lane in range(16):
            p[rows.AIMED + lane] = ZERO
            if p[rows.HIT + lane] == ZERO:
                continue
            point, normal = xyz(p, rows.POSITION_X, lane), xyz(p, rows.GEOMETRIC_NORMAL_X, lane)
            row, chance = choose_light(many.tree, p[rows.LIGHT_U + lane], point, normal, p)
            if not chance > ZERO:
                continue
            light = many.rows[row]
            dx, dy, dz, scale, share, far = way_to(kind, light, lane, work)
            if not share > ZERO:
                continue
            r, g, b, _ = lit_by(dx * scale, dy * scale, dz * scale, lane, table, scattering, work)
            share /= chance
            light_rgb = r * light[3] * share, g * light[4] * share, b * light[5] * share
            aim(scattering, True, dx, dy, dz, far, light_rgb, lane, p)
        add_unshadowed(scene, work)


@lane_kernel
def add_suns(bounce, suns, scene, table, scattering, work):
    """Adds the light of one direction of each of `suns` (n, 7), chosen at random; None does nothing."""
    if suns is not None:
        for k in range(suns.shape[0]):
            draw_light_numbers(suns, SUN_PAIR + PAIRS_APART * k, bounce, work)
            add_deltas(SUN, suns[k : k + 1], scene, table, scattering, work)


@lane_kernel
def aim(scattering, lit, dx, dy, dz, far, light, lane, p):
    """Writes a lane's shadow ray, from off its surface to the way (dx, dy, dz) from its hit, and what it would add.

    lit : bool, whether there is a way
    """
    lit = lit & (p[rows.HIT + lane] != ZERO) & (light[0] + light[1] + light[2] > ZERO)
    p[rows.AIMED + lane] = ONE if lit else ZERO
    if leave_out(scattering.interface, lit):
        return
    start_off_surface(p, SHADOW_ORIGIN, lane)
    gx, gy, gz = xyz(p, rows.GEOMETRIC_NORMAL_X, lane)
    offset = p[rows.RAY_OFFSET + lane] if far < INF else ZERO  # the way is from the hit, the ray starts off the surface
    set_xyz(p, SHADOW_DIRECTION, lane, dx - offset * gx, dy - offset * gy, dz - offset * gz)
    p[SHADOW_T_FAR + lane] = far
    raise_shadow_ray(scattering.rounded, lane, p)
    r, g, b = xyz(p, rows.THROUGHPUT_R, lane)
    set_xyz(p, rows.LIGHT_R, lane, r * light[0], g * light[1], b * light[2])


@lane_kernel
def add_environment(environment, scene, table, scattering, work):
    """Adds the light from one direction of an environment, chosen at random; None does nothing."""
    if environment is not None:
        for lane in range(16):
            way = way_to_environment(environment, lane, work)
            aim_chosen(way, table, scattering, lane, work)
        add_unshadowed(scene, work)


@lane_kernel
def add_emitters(emitters, scene, surfaces, materials, work):
    """Adds the light of one point of one emitting triangle, chosen at random; None does nothing."""
    if emitters is not None:
        choose_emitters(emitters, surfaces, materials, work)
        for lane in range(16):
            aim_chosen(way_to_emitter(lane, work), materials.rows, materials.scattering, lane, work)
        drop_cut_away(scene.cuts, work)
        add_unshadowed(scene, work)


@lane_kernel
def aim_chosen(way, table, scattering, lane, work):
    """Aims a lane's shadow ray along a way chosen at random; its light is weighed against a path's finding it alone.

    way : as of way_to_environment or way_to_emitter
    """
    (dx, dy, dz), radiance, density, far = way
    scale = ONE / math.sqrt(dx * dx + dy * dy + dz * dz) if far < INF else ONE
    r, g, b, own = lit_by(dx * scale, dy * scale, dz * scale, lane, table, scattering, work)
    weight = ONE / (density + own)  # of aiming, over its density
    light = weight * r * radiance[0], weight * g * radiance[1], weight * b * radiance[2]
    aim(scattering, density > ZERO, dx, dy, dz, far, light, lane, work.packet)


@lane_kernel
def drop_cut_away(cuts, work):
    """Gives up the shadow rays to places that are cut away: no light is there. None does nothing.

    cuts : Trees.cuts
    """
    if cuts is not None:
        p = work.packet
        for lane in range(16):
            ox, oy, oz = xyz(p, SHADOW_ORIGIN, lane)
            dx, dy, dz = xyz(p, SHADOW_DIRECTION, lane)
            if is_cut_away(cuts, ox + dx, oy + dy, oz + dz):
                p[rows.AIMED + lane] = ZERO


@lane_kernel
def add_unshadowed(scene, work):
    """Traces the shadow rays that were aimed, and adds the light of those that nothing stops."""
    p, valid, aimed = work.packet, work.shadow_valid, 0
    for lane in range(16):
        valid[lane] = -1 if p[rows.AIMED + lane] != ZERO else 0
        aimed += 1 if p[rows.AIMED + lane] != ZERO else 0
    if aimed == 0:
        return
    work.counts[SHADOW_RAYS] += aimed
    shorten_rays(scene.cuts, SHADOW_PACKET, work)
    any_hits(scene, work)
    for lane in range(16):
        seen = (p[rows.AIMED + lane] != ZERO) & (p[SHADOW_T_FAR + lane] >= ZERO)
        r, g, b = xyz(p, rows.LIGHT_R, lane)
        add_light(lane, r if seen else ZERO, g if seen else ZERO, b if seen else ZERO, p)
