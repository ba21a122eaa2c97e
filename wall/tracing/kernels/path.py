"""Path tracing: light that comes over several surfaces, a batch of paths one bounce at a time.

The rays of a batch lie in flat arrays. Each bounce reads them in full packets of 16, finds what they hit, adds the
light that is seen and that of a light source chosen at random, and writes the rays that go on, close together, for the
next bounce. Light that a ray finds by itself and light that it is aimed at are weighed by how likely each finds the
other (multiple importance sampling; E. Veach, thesis, 1997). From ROULETTE_FROM on dark paths end by chance, without
bias.
"""

from __future__ import annotations

import math

import numpy as np

from wall.core.jit import kernel, lane_kernel
from wall.core.kernels.albedo import WHITE, pack_albedo
from wall.core.kernels.hashing import hash_uint32
from wall.tracing import embree
from wall.tracing.kernels import rows
from wall.tracing.kernels.aiming import add_aimed, add_light
from wall.tracing.kernels.camera import make_rays, open_rays
from wall.tracing.kernels.emitters import density_of_emitter, place_emitters
from wall.tracing.kernels.environment import density_of_environment
from wall.tracing.kernels.glass import absorb
from wall.tracing.kernels.lens import keep_distances, open_lens
from wall.tracing.kernels.lights import see_sky
from wall.tracing.kernels.random_numbers import random_pair
from wall.tracing.kernels.rows import set_xyz, xyz
from wall.tracing.kernels.scatter import scatter_lanes
from wall.tracing.kernels.surface import (
    colour_by_vertices,
    colour_points,
    finish_surfaces,
    gather_surfaces,
    material_of,
    seen_from_inside,
)
from wall.tracing.kernels.terminator import find_raises, raise_towards
from wall.tracing.kernels.texture_filter import pixel_cone, start_footprints, widen_footprints
from wall.tracing.kernels.textures import apply_textures, emission_of
from wall.tracing.kernels.trace import DARKEST, drop_bad, encode_normals, intersect, write_normal
from wall.tracing.kernels.values import (
    INF,
    ONE,
    PRIMARY_RAYS,
    RAY_ROWS,
    SECONDARY_RAYS,
    THIRD,
    ZERO,
)

ROULETTE_FROM = 3  # bounces
LONGEST_ROULETTE = np.float32(0.95)  # highest chance to go on
PAIRS = 4  # of random numbers a bounce: rows from CHOICE_NUMBER on


@kernel
def trace_paths(scene, camera, xy, samples, surfaces, materials, lights, work, paths):
    """Traces one path for each position and writes its record; parameters and result as those of trace.trace.

    paths : Paths, with room for n; its rays and radiance are written
    """
    place_emitters(lights.emitters, surfaces, materials)
    alive = start_paths(camera, xy, materials.textures.texels, work, paths)
    work.counts[PRIMARY_RAYS] += alive
    for bounce in range(paths.depth + 1):
        going = 0
        for first in range(0, alive, 16):
            count = min(16, alive - first)
            load_rays(first, count, bounce, materials.textures.texels, work, paths)
            intersect(scene, work)
            see_sky(lights.environment, lights, work)
            if gather_surfaces(surfaces.meshes, surfaces.normals, materials.rows, work) != 0:
                finish_surfaces(work)
                find_raises(surfaces.normals, surfaces.vertices, surfaces.meshes, work)
                colour_by_vertices(surfaces.meshes, surfaces.colors, work)
                colour_points(surfaces.meshes, surfaces.point_colors, surfaces.segments, work)
                apply_textures(surfaces, materials, surfaces.uvs, work)
                absorb(materials.absorbs, scene.cuts, surfaces.meshes.placements, materials.rows, work)
            if bounce == 0:
                encode_normals(True, surfaces.meshes.eye_from_object, materials.rows, work)
                record_first(xy, first, count, samples, work)
                keep_distances(camera.lens, samples, first, count, work)
            add_seen(first, count, bounce, materials.emits, lights, surfaces, materials, samples, work, paths)
            if bounce < paths.depth:
                placements, scattering = surfaces.meshes.placements, materials.scattering
                draw_numbers(bounce, work)
                add_aimed(bounce, lights, scene, surfaces, materials, work)
                widen_footprints(materials.textures.texels, work)
                scatter_lanes(scattering.parts, scattering.interface, placements, materials.rows, scattering, work)
                choose_ends(bounce, scattering.rounded, work)
            add_gained(first, count, work, paths)
            if bounce < paths.depth:
                going = close_up(first, count, going, materials.textures.texels, work, paths)
        alive = going
        work.counts[SECONDARY_RAYS] += going
        if alive == 0:
            break
    return finish_samples(xy.shape[0], samples, work, paths)


@kernel
def count_samples(xy, counts, number):
    """Number samples among those of their pixels: each takes the count of its pixel and adds one to it.

    xy : (n, 2) float32, panel pixels; counts : (h, w) uint32, updated; number : (n,) uint32 or more, written
    """
    for k in range(xy.shape[0]):
        i, j = min(max(int(xy[k, 1]), 0), counts.shape[0] - 1), min(max(int(xy[k, 0]), 0), counts.shape[1] - 1)
        number[k] = counts[i, j]
        counts[i, j] += np.uint32(1)


@lane_kernel
def start_paths(camera, xy, texels, work, paths):
    """Writes the primary rays of all positions; returns their number. texels : Textures.texels"""
    p, rays, cone = work.packet, paths.rays, pixel_cone(camera, texels)
    for first in range(0, xy.shape[0], 16):
        count = min(16, xy.shape[0] - first)
        make_rays(camera, xy, first, count, work)
        for k in range(first, first + count):
            x, y = np.uint32(np.int64(camera.corner[0] + xy[k, 0])), np.uint32(np.int64(camera.corner[1] + xy[k, 1]))
            paths.sample[k] = k
            paths.key[k] = hash_uint32(hash_uint32(paths.seed, x), y)
            paths.radiance[k, 0], paths.radiance[k, 1], paths.radiance[k, 2] = ZERO, ZERO, ZERO
        start_footprints(cone, texels, work)
        open_lens(camera.lens, first, count, paths, work)
        for lane in range(16):
            set_xyz(p, rows.THROUGHPUT_R, lane, ONE, ONE, ONE)
            p[rows.DENSITY + lane] = -ONE
            p[rows.CONE_WIDTH + lane] = ZERO
        for lane in range(16):
            write_ray(first + lane, texels, lane, p, rays)
    return xy.shape[0]


@lane_kernel
def write_ray(k, texels, lane, p, rays):
    """Writes a lane's ray as ray k of `rays`, see Paths. texels : Textures.texels"""
    at = RAY_ROWS * 16 * (k >> 4) + (k & 15)
    for row in range(3):
        rays[at + 16 * row] = p[embree.ORIGIN_X + 16 * row + lane]
        rays[at + 16 * (3 + row)] = p[embree.DIRECTION_X + 16 * row + lane]
        rays[at + 16 * (6 + row)] = p[rows.THROUGHPUT_R + 16 * row + lane]
    rays[at + 16 * 9] = p[rows.DENSITY + lane]
    if texels is not None:
        rays[at + 16 * 10] = p[rows.CONE_WIDTH + lane]
        rays[at + 16 * 11] = p[rows.CONE_SPREAD + lane]


@lane_kernel
def load_rays(first, count, bounce, texels, work, paths):
    """Fills the packet with `count` rays from `first` on; those behind them are any. texels : Textures.texels"""
    p, bits, rays, at = work.packet, work.bits, paths.rays, RAY_ROWS * first
    for lane in range(16):
        x, y, z = xyz(rays, at, lane)
        set_xyz(p, embree.ORIGIN_X, lane, x, y, z)
        x, y, z = xyz(rays, at + 16 * 3, lane)
        set_xyz(p, embree.DIRECTION_X, lane, x, y, z)
        r, g, b = xyz(rays, at + 16 * 6, lane)
        set_xyz(p, rows.THROUGHPUT_R, lane, r, g, b)
        p[rows.DENSITY + lane] = rays[at + 16 * 9 + lane]
        set_xyz(p, rows.GAINED_R, lane, ZERO, ZERO, ZERO)
    if texels is not None:
        for lane in range(16):
            p[rows.CONE_WIDTH + lane] = rays[at + 16 * 10 + lane]
            p[rows.CONE_SPREAD + lane] = rays[at + 16 * 11 + lane]
    for lane in range(16):
        number = paths.number[paths.sample[first + lane]]
        bits[rows.NUMBER + lane], bits[embree.RAY_ID + lane] = number, number
        bits[rows.KEY + lane] = paths.key[first + lane]
    open_rays(count, bounce == 0, work)


@lane_kernel
def draw_numbers(bounce, work):
    """Draws the random numbers of a bounce for all lanes at once."""
    p, bits = work.packet, work.bits
    for pair in range(PAIRS):
        row, number = rows.CHOICE_NUMBER + 32 * pair, np.uint32(PAIRS * bounce + pair)
        for lane in range(16):
            u, v = random_pair(bits[rows.KEY + lane], bits[rows.NUMBER + lane], number)
            p[row + lane] = u
            p[row + 16 + lane] = v


@lane_kernel
def record_first(xy, first, count, samples, work):
    """Writes what samples keep of the first surface; the albedo's sum goes where the irradiance will be."""
    p, bits = work.packet, work.bits
    for lane in range(count):
        sample, missed = samples[first + lane], p[rows.HIT + lane] == ZERO
        sample["xy"][0], sample["xy"][1] = xy[first + lane, 0], xy[first + lane, 1]
        sample["depth"] = p[embree.T_FAR + lane]
        sample["object_id"] = np.uint32(0) if missed else bits[embree.INSTANCE + lane] + np.uint32(1)
        r, g, b = xyz(p, rows.ALBEDO_R, lane)
        sample["sqrt_irradiance"] = ZERO if missed else r + g + b
        sample["change"] = ZERO
        sample["albedo"] = WHITE if missed else pack_albedo(r, g, b)
        write_normal(sample, lane, work)


@lane_kernel
def add_seen(first, count, bounce, emits, lights, surfaces, materials, samples, work, paths):
    """Adds what the rays themselves see: the sky, and surfaces that emit, weighed against aiming at them."""
    p, placements = work.packet, surfaces.meshes.placements
    for lane in range(count):
        r, g, b = xyz(p, rows.THROUGHPUT_R, lane)
        if p[rows.HIT + lane] == ZERO:
            x, y, z = xyz(p, rows.RADIANCE_R, lane)
            weight = weight_of_sky(lights.environment, lane, work)
            add_light(lane, weight * r * x, weight * g * y, weight * b * z, p)
            continue
        if emits is not None:
            material = material_of(materials.rows, lane, work)
            emission = emission_of(materials.emission_textures, materials.rows, lane, work)
            shines = max(emission[0], emission[1], emission[2]) > ZERO
            if shines and (material["emits_behind"] > ZERO or not seen_from_inside(placements, lane, work)):
                if bounce == 0:
                    samples[first + lane]["albedo"] = WHITE
                weight = weight_of_seen(lights.emitters, surfaces, first + lane, lane, work, paths)
                r, g, b = weight * r, weight * g, weight * b
                add_light(lane, r * emission[0], g * emission[1], b * emission[2], p)


@lane_kernel
def weight_of_sky(environment, lane, work):
    """The share of the sky's light that counts where a ray found it; the rest counts where it is aimed at."""
    if environment is None:
        return ONE
    density = work.packet[rows.DENSITY + lane]
    x, y, z = xyz(work.packet, embree.DIRECTION_X, lane)
    return density / (density + density_of_environment(environment, x, y, z)) if density > ZERO else ONE


@lane_kernel
def weight_of_seen(emitters, surfaces, k, lane, work, paths):
    """The share of an emitter's light that counts where ray k found it; the rest counts where it is aimed at."""
    if emitters is None:
        return ONE
    density = work.packet[rows.DENSITY + lane]
    if not density > ZERO:
        return ONE
    return density / (density + density_of_emitter(emitters, paths.normals, surfaces, k, lane, work))


@lane_kernel
def choose_ends(bounce, rounded, work):
    """Makes the packet's rays those that go on, and says in the row GOES_ON which do: dark paths end by chance.

    rounded : Scattering.rounded
    """
    p, least = work.packet, ONE if bounce < ROULETTE_FROM else ZERO
    for lane in range(16):
        r, g, b = xyz(p, rows.NEXT_R, lane)
        tr, tg, tb = xyz(p, rows.THROUGHPUT_R, lane)
        r, g, b = r * tr, g * tg, b * tb
        brightest = max(r, g, b)
        chance = max(least, min(brightest, LONGEST_ROULETTE))
        goes = (p[rows.HIT + lane] != ZERO) & (brightest > ZERO) & (p[rows.ROULETTE_NUMBER + lane] < chance)
        p[rows.GOES_ON + lane] = ONE if goes else ZERO
        share = ONE / chance
        set_xyz(p, rows.THROUGHPUT_R, lane, share * r, share * g, share * b)
    for lane in range(16):
        x, y, z = xyz(p, rows.NEXT_X, lane)
        density = p[rows.NEXT_DENSITY + lane]
        gx, gy, gz = xyz(p, rows.GEOMETRIC_NORMAL_X, lane)
        px, py, pz = xyz(p, rows.POSITION_X, lane)
        offset = p[rows.RAY_OFFSET + lane]
        offset = offset if (x * gx + y * gy + z * gz > ZERO) | (density > ZERO) else -offset
        set_xyz(p, embree.ORIGIN_X, lane, px + offset * gx, py + offset * gy, pz + offset * gz)
        set_xyz(p, embree.DIRECTION_X, lane, x, y, z)
        p[rows.DENSITY + lane] = density
    raise_starts(rounded, work)


@lane_kernel
def raise_starts(rounded, work):
    """Moves the starts of scattered rays to where a smooth surface would be; not those of rays that were mirrored or
    went through.

    rounded : Scattering.rounded; None does nothing
    """
    if rounded is not None:
        p = work.packet
        for lane in range(16):
            dx, dy, dz = xyz(p, embree.DIRECTION_X, lane)
            x, y, z = raise_towards(dx, dy, dz, lane, p)
            scattered = p[rows.DENSITY + lane] > ZERO
            p[embree.ORIGIN_X + lane] += x if scattered else ZERO
            p[embree.ORIGIN_Y + lane] += y if scattered else ZERO
            p[embree.ORIGIN_Z + lane] += z if scattered else ZERO


@lane_kernel
def add_gained(first, count, work, paths):
    """Adds what the packet's paths gained to their samples."""
    p, radiance = work.packet, paths.radiance
    for lane in range(count):
        sample = paths.sample[first + lane]
        radiance[sample, 0] += p[rows.GAINED_R + lane]
        radiance[sample, 1] += p[rows.GAINED_G + lane]
        radiance[sample, 2] += p[rows.GAINED_B + lane]


@lane_kernel
def close_up(first, count, going, texels, work, paths):
    """Writes the rays that go on close together, from `going` on, which it counts up and returns.

    texels : Textures.texels
    """
    p = work.packet
    for lane in range(count):  # the place of a ray that does not go on is written again: no branch is guessed wrong
        write_ray(going, texels, lane, p, paths.rays)
        paths.sample[going], paths.key[going] = paths.sample[first + lane], paths.key[first + lane]
        gx, gy, gz = xyz(p, rows.GEOMETRIC_NORMAL_X, lane)
        keep_normal(paths.normals, going, gx, gy, gz)
        going += 1 if p[rows.GOES_ON + lane] != ZERO else 0
    return going


@lane_kernel
def keep_normal(normals, k, x, y, z):
    """Writes the normal where ray k starts; None does nothing."""
    if normals is not None:
        normals[k, 0], normals[k, 1], normals[k, 2] = x, y, z


@lane_kernel
def finish_samples(count, samples, work, paths):
    """Writes radiance into the records and closes up those whose radiance is finite. Returns their number."""
    bad = False
    for k in range(count):
        r, g, b = paths.radiance[k, 0], paths.radiance[k, 1], paths.radiance[k, 2]
        bad |= not abs(r) + abs(g) + abs(b) < INF
        sample = samples[k]
        albedo = sample["sqrt_irradiance"]
        light = (r + g + b) / albedo if albedo > DARKEST else (r + g + b) * THIRD
        sample["radiance"][0], sample["radiance"][1], sample["radiance"][2] = r, g, b
        sample["sqrt_irradiance"] = math.sqrt(max(light, ZERO))
    return drop_bad(samples, count, work) if bad else count
