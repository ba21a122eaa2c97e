"""Surfaces that emit, as light sources: triangles chosen in proportion to their power, or by a tree of what they bring
to a point, and points spread evenly on them."""

from __future__ import annotations

import math

import numpy as np

from wall.core.jit import inline_kernel
from wall.tracing import embree
from wall.tracing.kernels import rows
from wall.tracing.kernels.light_tree import chance_of_light, choose_light
from wall.tracing.kernels.rows import xyz
from wall.tracing.kernels.texture_filter import UVS_FLAG, finest_level, texel_at, uv_column
from wall.tracing.kernels.values import EMISSION, FIRST_TRIANGLE, FIRST_VERTEX, MATERIAL_ROW, MESH_FLAGS, ONE, ZERO

HALF = np.float32(0.5)
NEARLY = np.float32(1.0 - 1e-4)  # of the way to a light, where its shadow ray ends at the latest


@inline_kernel
def corner_of(surfaces, instance, vertex):
    """A vertex of an instance relative to the eye."""
    x, y, z = surfaces.vertices[vertex, 0], surfaces.vertices[vertex, 1], surfaces.vertices[vertex, 2]
    m = surfaces.meshes.eye_from_object[instance]
    return (
        m[0] * x + m[1] * y + m[2] * z + m[3],
        m[4] * x + m[5] * y + m[6] * z + m[7],
        m[8] * x + m[9] * y + m[10] * z + m[11],
    )


@inline_kernel
def corners_of_triangle(surfaces, instance, primitive):
    """The three vertex numbers of a triangle of an instance."""
    mesh = surfaces.meshes.mesh_table[instance]
    corners, first = surfaces.meshes.triangles[mesh[FIRST_TRIANGLE] + primitive], mesh[FIRST_VERTEX]
    return first + corners[0], first + corners[1], first + corners[2]


@inline_kernel
def spanned(surfaces, instance, corners):
    """Corner 0 of a triangle, its edges to corners 1 and 2, and its normal, as long as twice its area."""
    a = corner_of(surfaces, instance, corners[0])
    b = corner_of(surfaces, instance, corners[1])
    c = corner_of(surfaces, instance, corners[2])
    e, f = (b[0] - a[0], b[1] - a[1], b[2] - a[2]), (c[0] - a[0], c[1] - a[1], c[2] - a[2])
    normal = e[1] * f[2] - e[2] * f[1], e[2] * f[0] - e[0] * f[2], e[0] * f[1] - e[1] * f[0]
    return a, e, f, normal


@inline_kernel
def determinant_of(m):
    """Determinant of the linear part of a row major 3x4 matrix (12,): negative for mirrored instances."""
    a = m[0] * (m[5] * m[10] - m[6] * m[9])
    return a - m[1] * (m[4] * m[10] - m[6] * m[8]) + m[2] * (m[4] * m[9] - m[5] * m[8])


@inline_kernel
def choose_emitter(tree, emitters, lane, p):
    """The row of a triangle chosen for a lane with the random number LIGHT_NUMBER, and its chance, which may be 0."""
    pick = p[rows.LIGHT_NUMBER + lane]
    if tree is not None:
        point, normal = xyz(p, rows.POSITION_X, lane), xyz(p, rows.GEOMETRIC_NORMAL_X, lane)
        return choose_light(tree, pick, point, normal, p)
    row = min(np.searchsorted(emitters.cumulated, pick, side="right"), len(emitters.chance) - 1)
    return row, emitters.chance[row]


@inline_kernel
def chance_of_emitter(normals, emitters, row, k, lane, p):
    """The chance with which choose_emitter finds a row where ray k of a lane starts.

    normals : Paths.normals
    """
    if normals is not None:
        point, normal = xyz(p, embree.ORIGIN_X, lane), (normals[k, 0], normals[k, 1], normals[k, 2])
        return chance_of_light(emitters.tree, row, point, normal, p)
    return emitters.chance[row]


@inline_kernel
def way_to_emitter(emitters, surfaces, materials, lane, work):
    """A point on an emitting triangle: the way to it from a lane's hit, its emission, RGB, the direction's density, 0
    where the point is seen from its edge, and where along the way its shadow ray ends.
    """
    p = work.packet
    u, v = p[rows.POINT_U + lane], p[rows.POINT_V + lane]
    row, chance = choose_emitter(emitters.tree, emitters, lane, p)
    instance = emitters.instance[row]
    corners = corners_of_triangle(surfaces, instance, np.uint32(row - emitters.first[instance]))
    a, e, f, normal = spanned(surfaces, instance, corners)
    root = math.sqrt(u)
    s, t = root * (ONE - v), root * v
    px, py, pz = xyz(p, rows.POSITION_X, lane)
    dx, dy, dz = a[0] + s * e[0] + t * f[0] - px, a[1] + s * e[1] + t * f[1] - py, a[2] + s * e[2] + t * f[2] - pz
    square = dx * dx + dy * dy + dz * dz
    material = materials.rows[surfaces.meshes.mesh_table[instance, MATERIAL_ROW]]
    facing = -HALF * (normal[0] * dx + normal[1] * dy + normal[2] * dz)  # area times cosine times distance
    placed = determinant_of(surfaces.meshes.eye_from_object[instance])
    facing = facing if placed > ZERO else -facing  # mirrored: corners turn
    facing = abs(facing) if material["emits_behind"] > ZERO else facing
    density = chance * square * math.sqrt(square) / facing if facing > ZERO else ZERO
    emission = emission_at(materials.emission_textures, surfaces, materials, instance, corners, s, t)
    return (dx, dy, dz), emission, density, NEARLY


@inline_kernel
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


@inline_kernel
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
