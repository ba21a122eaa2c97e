"""Rays from smooth surfaces start where the smooth surface would be, so that flat triangles do not shadow it.

A mesh with normals at its vertices looks round and is flat: light that comes in above the horizon of the normal may
come in below the triangle, or below its neighbours. So a ray that leaves flat along its triangle starts higher: on a
curved patch over the triangle that meets the planes through its corners across their normals. Where the surface is
flat or hollow the patch lies in or below the triangle, and nothing is raised. J. Hanika, "Hacking the Shadow
Terminator", Ray Tracing Gems II, 2021. Rays that leave steeply start at the triangle, so that what touches a coarse
mesh keeps its shadow.
"""

from __future__ import annotations

import math

import numpy as np

from wall.core.jit import lane_kernel
from wall.tracing import embree
from wall.tracing.kernels import rows
from wall.tracing.kernels.rows import set_xyz, xyz
from wall.tracing.kernels.surface import NORMALS_FLAG, corners_of, weights_of
from wall.tracing.kernels.values import MESH_FLAGS, ONE, ZERO

STEEP = np.float32(0.1)  # cosine to the geometric normal from which on rays start at the triangle: 84 degrees
TINY = np.float32(1e-30)


@lane_kernel
def find_raises(normals, vertices, meshes, work):
    """Fills the rows RAISE_X, _Y, _Z of a packet's hits: from the triangle to the curved patch over it, world units.

    normals, vertices : of Surfaces; no normals: None does nothing. Shading normals are still those of vertices.
    """
    if normals is not None:
        p, bits = work.packet, work.bits
        for lane in range(16):
            set_xyz(p, rows.RAISE_X, lane, ZERO, ZERO, ZERO)
            if p[rows.HIT + lane] == ZERO:
                continue
            instance = bits[embree.INSTANCE + lane]
            if meshes.mesh_table[instance, MESH_FLAGS] & NORMALS_FLAG:
                x, y, z = raise_in_object(normals, vertices, meshes, lane, work)
                m = meshes.eye_from_object[instance]
                rx, ry = m[0] * x + m[1] * y + m[2] * z, m[4] * x + m[5] * y + m[6] * z
                set_xyz(p, rows.RAISE_X, lane, rx, ry, m[8] * x + m[9] * y + m[10] * z)


@lane_kernel
def raise_in_object(normals, vertices, meshes, lane, work):
    """The way from a lane's hit to the patch, in object space: to each corner's plane, by the corner's weight.

    A patch that is stretched touches stretched planes, so no corner's normal has to be brought to the world.
    """
    (i0, i1, i2), (w, u, v) = corners_of(meshes, lane, work), weights_of(lane, work)
    n0, n1, n2 = normals[i0], normals[i1], normals[i2]
    v0, v1, v2 = vertices[i0], vertices[i1], vertices[i2]
    ex, ey, ez = v1[0] - v0[0], v1[1] - v0[1], v1[2] - v0[2]
    fx, fy, fz = v2[0] - v0[0], v2[1] - v0[1], v2[2] - v0[2]
    x, y, z = u * ex + v * fx, u * ey + v * fy, u * ez + v * fz  # from corner 0 to the hit
    m = meshes.placements[work.bits[embree.INSTANCE + lane]]
    nx = w * n0[0] + u * n1[0] + v * n2[0]
    ny = w * n0[1] + u * n1[1] + v * n2[1]
    nz = w * n0[2] + u * n1[2] + v * n2[2]
    sx, sy, sz = xyz(work.packet, rows.SHADING_NORMAL_X, lane)
    turned = sx * (m[0] * nx + m[1] * ny + m[2] * nz) + sy * (m[3] * nx + m[4] * ny + m[5] * nz)
    turned += sz * (m[6] * nx + m[7] * ny + m[8] * nz)
    side = ONE if turned > ZERO else -ONE  # seen from behind, the round side is the hollow one
    a = w * max(-side * (x * n0[0] + y * n0[1] + z * n0[2]), ZERO) * side
    b = u * max(-side * ((x - ex) * n1[0] + (y - ey) * n1[1] + (z - ez) * n1[2]), ZERO) * side
    c = v * max(-side * ((x - fx) * n2[0] + (y - fy) * n2[1] + (z - fz) * n2[2]), ZERO) * side
    return (
        a * n0[0] + b * n1[0] + c * n2[0],
        a * n0[1] + b * n1[1] + c * n2[1],
        a * n0[2] + b * n1[2] + c * n2[2],
    )


@lane_kernel
def facing(rounded, cosine, side, lane, p):
    """Above 0 where a lane's surface faces a direction: its normals do, or the smooth one alone where it is raised.

    rounded : Scattering.rounded
    cosine, side : of the direction to the shading and to the geometric normal, at any scale
    """
    if rounded is None:
        return min(cosine, side)
    x, y, z = xyz(p, rows.RAISE_X, lane)
    return min(cosine, max(side, abs(x) + abs(y) + abs(z)))


@lane_kernel
def raise_towards(dx, dy, dz, lane, p):
    """How a ray that leaves a lane's hit in a direction of any length is raised: RAISE, less the steeper it leaves."""
    gx, gy, gz = xyz(p, rows.GEOMETRIC_NORMAL_X, lane)
    steep = STEEP * math.sqrt(dx * dx + dy * dy + dz * dz)
    side = gx * dx + gy * dy + gz * dz
    share = min(max(steep - side, ZERO), steep) / max(steep, TINY)
    x, y, z = xyz(p, rows.RAISE_X, lane)
    return share * x, share * y, share * z
