"""Ambient occlusion: surfaces under an even white light that only hides behind what is near.

A sample is a primary ray and one shadow ray from what it hits, as far as `distance`, in a direction that is chosen in
proportion to its cosine: the mean over samples is the share of the cosine-weighted hemisphere that is free.
S. Zhukov et al., "An ambient light illumination model", Rendering Techniques 1998. Rays, surfaces, random numbers and
records are those of paths of one surface.
"""

from __future__ import annotations

import numpy as np

from wall.core.jit import inline_kernel, kernel
from wall.tracing import embree
from wall.tracing.kernels import rows
from wall.tracing.kernels.aiming import add_light, add_unshadowed, draw_light_numbers
from wall.tracing.kernels.bsdf import start_off_surface
from wall.tracing.kernels.ggx import by_cosine, frame_of, in_world
from wall.tracing.kernels.lens import keep_distances
from wall.tracing.kernels.lights import SHADOW_DIRECTION, SHADOW_ORIGIN, SHADOW_T_FAR, see_sky
from wall.tracing.kernels.path import (
    add_gained,
    finish_samples,
    load_rays,
    record_first,
    start_paths,
)
from wall.tracing.kernels.rows import SHADOW_PACKET, set_xyz, xyz
from wall.tracing.kernels.surface import colour_by_vertices, colour_points, finish_surfaces, gather_surfaces
from wall.tracing.kernels.textures import apply_textures
from wall.tracing.kernels.trace import encode_normals, intersect
from wall.tracing.kernels.values import ONE, PRIMARY_RAYS, ZERO

DIRECTION_PAIR = 1  # of random numbers: the one that a path's first surface takes for its direction
TWO = np.float32(2.0)


@kernel
def trace_ambient(scene, camera, xy, samples, surfaces, materials, lights, work, paths, occlusion):
    """Traces one sample for each position and writes its record; parameters and result as those of path.trace_paths.

    occlusion : Occlusion
    """
    number = start_paths(camera, xy, materials.textures.texels, work, paths)
    work.counts[PRIMARY_RAYS] += number
    for first in range(0, number, 16):
        count = min(16, number - first)
        load_rays(first, count, 0, materials.textures.texels, work, paths)
        intersect(scene, work)
        see_sky(lights.environment, lights, work)
        if gather_surfaces(surfaces.meshes, surfaces.normals, materials.rows, work) != 0:
            finish_surfaces(work)
            colour_by_vertices(surfaces.meshes, surfaces.colors, work)
            colour_points(surfaces.meshes, surfaces.point_colors, surfaces.segments, work)
            apply_textures(surfaces, materials, surfaces.uvs, work)
            whiten(occlusion.white, work)
        encode_normals(True, surfaces.meshes.eye_from_object, materials.rows, work)
        record_first(xy, first, count, samples, work)
        keep_distances(camera.lens, samples, first, count, work)
        draw_light_numbers(occlusion, DIRECTION_PAIR, 0, work)
        aim_anywhere(count, occlusion.distance, work)
        add_unshadowed(scene, work)
        add_gained(first, count, work, paths)
    return finish_samples(xy.shape[0], samples, work, paths)


@inline_kernel
def whiten(white, work):
    """Makes all surfaces white; None leaves them their colours."""
    if white is not None:
        for lane in range(16):
            set_xyz(work.packet, rows.ALBEDO_R, lane, ONE, ONE, ONE)


@inline_kernel
def aim_anywhere(count, distance, work):
    """Aims a shadow ray from each hit by its cosine to the shading normal, and adds what misses see of the sky.

    A direction below the surface is mirrored at it: bumps and smooth normals hide nothing by themselves.
    """
    p, bits = work.packet, work.bits
    for lane in range(16):
        p[rows.AIMED + lane] = ZERO
        if lane >= count:
            continue
        if p[rows.HIT + lane] == ZERO:
            r, g, b = xyz(p, rows.RADIANCE_R, lane)
            add_light(lane, r, g, b, p)
            continue
        normal = xyz(p, rows.SHADING_NORMAL_X, lane)
        s, t = frame_of(normal[0], normal[1], normal[2])
        dx, dy, dz = in_world(by_cosine(p[rows.LIGHT_U + lane], p[rows.LIGHT_V + lane]), s, t, normal)
        gx, gy, gz = xyz(p, rows.GEOMETRIC_NORMAL_X, lane)
        below = TWO * min(dx * gx + dy * gy + dz * gz, ZERO)
        set_xyz(p, SHADOW_DIRECTION, lane, dx - below * gx, dy - below * gy, dz - below * gz)
        start_off_surface(p, SHADOW_ORIGIN, lane)
        p[SHADOW_T_FAR + lane] = distance
        bits[SHADOW_PACKET + embree.RAY_ID + lane] = bits[rows.NUMBER + lane]
        r, g, b = xyz(p, rows.ALBEDO_R, lane)
        set_xyz(p, rows.LIGHT_R, lane, r, g, b)
        p[rows.AIMED + lane] = ONE
