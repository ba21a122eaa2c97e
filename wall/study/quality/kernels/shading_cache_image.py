"""The Shading Cache's image: what is seen where, its light from the cache, and how much samples are wanted there.

Primary rays stand for the graphics hardware of the original: they find which triangle is seen at each point, with which
texture, and are no samples, as they cast no shadow rays and follow no mirrors.
"""

from __future__ import annotations

import numpy as np

from wall.core.jit import kernel
from wall.study.quality.kernels.render_cache import root
from wall.study.quality.kernels.shading_cache import locate
from wall.tracing import embree
from wall.tracing.kernels import rows
from wall.tracing.kernels.camera import make_rays
from wall.tracing.kernels.lights import see_sky
from wall.tracing.kernels.rows import xyz
from wall.tracing.kernels.surface import (
    colour_by_vertices,
    colour_points,
    finish_surfaces,
    gather_surfaces,
    material_of,
    weights_of,
)
from wall.tracing.kernels.texture_filter import pixel_cone, start_footprints
from wall.tracing.kernels.textures import apply_textures
from wall.tracing.kernels.trace import intersect

ZERO, ONE = np.float32(0.0), np.float32(1.0)
DARK = np.float32(0.04)  # albedo below which light is not divided by it
SKY_WANTED = np.float32(1e-4)  # of samples, at a point of the sky: they are traced where there is nothing else
SUBPIXELS = 2  # a pixel's columns and rows of points


@kernel
def look(scene, camera, xy, surfaces, materials, lights, work, points):
    """Find what is seen at panel positions. Mirrors, glass and surfaces that are almost black have albedo 1.

    scene, camera, xy, surfaces, materials, lights, work : as for tracing.kernels.trace.trace; points : Points, written
    """
    cone = pixel_cone(camera, materials.textures.texels)
    p, bits = work.packet, work.bits
    for first in range(0, xy.shape[0], 16):
        count = min(16, xy.shape[0] - first)
        make_rays(camera, xy, first, count, work)
        start_footprints(cone, materials.textures.texels, work)
        intersect(scene, work)
        see_sky(lights.environment, lights, work)
        if gather_surfaces(surfaces.meshes, surfaces.normals, materials.rows, work) > 0:
            finish_surfaces(work)
            colour_by_vertices(surfaces.meshes, surfaces.colors, work)
            colour_points(surfaces.meshes, surfaces.point_colors, surfaces.segments, work)
            apply_textures(surfaces, materials, surfaces.uvs, work)
        for lane in range(count):
            k = first + lane
            if p[rows.HIT + lane] == ZERO:
                points.seen[k, 0] = points.seen[k, 1] = 0
                r, g, b = xyz(p, rows.RADIANCE_R, lane)
            else:
                points.seen[k, 0] = bits[embree.INSTANCE + lane] + np.uint32(1)
                points.seen[k, 1] = bits[embree.PRIMITIVE + lane]
                _, points.weights[k, 0], points.weights[k, 1] = weights_of(lane, work)
                r, g, b = xyz(p, rows.ALBEDO_R, lane)
                material = material_of(materials.rows, lane, work)
                if min(r, g, b) < DARK or material["mirror"] > ZERO or material["transmission"] > ZERO:
                    r, g, b = ONE, ONE, ONE
            points.albedo[k, 0], points.albedo[k, 1], points.albedo[k, 2] = r, g, b


@kernel
def shade(points, patches, values, image, priority, seen):
    """Make the image of the points' light, and say where samples are wanted.

    Parameters
    ----------
    points : Points, SUBPIXELS^2 of each pixel one after another; patches : Patches
    values : (4,) float32, what is wanted for each turn of age, for a contrast of 1 between a patch's corners (sqrt
        radiance), for any surface, and where nothing is known
    image : (h, w, 4) float32, written: linear RGB, and 1 or less where something is not known
    priority : (h, w) float32, written
    seen : (h, w, 3) int32, written: corners of the patch at the last of each pixel's points, -1: sky
    """
    light, age, corners = patches.light, patches.age, patches.corners
    height, width = priority.shape
    around = SUBPIXELS * SUBPIXELS
    for i in range(height):
        for j in range(width):
            red = green = blue = total = wanted = ZERO
            for k in range(around * (i * width + j), around * (i * width + j + 1)):
                albedo = points.albedo[k]
                if points.seen[k, 0] == 0:
                    red, green, blue, total = red + albedo[0], green + albedo[1], blue + albedo[2], total + ONE
                    wanted += SKY_WANTED
                    seen[i, j, :] = -1
                    continue
                patch, a, b, c = locate(patches, points, k)
                seen[i, j, 0], seen[i, j, 1], seen[i, j, 2] = corners[patch, 0], corners[patch, 1], corners[patch, 2]
                high = oldest = ZERO
                low = known = np.float32(1e9)
                r = g = b_light = weight = ZERO
                for n in range(3):
                    v = corners[patch, n]
                    if age[v] < ZERO:
                        known = ZERO
                        continue
                    part = a if n == 0 else b if n == 1 else c
                    part = max(part, np.float32(1e-3))
                    r, g, b_light = r + part * light[v, 0], g + part * light[v, 1], b_light + part * light[v, 2]
                    weight += part
                    value = root(light[v, 1] * albedo[1])
                    high, low, oldest = max(high, value), min(low, value), max(oldest, age[v])
                wanted += values[0] * oldest + values[1] * max(high - low, ZERO) + values[2]
                wanted += values[3] if known == ZERO else ZERO
                if weight > ZERO:
                    share = min(weight, ONE) / weight
                    red += r * share * albedo[0]
                    green += g * share * albedo[1]
                    blue += b_light * share * albedo[2]
                    total += min(weight, ONE)
            scale = ONE / max(total, np.float32(1e-6))
            image[i, j, 0], image[i, j, 1], image[i, j, 2] = red * scale, green * scale, blue * scale
            image[i, j, 3] = min(total / np.float32(around) * np.float32(2.0), ONE)
            priority[i, j] = wanted
