"""What a packet's rays hit: positions, normals, albedo and the offset of secondary rays."""

from __future__ import annotations

import math

import numpy as np

from wall.core.jit import lane_kernel
from wall.tracing import embree
from wall.tracing.kernels import rows
from wall.tracing.kernels.rows import set_xyz, xyz
from wall.tracing.kernels.values import (
    FIRST_SEGMENT,
    FIRST_SPHERE,
    FIRST_TRIANGLE,
    FIRST_VERTEX,
    HAS_COLORS,
    HAS_NORMALS,
    HAS_POINT_COLORS,
    HAS_SEGMENTS,
    MATERIAL_ROW,
    MESH_FLAGS,
    MISS,
    ONE,
    PLACEMENT_BASE,
    PLACEMENT_SLOPE,
    PLACEMENT_STRETCH,
    ZERO,
)

NORMALS_FLAG, COLORS_FLAG = np.uint32(HAS_NORMALS), np.uint32(HAS_COLORS)
POINT_COLORS_FLAG, SEGMENTS_FLAG = np.uint32(HAS_POINT_COLORS), np.uint32(HAS_SEGMENTS)


@lane_kernel
def material_of(table, lane, work):
    """The record in `table` (k,) MATERIAL of what a lane hit; only where it hit something."""
    return table[work.bits[rows.MATERIAL + lane]]


@lane_kernel
def corners_of(meshes, lane, work):
    """The three vertex numbers of the triangle that a lane hit."""
    mesh = meshes.mesh_table[work.bits[embree.INSTANCE + lane]]
    triangle = meshes.triangles[mesh[FIRST_TRIANGLE] + work.bits[embree.PRIMITIVE + lane]]
    first = mesh[FIRST_VERTEX]
    return first + triangle[0], first + triangle[1], first + triangle[2]


@lane_kernel
def weights_of(lane, work):
    """Barycentric weights of a lane's hit, in the order of its triangle's vertices."""
    u, v = work.packet[embree.HIT_U + lane], work.packet[embree.HIT_V + lane]
    return ONE - u - v, u, v


@lane_kernel
def gather_surfaces(meshes, normals, table, work):
    """Looks up what every lane hit: normals (any length, any side), material, base colour, parts of the ray offset.

    normals : (v, 3) float32 | None; table : (k,) MATERIAL. Returns the number of hits.
    """
    p, bits = work.packet, work.bits
    hits = 0
    for lane in range(16):
        if work.valid[lane] == 0 or bits[embree.GEOMETRY + lane] == MISS:
            p[rows.HIT + lane] = ZERO
            set_xyz(p, rows.GEOMETRIC_NORMAL_X, lane, ONE, ONE, ONE)
            set_xyz(p, rows.SHADING_NORMAL_X, lane, ONE, ONE, ONE)
            set_xyz(p, rows.ALBEDO_R, lane, ZERO, ZERO, ZERO)  # not what the lane hit before, which may be no number
            continue
        hits += 1
        p[rows.HIT + lane] = ONE
        instance = bits[embree.INSTANCE + lane]
        m = meshes.placements[instance]
        a, b, c, d, e, f, g, h, i = m[0], m[1], m[2], m[3], m[4], m[5], m[6], m[7], m[8]
        x, y, z = xyz(p, embree.NORMAL_X, lane)
        size = ONE / max(abs(x), abs(y), abs(z))  # Embree's normal is twice the area: its square would leave float32
        x, y, z = x * size, y * size, z * size
        set_xyz(p, embree.NORMAL_X, lane, x, y, z)
        set_xyz(p, rows.GEOMETRIC_NORMAL_X, lane, a * x + b * y + c * z, d * x + e * y + f * z, g * x + h * y + i * z)
        if normals is not None:  # noqa: SIM102  (numba leaves a branch out only for a bare test for None)
            if meshes.mesh_table[instance, MESH_FLAGS] & NORMALS_FLAG:
                i0, i1, i2 = corners_of(meshes, lane, work)
                w, u, v = weights_of(lane, work)
                x = w * normals[i0, 0] + u * normals[i1, 0] + v * normals[i2, 0]
                y = w * normals[i0, 1] + u * normals[i1, 1] + v * normals[i2, 1]
                z = w * normals[i0, 2] + u * normals[i1, 2] + v * normals[i2, 2]
        set_xyz(p, rows.SHADING_NORMAL_X, lane, a * x + b * y + c * z, d * x + e * y + f * z, g * x + h * y + i * z)
        set_xyz(p, rows.OFFSET_BASE, lane, m[PLACEMENT_BASE], m[PLACEMENT_SLOPE], m[PLACEMENT_STRETCH])
        bits[rows.MATERIAL + lane] = meshes.mesh_table[instance, MATERIAL_ROW]
        color = material_of(table, lane, work)["base_color"]
        set_xyz(p, rows.ALBEDO_R, lane, color[0], color[1], color[2])
    return hits


@lane_kernel
def finish_surfaces(work):
    """Positions, unit normals turned towards the ray, and the offset of secondary rays, for all lanes at once.

    The offset moves the start of a secondary ray along the geometric normal by more than the float32 error of the hit
    in that direction: u (W + q (R |M| + c (W + |T|))), with u = ulps * 2^-24, W = |O| + t |d| the ray's way to the hit
    O + t d (O is 0 but behind a mirror), M and T the instance's matrix and place, R its mesh's radius, c the condition
    of M. q is |N| / |M^-T N| / |M| for the object's normal N: 1 for rotations and uniform scales, small across the thin
    side of a flattened object, whose error is only as large as the object is thin.
    """
    p = work.packet
    for lane in range(16):
        t = p[embree.T_FAR + lane]
        dx, dy, dz = xyz(p, embree.DIRECTION_X, lane)
        ox, oy, oz = xyz(p, embree.ORIGIN_X, lane)
        set_xyz(p, rows.POSITION_X, lane, ox + t * dx, oy + t * dy, oz + t * dz)
        way = abs(ox) + abs(oy) + abs(oz) + t * (abs(dx) + abs(dy) + abs(dz))
        gx, gy, gz = xyz(p, rows.GEOMETRIC_NORMAL_X, lane)
        side = ONE / math.sqrt(gx * gx + gy * gy + gz * gz)
        ux, uy, uz = xyz(p, embree.NORMAL_X, lane)
        shrink = math.sqrt(ux * ux + uy * uy + uz * uz) * side
        base, slope, stretch = xyz(p, rows.OFFSET_BASE, lane)
        p[rows.RAY_OFFSET + lane] = slope * way + shrink * (base + stretch * way)
        side = -side if gx * dx + gy * dy + gz * dz > ZERO else side
        gx, gy, gz = gx * side, gy * side, gz * side
        set_xyz(p, rows.GEOMETRIC_NORMAL_X, lane, gx, gy, gz)
        nx, ny, nz = xyz(p, rows.SHADING_NORMAL_X, lane)
        square = nx * nx + ny * ny + nz * nz
        side = ONE / math.sqrt(square)
        side = -side if nx * gx + ny * gy + nz * gz < ZERO else side
        smooth = square > ZERO  # opposite vertex normals may cancel
        p[rows.SHADING_NORMAL_X + lane] = nx * side if smooth else gx
        p[rows.SHADING_NORMAL_Y + lane] = ny * side if smooth else gy
        p[rows.SHADING_NORMAL_Z + lane] = nz * side if smooth else gz


@lane_kernel
def colour_by_vertices(meshes, colors, work):
    """Multiplies albedo by vertex colours (v, 3) float32, where there are any; None does nothing."""
    if colors is not None:
        p, bits = work.packet, work.bits
        for lane in range(16):
            if p[rows.HIT + lane] == ZERO:
                continue
            if meshes.mesh_table[bits[embree.INSTANCE + lane], MESH_FLAGS] & COLORS_FLAG:
                i0, i1, i2 = corners_of(meshes, lane, work)
                w, u, v = weights_of(lane, work)
                p[rows.ALBEDO_R + lane] *= w * colors[i0, 0] + u * colors[i1, 0] + v * colors[i2, 0]
                p[rows.ALBEDO_G + lane] *= w * colors[i0, 1] + u * colors[i1, 1] + v * colors[i2, 1]
                p[rows.ALBEDO_B + lane] *= w * colors[i0, 2] + u * colors[i1, 2] + v * colors[i2, 2]


@lane_kernel
def colour_points(meshes, point_colors, segments, work):
    """Multiplies albedo by the colours (s, 3) float32 of spheres and curves, where there are any; None does nothing.

    segments : Surfaces.segments
    """
    if point_colors is not None:
        p, bits = work.packet, work.bits
        for lane in range(16):
            if p[rows.HIT + lane] == ZERO:
                continue
            mesh = meshes.mesh_table[bits[embree.INSTANCE + lane]]
            if segments is not None:  # noqa: SIM102  (see gather_surfaces)
                if mesh[MESH_FLAGS] & SEGMENTS_FLAG:
                    segment = np.int64(mesh[FIRST_SEGMENT]) + np.int64(bits[embree.PRIMITIVE + lane])
                    first = np.int64(mesh[FIRST_SPHERE]) + np.int64(segments[segment])
                    u = p[embree.HIT_U + lane]
                    for row in range(3):
                        color = (ONE - u) * point_colors[first, row] + u * point_colors[first + 1, row]
                        p[rows.ALBEDO_R + 16 * row + lane] *= color
                    continue
            if mesh[MESH_FLAGS] & POINT_COLORS_FLAG:
                color = point_colors[np.int64(mesh[FIRST_SPHERE]) + np.int64(bits[embree.PRIMITIVE + lane])]
                p[rows.ALBEDO_R + lane] *= color[0]
                p[rows.ALBEDO_G + lane] *= color[1]
                p[rows.ALBEDO_B + lane] *= color[2]


@lane_kernel
def seen_from_inside(placements, lane, work):
    """Whether a lane's ray came from behind: where the corners of the triangle it hit go clockwise, or in a sphere.

    placements : Meshes.placements
    """
    p, m = work.packet, placements[work.bits[embree.INSTANCE + lane]]
    x, y, z = xyz(p, embree.NORMAL_X, lane)
    gx, gy, gz = xyz(p, rows.GEOMETRIC_NORMAL_X, lane)
    turned = (m[0] * x + m[1] * y + m[2] * z) * gx + (m[3] * x + m[4] * y + m[5] * z) * gy
    return turned + (m[6] * x + m[7] * y + m[8] * z) * gz < ZERO
