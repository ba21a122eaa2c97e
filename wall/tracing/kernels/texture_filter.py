"""Lookup of textures, filtered over the footprint of a sample, by ray cones, mip levels and anisotropic probes.

A sample stands for a square of `RayFrame.footprint` pixels. Its cone widens with the way, mirrors passed included, and
cuts a surface in an ellipse, W across and W / cosine along. The ellipse is carried into the texture by the hit
triangle's own mapping; its short axis chooses the mip level, its long axis is walked in up to MAX_PROBES probes.
Ray cones: T. Akenine-Moeller et al., "Improved Shader and Texture Level of Detail Using Ray Cones", JCGT 2021; probes:
J. McCormack et al., "Feline: Fast Elliptical Lines for Anisotropic Texture Mapping", SIGGRAPH 1999. Curved mirrors
widen cones as flat ones do.
"""

from __future__ import annotations

import math

import numpy as np

from wall.core.jit import inline_kernel
from wall.tracing import embree
from wall.tracing.kernels import rows
from wall.tracing.kernels.rows import set_xyz, xyz
from wall.tracing.kernels.surface import corners_of, material_of, weights_of
from wall.tracing.kernels.values import (
    BASE_COLOR,
    EMISSION,
    HAS_UVS,
    MESH_FLAGS,
    METALLIC_ROUGHNESS,
    MIRROR,
    NORMAL,
    ONE,
    REPEAT,
    ZERO,
)

UVS_FLAG = np.uint32(HAS_UVS)
MAX_PROBES = 8  # along the long axis; a longer ellipse is blurred across
FLATTEST = np.float32(1e-3)  # smallest cosine by which a cone's width is divided: below, MAX_PROBES decides
HALF, QUARTER = np.float32(0.5), np.float32(0.25)
TWO, FOUR = np.float32(2.0), np.float32(4.0)
PROBE_SHARE, MOST_PROBES = np.float32(1.0 / MAX_PROBES**2), np.float32(MAX_PROBES**2)
STRAIGHT = np.float32(1e-6)  # square of the sine below which a ray comes from straight above


@inline_kernel
def pixel_cone(camera, texels):
    """What start_footprints needs of a camera: B x C as a unit vector, and the spread of a ray along it; None: nothing.

    Spread is the square root of a pixel's solid angle, det(A, B, C) / |A + X B + Y C|^3, times the footprint's edge.
    """
    if texels is None:
        return ZERO, ZERO, ZERO, ZERO
    f = camera.frame
    normal = (
        f[1, 1] * f[2, 2] - f[1, 2] * f[2, 1],
        f[1, 2] * f[2, 0] - f[1, 0] * f[2, 2],
        f[1, 0] * f[2, 1] - f[1, 1] * f[2, 0],
    )
    determinant = abs(f[0, 0] * normal[0] + f[0, 1] * normal[1] + f[0, 2] * normal[2])
    size = math.sqrt(normal[0] ** 2 + normal[1] ** 2 + normal[2] ** 2)
    # |A + X B + Y C| = det / (d . B x C), with d its unit direction
    spread = np.float32(camera.footprint * size**1.5 / determinant if determinant > 0.0 else 0.0)
    return np.float32(normal[0] / size), np.float32(normal[1] / size), np.float32(normal[2] / size), spread


@inline_kernel
def start_footprints(cone, texels, work):
    """Sets the cones of primary rays; texels = None does nothing. cone : see pixel_cone"""
    if texels is not None:
        p = work.packet
        nx, ny, nz, spread = cone
        for lane in range(16):
            dx, dy, dz = xyz(p, embree.DIRECTION_X, lane)
            cosine = abs(dx * nx + dy * ny + dz * nz)
            p[rows.CONE_SPREAD + lane] = spread * cosine * math.sqrt(cosine)
            p[rows.CONE_WIDTH + lane] = ZERO


@inline_kernel
def widen_footprints(texels, work):
    """Widens the cones of lanes that hit something by the way that their rays went; texels = None does nothing."""
    if texels is not None:
        p = work.packet
        for lane in range(16):
            way = p[embree.T_FAR + lane] if p[rows.HIT + lane] != ZERO else ZERO
            p[rows.CONE_WIDTH + lane] += way * p[rows.CONE_SPREAD + lane]


@inline_kernel
def gather_mappings(meshes, vertices, uvs, table, work):
    """Looks up how textured lanes' triangles are mapped, by set 0 of texture coordinates: rows TEXTURED to MAPPING_V2.
    Returns how many are textured.

    vertices, uvs : see Surfaces; table : (k,) MATERIAL
    """
    p, bits = work.packet, work.bits
    textured = 0
    for lane in range(16):
        p[rows.TEXTURED + lane] = ZERO
        if p[rows.HIT + lane] == ZERO:
            continue
        instance = bits[embree.INSTANCE + lane]
        material = material_of(table, lane, work)
        width = material["texture_width"]
        if meshes.mesh_table[instance, MESH_FLAGS] & UVS_FLAG == np.uint32(0):
            continue
        if max(width[BASE_COLOR], width[METALLIC_ROUGHNESS], width[EMISSION], width[NORMAL]) == 0:
            continue
        textured += 1
        p[rows.TEXTURED + lane] = ONE
        i0, i1, i2 = corners_of(meshes, lane, work)
        m = meshes.eye_from_object[instance]
        for corner, edge in ((i1, rows.EDGE_1_X), (i2, rows.EDGE_2_X)):
            x = vertices[corner, 0] - vertices[i0, 0]
            y = vertices[corner, 1] - vertices[i0, 1]
            z = vertices[corner, 2] - vertices[i0, 2]
            p[edge + lane] = m[0] * x + m[1] * y + m[2] * z
            p[edge + 16 + lane] = m[4] * x + m[5] * y + m[6] * z
            p[edge + 32 + lane] = m[8] * x + m[9] * y + m[10] * z
        map_triangle(uvs, 0, (i0, i1, i2), lane, work)
    return textured


@inline_kernel
def map_triangle(uvs, column, corners, lane, work):
    """Writes how a lane's triangle is mapped, by u in a column of texture coordinates and v in the next one."""
    p, (i0, i1, i2) = work.packet, corners
    _, s, t = weights_of(lane, work)
    u0, v0 = uvs[i0, column], uvs[i0, column + 1]
    u1, v1 = uvs[i1, column] - u0, uvs[i1, column + 1] - v0
    u2, v2 = uvs[i2, column] - u0, uvs[i2, column + 1] - v0
    set_xyz(p, rows.MAPPING_U0, lane, u0 + s * u1 + t * u2, u1, u2)
    set_xyz(p, rows.MAPPING_V0, lane, v0 + s * v1 + t * v2, v1, v2)


@inline_kernel
def uv_column(used, material, slot):
    """Column of Surfaces.uvs where a texture of a material finds its u; used : Textures.uv_sets."""
    if used is None:
        return 0
    return 2 * material["uv_set"][slot]


@inline_kernel
def choose_mappings(used, slot, meshes, uvs, table, work):
    """Maps textured lanes by the texture coordinates of one texture of each lane's material, and projects footprints
    again; used : Textures.uv_sets, None does nothing."""
    if used is not None:
        for lane in range(16):
            if work.packet[rows.TEXTURED + lane] != ZERO:
                column = uv_column(used, material_of(table, lane, work), slot)
                map_triangle(uvs, column, corners_of(meshes, lane, work), lane, work)
        project_footprints(work)


@inline_kernel
def project_footprints(work):
    """Carries the cones of textured lanes into texture coordinates, for all lanes at once: rows ALONG_U to ACROSS_V."""
    p = work.packet
    for lane in range(16):
        ex, ey, ez = xyz(p, rows.EDGE_1_X, lane)
        fx, fy, fz = xyz(p, rows.EDGE_2_X, lane)
        nx, ny, nz = xyz(p, rows.GEOMETRIC_NORMAL_X, lane)
        dx, dy, dz = xyz(p, embree.DIRECTION_X, lane)
        # weights of corners 1 and 2 change by b / area and c / area a unit of way on the surface
        bx, by, bz = fy * nz - fz * ny, fz * nx - fx * nz, fx * ny - fy * nx
        cx, cy, cz = ny * ez - nz * ey, nz * ex - nx * ez, nx * ey - ny * ex
        area = ex * bx + ey * by + ez * bz
        cosine = dx * nx + dy * ny + dz * nz
        ax, ay, az = dx - cosine * nx, dy - cosine * ny, dz - cosine * nz  # on the surface, in the ray's way
        square = ax * ax + ay * ay + az * az
        above = square < STRAIGHT  # then any direction will do
        ax, ay, az = ex if above else ax, ey if above else ay, ez if above else az
        square = ax * ax + ay * ay + az * az
        ox, oy, oz = ny * az - nz * ay, nz * ax - nx * az, nx * ay - ny * ax
        across = p[rows.CONE_WIDTH + lane] + p[embree.T_FAR + lane] * p[rows.CONE_SPREAD + lane]
        across = across / (math.sqrt(square) * area)
        along = across / max(abs(cosine), FLATTEST)
        _, u1, u2 = xyz(p, rows.MAPPING_U0, lane)
        _, v1, v2 = xyz(p, rows.MAPPING_V0, lane)
        s, t = along * (ax * bx + ay * by + az * bz), along * (ax * cx + ay * cy + az * cz)
        p[rows.ALONG_U + lane], p[rows.ALONG_V + lane] = s * u1 + t * u2, s * v1 + t * v2
        s, t = across * (ox * bx + oy * by + oz * bz), across * (ox * cx + oy * cy + oz * cz)
        p[rows.ACROSS_U + lane], p[rows.ACROSS_V + lane] = s * u1 + t * u2, s * v1 + t * v2


@inline_kernel
def measure_footprints(slot, meshes, uvs, table, textures, work):
    """Measures footprints in the texels of one texture of each lane's material, BASE_COLOR to NORMAL: rows TEXELS_U and
    _V, LONG_U, LONG_V (texture coordinates), and the squares of both axes in texels."""
    choose_mappings(textures.uv_sets, slot, meshes, uvs, table, work)
    p = work.packet
    for lane in range(16):
        width, height = 0, 0
        if p[rows.TEXTURED + lane] != ZERO:
            material = material_of(table, lane, work)
            width, height = material["texture_width"][slot], material["texture_height"][slot]
        p[rows.TEXELS_U + lane], p[rows.TEXELS_V + lane] = np.float32(width), np.float32(height)
    for lane in range(16):
        along_u, along_v = p[rows.ALONG_U + lane], p[rows.ALONG_V + lane]
        across_u, across_v = p[rows.ACROSS_U + lane], p[rows.ACROSS_V + lane]
        width, height = p[rows.TEXELS_U + lane], p[rows.TEXELS_V + lane]
        along = (along_u * width) ** 2 + (along_v * height) ** 2
        across = (across_u * width) ** 2 + (across_v * height) ** 2
        turned = across > along
        p[rows.LONG_U + lane], p[rows.LONG_V + lane] = across_u if turned else along_u, across_v if turned else along_v
        p[rows.LONG_SQUARE + lane], p[rows.SHORT_SQUARE + lane] = max(along, across), min(along, across)


@inline_kernel
def filtered_texel(slot, values, table, textures, lane, work):
    """Mean of a material's texture, BASE_COLOR to NORMAL, over the footprint of a lane's hit, RGB.

    values : (256,) float32, what a byte stands for; table : (k,) MATERIAL
    """
    p, texels, edges = work.packet, textures.texels, textures.edges
    material = material_of(table, lane, work)
    wrap = material["wrap_u"][slot], material["wrap_v"][slot]
    u, v, level = p[rows.MAPPING_U0 + lane], p[rows.MAPPING_V0 + lane], finest_level(material, slot)
    long = p[rows.LONG_SQUARE + lane]
    if not long > ONE:  # not even a texel wide, or not a number
        return texel_at(texels, level, values, edges, wrap, u, v)
    most = max(p[rows.TEXELS_U + lane], p[rows.TEXELS_V + lane])
    square = min(max(p[rows.SHORT_SQUARE + lane], long * PROBE_SHARE, ONE), most * most)
    probes = int(math.sqrt(min(long / square, MOST_PROBES)) + HALF)
    while square >= FOUR:
        square *= QUARTER
        level = next_level(level)
    coarse, blend = next_level(level), math.sqrt(square) - ONE
    share, red, green, blue = ONE / np.float32(probes), ZERO, ZERO, ZERO
    along_u, along_v = share * p[rows.LONG_U + lane], share * p[rows.LONG_V + lane]
    first = HALF * np.float32(probes - 1)
    u, v = u - first * along_u, v - first * along_v
    for _ in range(probes):
        r0, g0, b0 = texel_at(texels, level, values, edges, wrap, u, v)
        r1, g1, b1 = texel_at(texels, coarse, values, edges, wrap, u, v)
        red, green, blue = red + r0 + blend * (r1 - r0), green + g0 + blend * (g1 - g0), blue + b0 + blend * (b1 - b0)
        u, v = u + along_u, v + along_v
    return share * red, share * green, share * blue


@inline_kernel
def finest_level(material, slot):
    """First row of Textures.texels, width and height, texels, of one of a material's textures."""
    return material["first_texel"][slot], material["texture_width"][slot], material["texture_height"][slot]


@inline_kernel
def next_level(level):
    """The mip level behind one of finest_level's kind, half as wide and high; that of one texel is the last."""
    first, width, height = level
    last = width * height == 1
    return first if last else first + width * height, max(width >> 1, 1), max(height >> 1, 1)


@inline_kernel
def wrapped(u, size, wrap):
    """A texture coordinate of `size` texels brought inside, to where repeating does not show."""
    if wrap == REPEAT:
        return u
    if wrap == MIRROR:
        u = ONE - abs(u - TWO * np.floor(HALF * u) - ONE)
    half = HALF / size
    return min(max(u, half), ONE - half)


@inline_kernel
def texel_at(texels, level, values, edges, wrap, u, v):
    """Bilinear lookup in a mip level (see finest_level), of what its bytes stand for; v up.

    edges : None where all textures repeat; wrap : REPEAT, CLAMP or MIRROR along u and v
    """
    first, width, height = level
    if edges is not None:
        u, v = wrapped(u, width, wrap[0]), wrapped(v, height, wrap[1])
    x = (u - np.floor(u)) * width + HALF  # of the texel right of it
    y = (ONE - (v - np.floor(v))) * height + HALF
    x0, x1, y0, y1, fx, fy = texels_about(x, y, width, height)
    a, b = texels[first + y0 * width + x0], texels[first + y0 * width + x1]
    c, d = texels[first + y1 * width + x0], texels[first + y1 * width + x1]
    wa, wb, wc, wd = (ONE - fx) * (ONE - fy), fx * (ONE - fy), (ONE - fx) * fy, fx * fy
    red = wa * values[a[0]] + wb * values[b[0]] + wc * values[c[0]] + wd * values[d[0]]
    green = wa * values[a[1]] + wb * values[b[1]] + wc * values[c[1]] + wd * values[d[1]]
    blue = wa * values[a[2]] + wb * values[b[2]] + wc * values[c[2]] + wd * values[d[2]]
    return red, green, blue


@inline_kernel
def texels_about(x, y, width, height):
    """The four texels about a place, repeating: columns left and right, rows above and below, shares of right, below.

    x, y : texels, from the middle of the last one before the left and upper edges
    """
    if not (x >= ZERO and y >= ZERO):  # NaN coordinates read some texel
        x, y = ZERO, ZERO
    x1, y1 = np.int32(x), np.int32(y)
    fx, fy = x - np.float32(x1), y - np.float32(y1)
    x0, y0 = x1 - 1 if x1 > 0 else width - 1, y1 - 1 if y1 > 0 else height - 1
    x1, y1 = x1 if x1 < width else 0, y1 if y1 < height else 0
    return x0, x1, y0, y1, fx, fy
