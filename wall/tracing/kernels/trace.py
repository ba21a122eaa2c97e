"""Traces batches of samples: rays from pixels, 16-wide Embree queries, direct light, mirrors, sample records out.

Everything is relative to the eye: rays start at 0, instances and lights are placed by float64 differences to the eye
and only then rounded to float32. A packet goes through camera -> surface -> lights and bsdf -> mirrors, a file each.
"""

from __future__ import annotations

import math

import numpy as np

from wall.core.jit import inline_kernel, kernel
from wall.tracing import embree
from wall.tracing.kernels import rows
from wall.tracing.kernels.camera import make_rays
from wall.tracing.kernels.cuts import reopen_misses, shorten_rays
from wall.tracing.kernels.lights import (
    DIRECTIONAL,
    POINT,
    SPOT,
    add_ambient,
    add_emission,
    add_lights,
    light_count,
    see_sky,
)
from wall.tracing.kernels.mirrors import add_mirrored, begin_mirrors, load_mirrored, reflect, start_throughputs
from wall.tracing.kernels.rows import xyz
from wall.tracing.kernels.surface import (
    colour_by_vertices,
    colour_points,
    finish_surfaces,
    gather_surfaces,
    material_of,
)
from wall.tracing.kernels.terminator import find_raises
from wall.tracing.kernels.texture_filter import pixel_cone, start_footprints
from wall.tracing.kernels.textures import apply_textures
from wall.tracing.kernels.trees import closest_hits
from wall.tracing.kernels.values import (
    ALL_LIGHTS,
    BAD_SAMPLES,
    INF,
    MISS,
    NO_NORMAL,
    ONE,
    PRIMARY_RAYS,
    SECONDARY_RAYS,
    SHADOW_RAYS,
    THIRD,
    ZERO,
)

DARKEST = np.float32(1e-3)  # of three channels' reflectance: below it a colour cannot be divided out
TINY = np.float32(1e-30)
STEPS, CODE_OFFSET = np.float32(127.0), 128  # of a normal's octahedral components, and what makes codes unsigned
BYTE = np.uint32(255)


@kernel
def trace(scene, camera, xy, samples, surfaces, materials, lights, work):
    """Traces one sample for each position and writes its record.

    Parameters
    ----------
    scene : Trees, committed, whose instances are placed relative to the eye
    camera : RayFrame
    xy : (n, 2) float32, positions, panel pixels; 16 in a row make a packet
    samples : (n,) SAMPLE, written, except time
    surfaces, materials, lights : Surfaces, Materials, Lights
    work : Workspace; its counts are added to (rays by kind, and samples whose radiance was not finite)

    Returns
    -------
    kept : int, samples written; records 0..kept-1 are filled, those with NaN or infinite radiance are left out
    """
    texels, mirrors, n = materials.textures.texels, materials.mirrors, xy.shape[0]
    cone, first, waiting, bad = pixel_cone(camera, texels), 0, 0, False
    while first < n or waiting > 0:  # both kinds of packets in one loop: lighting them is compiled once
        primary = first < n and waiting < 16
        count = min(16, n - first if primary else waiting)
        if primary:
            make_rays(camera, xy, first, count, work)
            start_footprints(cone, texels, work)
            start_throughputs(mirrors, work)
        else:
            waiting -= count
            load_mirrored(mirrors, waiting, count, texels, work)
        work.counts[PRIMARY_RAYS if primary else SECONDARY_RAYS] += count
        intersect(scene, work)
        light_packet(scene, surfaces, materials, lights, work)
        if primary:
            divide_out_albedo(work)
            encode_normals(surfaces.relit, surfaces.meshes.eye_from_object, materials.rows, work)
        reflect(mirrors, texels, materials.rows, work)
        if primary:
            bad |= write_samples(xy, first, count, samples, surfaces.relit, work)
            waiting = begin_mirrors(mirrors, first, count, waiting, texels, work)
            first += count
        else:
            waiting, more = add_mirrored(mirrors, waiting, count, samples, texels, work)
            bad |= more
    return drop_bad(samples, n, work) if bad else n


@inline_kernel
def intersect(scene, work):
    """Finds the nearest hits of the packet's valid lanes."""
    shorten_rays(scene.cuts, 0, work)
    closest_hits(scene, work)
    reopen_misses(scene.cuts, work)


@inline_kernel
def light_packet(scene, surfaces, materials, lights, work):
    """Radiance along each ray of an intersected packet, without mirrors, into rows RADIANCE_R, _G, _B."""
    bits = work.bits
    see_sky(lights.environment, lights, work)
    if gather_surfaces(surfaces.meshes, surfaces.normals, materials.rows, work) == 0:
        return
    finish_surfaces(work)
    find_raises(surfaces.normals, surfaces.vertices, surfaces.meshes, work)
    colour_by_vertices(surfaces.meshes, surfaces.colors, work)
    colour_points(surfaces.meshes, surfaces.point_colors, surfaces.segments, work)
    apply_textures(surfaces, materials, surfaces.uvs, work)
    add_ambient(lights.environment, lights, work)
    for lane in range(16):
        bits[rows.LIGHT_VISIBILITY + lane] = ALL_LIGHTS
    rounded = materials.scattering.rounded
    work.counts[SHADOW_RAYS] += add_lights(DIRECTIONAL, lights.directional, 0, rounded, scene, work)
    first_point = light_count(lights.directional)
    work.counts[SHADOW_RAYS] += add_lights(POINT, lights.points, first_point, rounded, scene, work)
    first_spot = first_point + light_count(lights.points)
    work.counts[SHADOW_RAYS] += add_lights(SPOT, lights.spots, first_spot, rounded, scene, work)
    add_emission(materials.emits, materials.emission_textures, materials.rows, work)


@inline_kernel
def divide_out_albedo(work):
    """Irradiance over pi, into row IRRADIANCE: radiance over albedo, channels summed; the sky's radiance as it is."""
    p = work.packet
    for lane in range(16):
        light = p[rows.RADIANCE_R + lane] + p[rows.RADIANCE_G + lane] + p[rows.RADIANCE_B + lane]
        albedo = p[rows.ALBEDO_R + lane] + p[rows.ALBEDO_G + lane] + p[rows.ALBEDO_B + lane]
        coloured = p[rows.HIT + lane] > ZERO and albedo > DARKEST
        p[rows.IRRADIANCE + lane] = light / albedo if coloured else light * THIRD


@inline_kernel
def encode_normals(relit, eye_from_object, table, work):
    """Fills the rows NORMAL_CODE and SAMPLE_VISIBILITY: normals in their objects' frames, and visible lights.

    A code is octahedral, 2 x 8 bits. Mirrors get none: their radiance is not their surface's.
    relit = None does nothing; eye_from_object : see Meshes; table : (k,) MATERIAL
    """
    if relit is not None:
        p, bits = work.packet, work.bits
        for lane in range(16):
            mirror = p[rows.HIT + lane] != ZERO and material_of(table, lane, work)["mirror"] > ZERO
            if p[rows.HIT + lane] == ZERO or mirror:
                bits[rows.NORMAL_CODE + lane], bits[rows.SAMPLE_VISIBILITY + lane] = NO_NORMAL, ALL_LIGHTS
                continue
            m = eye_from_object[bits[embree.INSTANCE + lane]]
            a, b, c = xyz(p, rows.SHADING_NORMAL_X, lane)
            x, y, z = m[0] * a + m[4] * b + m[8] * c, m[1] * a + m[5] * b + m[9] * c, m[2] * a + m[6] * b + m[10] * c
            size = STEPS / max(abs(x) + abs(y) + abs(z), TINY)
            u, v = x * size, y * size
            if z < ZERO:
                u, v = (STEPS - abs(v)) * (ONE if u >= ZERO else -ONE), (STEPS - abs(u)) * (ONE if v >= ZERO else -ONE)
            low, high = np.uint32(round(u) + CODE_OFFSET), np.uint32(round(v) + CODE_OFFSET)
            bits[rows.NORMAL_CODE + lane] = low | (high << np.uint32(8))
            bits[rows.SAMPLE_VISIBILITY + lane] = bits[rows.LIGHT_VISIBILITY + lane]


@inline_kernel
def write_samples(xy, first, count, samples, relit, work):
    """Writes the packet's records from `first` on. Returns whether the radiance of some is not finite."""
    p, bits, bad = work.packet, work.bits, False
    for lane in range(count):
        r, g, b = xyz(p, rows.RADIANCE_R, lane)
        bad |= not abs(r) + abs(g) + abs(b) < INF
        sample = samples[first + lane]
        sample["xy"][0] = xy[first + lane, 0]
        sample["xy"][1] = xy[first + lane, 1]
        sample["radiance"][0] = r
        sample["radiance"][1] = g
        sample["radiance"][2] = b
        sample["depth"] = p[embree.T_FAR + lane]
        missed = bits[embree.GEOMETRY + lane] == MISS
        sample["object_id"] = np.uint32(0) if missed else bits[embree.INSTANCE + lane] + np.uint32(1)
        sample["sqrt_irradiance"] = math.sqrt(max(p[rows.IRRADIANCE + lane], ZERO))
        sample["change"] = ZERO
        if relit is not None:
            write_normal(sample, lane, work)
            sample["light_visibility"] = bits[rows.SAMPLE_VISIBILITY + lane]
    return bad


@inline_kernel
def drop_bad(samples, n, work):
    """Closes up the first n records whose radiance is finite, and counts the others. Returns how many are left."""
    kept = 0
    for k in range(n):
        radiance = samples[k]["radiance"]
        if not abs(radiance[0]) + abs(radiance[1]) + abs(radiance[2]) < INF:
            work.counts[BAD_SAMPLES] += 1
            continue
        samples[kept] = samples[k]
        kept += 1
    return kept


@inline_kernel
def write_normal(sample, lane, work):
    """Writes a lane's normal into its record."""
    code = work.bits[rows.NORMAL_CODE + lane]
    sample["normal"][0] = np.int8(np.int32(code & BYTE) - CODE_OFFSET)
    sample["normal"][1] = np.int8(np.int32(code >> np.uint32(8)) - CODE_OFFSET)
