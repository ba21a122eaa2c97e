"""What textures do to a surface: they colour it, roughen it, make it shine and turn its normals."""

from __future__ import annotations

import math

import numpy as np

from wall.core.jit import inline_kernel
from wall.tracing.kernels import rows
from wall.tracing.kernels.rows import set_xyz, xyz
from wall.tracing.kernels.surface import material_of, seen_from_inside
from wall.tracing.kernels.texture_filter import filtered_texel, gather_mappings, measure_footprints, project_footprints
from wall.tracing.kernels.values import BASE_COLOR, EMISSION, INF, METALLIC_ROUGHNESS, NORMAL, ONE, ZERO

TWO = np.float32(2.0)


@inline_kernel
def apply_textures(surfaces, materials, uvs, work):
    """Applies the textures of what a packet hit, at texture coordinates uvs (v, 2): albedo, emission, metalness,
    roughness and shading normals. None does nothing."""
    meshes, table, rough = surfaces.meshes, materials.rows, materials.scattering.metallic_roughness_textures
    copy_emission(materials.emission_textures, table, work)
    copy_roughness(rough, table, work)
    if uvs is not None:
        if gather_mappings(meshes, surfaces.vertices, uvs, table, work) == 0:
            return
        project_footprints(work)
        colour_by_textures(uvs, BASE_COLOR, rows.ALBEDO_R, meshes, uvs, table, materials.textures, work)
        colour_by_textures(
            materials.emission_textures, EMISSION, rows.EMISSION_R, meshes, uvs, table, materials.textures, work
        )
        roughen_by_textures(rough, meshes, uvs, table, materials.textures, work)
        turn_by_textures(materials.normal_textures, meshes, uvs, table, materials.textures, work)


@inline_kernel
def colour_by_textures(used, slot, row, meshes, uvs, table, textures, work):
    """Multiplies the colours from `row` on by textures, BASE_COLOR or EMISSION; used = None does nothing."""
    if used is not None:
        p = work.packet
        measure_footprints(slot, meshes, uvs, table, textures, work)
        for lane in range(16):
            if p[rows.TEXELS_U + lane] != ZERO:
                r, g, b = filtered_texel(slot, textures.linear_of_srgb, table, textures, lane, work)
                p[row + lane] *= r
                p[row + 16 + lane] *= g
                p[row + 32 + lane] *= b


@inline_kernel
def copy_emission(used, table, work):
    """Sets EMISSION_R, _G, _B to the materials' own, of `table` (k,) MATERIAL; used = None does nothing."""
    if used is not None:
        for lane in range(16):
            if work.packet[rows.HIT + lane] != ZERO:
                r, g, b = material_of(table, lane, work)["emission"]
                set_xyz(work.packet, rows.EMISSION_R, lane, r, g, b)


@inline_kernel
def copy_roughness(used, table, work):
    """Sets METALLIC and ROUGHNESS to the materials' own, of `table` (k,) MATERIAL; used = None does nothing."""
    if used is not None:
        p = work.packet
        for lane in range(16):
            if p[rows.HIT + lane] != ZERO:
                material = material_of(table, lane, work)
                p[rows.METALLIC + lane], p[rows.ROUGHNESS + lane] = material["metallic"], material["roughness"]


@inline_kernel
def roughen_by_textures(used, meshes, uvs, table, textures, work):
    """Multiplies roughness by green and metalness by blue of their textures; used = None does nothing."""
    if used is not None:
        p = work.packet
        measure_footprints(METALLIC_ROUGHNESS, meshes, uvs, table, textures, work)
        for lane in range(16):
            if p[rows.TEXELS_U + lane] != ZERO:
                _, g, b = filtered_texel(METALLIC_ROUGHNESS, textures.value_of_byte, table, textures, lane, work)
                p[rows.ROUGHNESS + lane] *= g
                p[rows.METALLIC + lane] *= b


@inline_kernel
def turn_by_textures(used, meshes, uvs, table, textures, work):
    """Turns shading normals by normal textures; used = None does nothing.

    The tangent is the direction on the triangle in which u grows, made perpendicular to the shading normal. Where a
    triangle has no extent in the texture the normal stays.
    """
    if used is not None:
        p = work.packet
        measure_footprints(NORMAL, meshes, uvs, table, textures, work)
        for lane in range(16):
            if p[rows.TEXELS_U + lane] == ZERO:
                continue
            x, y, z = filtered_texel(NORMAL, textures.value_of_byte, table, textures, lane, work)
            scale = material_of(table, lane, work)["normal_scale"]
            inside = seen_from_inside(meshes.placements, lane, work)
            scale = -scale if inside else scale  # the other side's bumps are dents
            x, y, z = scale * (TWO * x - ONE), scale * (TWO * y - ONE), TWO * z - ONE
            ex, ey, ez = xyz(p, rows.EDGE_1_X, lane)
            fx, fy, fz = xyz(p, rows.EDGE_2_X, lane)
            _, u1, u2 = xyz(p, rows.MAPPING_U0, lane)
            _, v1, v2 = xyz(p, rows.MAPPING_V0, lane)
            nx, ny, nz = xyz(p, rows.SHADING_NORMAL_X, lane)
            turned = ONE if u1 * v2 - u2 * v1 > ZERO else -ONE
            tx, ty, tz = turned * (v2 * ex - v1 * fx), turned * (v2 * ey - v1 * fy), turned * (v2 * ez - v1 * fz)
            bx, by, bz = turned * (u1 * fx - u2 * ex), turned * (u1 * fy - u2 * ey), turned * (u1 * fz - u2 * ez)
            off = tx * nx + ty * ny + tz * nz
            tx, ty, tz = tx - off * nx, ty - off * ny, tz - off * nz
            cx, cy, cz = ny * tz - nz * ty, nz * tx - nx * tz, nx * ty - ny * tx
            side = ONE if cx * bx + cy * by + cz * bz > ZERO else -ONE
            square = tx * tx + ty * ty + tz * tz
            size = ONE / math.sqrt(square) if square > ZERO else ZERO
            x, y = x * size, y * size * side
            nx, ny, nz = x * tx + y * cx + z * nx, x * ty + y * cy + z * ny, x * tz + y * cz + z * nz
            square = nx * nx + ny * ny + nz * nz
            size = ONE / math.sqrt(square)
            if size < INF:
                set_xyz(p, rows.SHADING_NORMAL_X, lane, size * nx, size * ny, size * nz)


@inline_kernel
def emission_of(used, table, lane, work):
    """What a lane's hit emits, RGB; used : Materials.emission_textures, table : (k,) MATERIAL."""
    if used is None:
        emission = material_of(table, lane, work)["emission"]
        return emission[0], emission[1], emission[2]
    return xyz(work.packet, rows.EMISSION_R, lane)


@inline_kernel
def roughness_of(used, material, lane, work):
    """Metalness and roughness of a lane's hit; used : Scattering.metallic_roughness_textures."""
    if used is None:
        return material["metallic"], material["roughness"]
    return work.packet[rows.METALLIC + lane], work.packet[rows.ROUGHNESS + lane]
