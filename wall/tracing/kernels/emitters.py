"""Surfaces that emit, as light sources: triangles chosen in proportion to their power, or by a tree of what they bring
to a point, and points spread evenly on them."""

from __future__ import annotations

import math

import numpy as np

from wall.core.jit import lane_kernel
from wall.tracing import embree
from wall.tracing.kernels import rows
from wall.tracing.kernels.light_tree import chance_of_light, choose_light
from wall.tracing.kernels.rows import set_xyz, xyz
from wall.tracing.kernels.texture_filter import UVS_FLAG, finest_level, texel_at, uv_column
from wall.tracing.kernels.values import (
    EMISSION,
    EMITTER_COLUMNS,
    FIRST_TRIANGLE,
    FIRST_VERTEX,
    MATERIAL_ROW,
    MESH_FLAGS,
    ONE,
    ZERO,
)

HALF = np.float32(0.5)
NEARLY = np.float32(1.0 - 1e-4)  # of the way to a light, where its shadow ray ends at the latest


@lane_kernel
def corner_of(surfaces, instance, vertex):
    """A vertex of an instance relative to the eye."""
    x, y, z = surfaces.vertices[vertex, 0], surfaces.vertices[vertex, 1], surfaces.vertices[vertex, 2]
    m = surfaces.meshes.eye_from_object[instance]
    return (
        m[0] * x + m[1] * y + m[2] * z + m[3],
        m[4] * x + m[5] * y + m[6] * z + m[7],
        m[8] * x + m[9] * y + m[10] * z + m[11],
    )


@lane_kernel
def corners_of_triangle(surfaces, instance, primitive):
    """The three vertex numbers of a triangle of an instance."""
    mesh = surfaces.meshes.mesh_table[instance]
    corners, first = surfaces.meshes.triangles[mesh[FIRST_TRIANGLE] + primitive], mesh[FIRST_VERTEX]
    return first + corners[0], first + corners[1], first + corners[2]


@lane_kernel
def spanned(surfaces, instance, corners):
    """Corner 0 of a triangle, its edges to corners 1 and 2, and its normal, as long as twice its area."""
    a = corner_of(surfaces, instance, corners[0])
    b = corner_of(surfaces, instance, corners[1])
    c = corner_of(surfaces, instance, corners[2])
    e, f = (b[0] - a[0], b[1] - a[1], b[2] - a[2]), (c[0] - a[0], c[1] - a[1], c[2] - a[2])
    normal = e[1] * f[2] - e[2] * f[1], e[2] * f[0] - e[0] * f[2], e[0] * f[1] - e[1] * f[0]
    return a, e, f, normal


@lane_kernel
def determinant_of(m):
    """Determinant of the linear part of a row major 3x4 matrix (12,): negative for mirrored instances."""
    a = m[0] * (m[5] * m[10] - m[6] * m[9])
    return a - m[1] * (m[4] * m[10] - m[6] * m[8]) + m[2] * (m[4] * m[9] - m[5] * m[8])


@lane_kernel
def choose_emitter(tree, emitters, lane, p):
    """The row of a triangle chosen for a lane with the random number LIGHT_NUMBER, and its chance, which may be 0."""
    if tree is not None:
        point, normal = xyz(p, rows.POSITION_X, lane), xyz(p, rows.GEOMETRIC_NORMAL_X, lane)
        return choose_light(tree, p[rows.LIGHT_NUMBER + lane], point, normal, p)
    row = np.int64(p[rows.LAMP_ROW + lane])
    return row, emitters.chance[row]


@lane_kernel
def chance_of_emitter(normals, emitters, row, k, lane, p):
    """The chance with which choose_emitter finds a row where ray k of a lane starts.

    normals : Paths.normals
    """
    if normals is not None:
        point, normal = xyz(p, embree.ORIGIN_X, lane), (normals[k, 0], normals[k, 1], normals[k, 2])
        return chance_of_light(emitters.tree, row, point, normal, p)
    return emitters.chance[row]


@lane_kernel
def place_emitters(emitters, surfaces, materials):
    """Writes Emitters.placed; emitters = None, or a tree of them, does nothing."""
    if emitters is not None:
        place_rows(emitters.placed, emitters, surfaces, materials)


@lane_kernel
def place_rows(placed, emitters, surfaces, materials):
    """Writes the rows of Emitters.placed; None does nothing."""
    if placed is not None:
        for row in range(placed.shape[0]):
            copy_emitter(placed[row], 1, 0, row, emitters.chance[row], emitters, surfaces, materials)


@lane_kernel
def copy_emitter(to, step, lane, row, chance, emitters, surfaces, materials):
    """Writes what LAMP_X to LAMP_CHANCE say of a triangle that was chosen with a chance.

    to : (k,) float32, with the first number at `lane` and the others `step` apart
    """
    instance = emitters.instance[row]
    corners = corners_of_triangle(surfaces, instance, np.uint32(row - emitters.first[instance]))
    a, e, f, _ = spanned(surfaces, instance, corners)
    material = materials.rows[surfaces.meshes.mesh_table[instance, MATERIAL_ROW]]
    front = ONE if determinant_of(surfaces.meshes.eye_from_object[instance]) > ZERO else -ONE  # mirrored: corners turn
    emission = material["emission"]
    for k in range(3):
        to[lane + step * k] = a[k]
        to[lane + step * (3 + k)] = e[k]
        to[lane + step * (6 + k)] = f[k]
        to[lane + step * (9 + k)] = emission[k]
    to[lane + step * 12] = ZERO if material["emits_behind"] > ZERO else front
    to[lane + step * 13] = chance


@lane_kernel
def choose_emitters(emitters, surfaces, materials, work):
    """Chooses a triangle for each lane that hit something: rows LAMP_X to LAMP_CHANCE."""
    p = work.packet
    find_rows(emitters.placed, emitters, work)
    for lane in range(16):
        if p[rows.HIT + lane] != ZERO:
            row, chance = choose_emitter(emitters.tree, emitters, lane, p)
            look_up_emitter(emitters.placed, row, chance, emitters, surfaces, materials, lane, p)
            colour_emitter(materials.emission_textures, row, emitters, surfaces, materials, lane, p)


@lane_kernel
def find_rows(placed, emitters, work):
    """Writes LAMP_ROW for all lanes at once: how many triangles come before the random number LIGHT_NUMBER.

    placed : of Emitters; None, where there are many, does nothing
    """
    if placed is not None:
        p = work.packet
        for lane in range(16):
            p[rows.LAMP_ROW + lane] = ZERO
        for row in range(placed.shape[0] - 1):
            before = emitters.cumulated[row]
            for lane in range(16):
                p[rows.LAMP_ROW + lane] += ONE if p[rows.LIGHT_NUMBER + lane] >= before else ZERO


@lane_kernel
def look_up_emitter(placed, row, chance, emitters, surfaces, materials, lane, p):
    """Writes a lane's rows LAMP_X to LAMP_CHANCE; placed : of Emitters, None: they are worked out."""
    if placed is None:
        copy_emitter(p, 16, rows.LAMP_X + lane, row, chance, emitters, surfaces, materials)
    else:
        for k in range(EMITTER_COLUMNS):
            p[rows.LAMP_X + 16 * k + lane] = placed[row, k]


@lane_kernel
def colour_emitter(used, row, emitters, surfaces, materials, lane, p):
    """Sets a lane's emission to that of the point that POINT_U and POINT_V choose; used : Materials.emission_textures,
    None does nothing."""
    if used is not None:
        instance = emitters.instance[row]
        corners = corners_of_triangle(surfaces, instance, np.uint32(row - emitters.first[instance]))
        s, t = chosen_point(lane, p)
        r, g, b = emission_at(used, surfaces, materials, instance, corners, s, t)
        set_xyz(p, rows.LAMP_R, lane, r, g, b)


@lane_kernel
def chosen_point(lane, p):
    """Weights of corners 1 and 2 of a triangle: a point by POINT_U and POINT_V, which are spread evenly."""
    root, v = math.sqrt(p[rows.POINT_U + lane]), p[rows.POINT_V + lane]
    return root * (ONE - v), root * v


@lane_kernel
def way_to_emitter(lane, work):
    """A point on the emitting triangle that was chosen: the way to it from a lane's hit, its emission, RGB, the
    direction's density, 0 where the point is seen from its edge, and where along the way its shadow ray ends.
    """
    p = work.packet
    s, t = chosen_point(lane, p)
    (ax, ay, az), (px, py, pz) = xyz(p, rows.LAMP_X, lane), xyz(p, rows.POSITION_X, lane)
    (ex, ey, ez), (fx, fy, fz) = xyz(p, rows.LAMP_1_X, lane), xyz(p, rows.LAMP_2_X, lane)
    dx, dy, dz = ax + s * ex + t * fx - px, ay + s * ey + t * fy - py, az + s * ez + t * fz - pz
    square = dx * dx + dy * dy + dz * dz
    turned = (ey * fz - ez * fy) * dx + (ez * fx - ex * fz) * dy + (ex * fy - ey * fx) * dz
    side = p[rows.LAMP_SIDE + lane]
    facing = HALF * (abs(turned) if side == ZERO else -side * turned)  # area times cosine times distance
    density = p[rows.LAMP_CHANCE + lane] * square * math.sqrt(square) / facing if facing > ZERO else ZERO
    return (dx, dy, dz), xyz(p, rows.LAMP_R, lane), density, NEARLY


@lane_kernel
def emission_at(used, surfaces, materials, instance, corners, s, t):
    """What an instance emits at the weights s, t of a triangle's corners 1 and 2, RGB.

    used : Materials.emission_textures
    """
    mesh = surfaces.meshes.mesh_table[instance]
    material = materials.rows[mesh[MATERIAL_ROW]]
    emission = material["emission"]
    r, g, b = emission[0], emission[1], emission[2]
    if used is None:
        return r, g, b
    if material["texture_width"][EMISSION] == 0 or mesh[MESH_FLAGS] & UVS_FLAG == np.uint32(0):
        return r, g, b
    textures = materials.textures
    uvs, rest, at = surfaces.uvs, ONE - s - t, uv_column(materials.textures.uv_sets, material, EMISSION)
    u = rest * uvs[corners[0], at] + s * uvs[corners[1], at] + t * uvs[corners[2], at]
    v = rest * uvs[corners[0], at + 1] + s * uvs[corners[1], at + 1] + t * uvs[corners[2], at + 1]
    wrap = material["wrap_u"][EMISSION], material["wrap_v"][EMISSION]
    level = finest_level(material, EMISSION)
    tr, tg, tb = texel_at(textures.texels, level, textures.linear_of_srgb, textures.edges, wrap, u, v)
    return r * tr, g * tg, b * tb


@lane_kernel
def density_of_emitter(emitters, normals, surfaces, k, lane, work):
    """Density with which way_to_emitter, from the start of ray k, finds the direction of the ray, that hit an emitter.

    normals : Paths.normals
    """
    p, bits = work.packet, work.bits
    instance, primitive = bits[embree.INSTANCE + lane], bits[embree.PRIMITIVE + lane]
    first = emitters.first[instance]
    if first < 0:
        return ZERO
    _, _, _, normal = spanned(surfaces, instance, corners_of_triangle(surfaces, instance, primitive))
    dx, dy, dz = xyz(p, embree.DIRECTION_X, lane)
    facing = HALF * abs(normal[0] * dx + normal[1] * dy + normal[2] * dz)
    way = p[embree.T_FAR + lane]
    if not facing > ZERO:
        return ZERO
    return chance_of_emitter(normals, emitters, first + np.int64(primitive), k, lane, p) * way * way / facing
