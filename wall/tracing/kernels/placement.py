"""Places instances relative to the eye, in Embree and in the table of normals and ray offsets."""

from __future__ import annotations

import math

import numpy as np

from wall.core.jit import kernel
from wall.tracing.embree import FORMAT_FLOAT3X4_ROW_MAJOR, commit_geometry, set_transform
from wall.tracing.kernels.values import PLACEMENT_BASE, PLACEMENT_SLOPE, PLACEMENT_STRETCH

HALF_ULP = 2.0**-24  # largest relative error of one float32 rounding


@kernel
def place_instances(
    world_from_object, eye, moved, geometries, transforms, placements, extents, scales, singular, ulps
):
    """Places instances relative to the eye; the trees that they are in are to be committed then.

    Parameters
    ----------
    world_from_object : (n, 4, 4) float64
    eye : (3,) float64, world
    moved : (m,) intp, the instances to place
    geometries : (n,) intp, Embree handles
    transforms : (n, 12) float32, row major 3x4 eye_from_object, written
    placements : (n, 12) float32, written; see Surfaces
    extents : (n,) float64, mesh radius in object space
    scales : (n,) float64, about the eye; see coplanar.depth_scales
    singular : (n,) bool, written: the matrix has no inverse, so that normals are left unrotated
    ulps : float, how many float32 roundings a secondary ray's start is off the surface; see surface.finish_surfaces
    """
    for k in moved:
        m, s = world_from_object[k], scales[k]
        a, b, c = s * m[0, 0], s * m[0, 1], s * m[0, 2]
        d, e, f = s * m[1, 0], s * m[1, 1], s * m[1, 2]
        g, h, i = s * m[2, 0], s * m[2, 1], s * m[2, 2]
        x, y, z = s * (m[0, 3] - eye[0]), s * (m[1, 3] - eye[1]), s * (m[2, 3] - eye[2])
        row = transforms[k]
        row[0], row[1], row[2], row[3] = a, b, c, x
        row[4], row[5], row[6], row[7] = d, e, f, y
        row[8], row[9], row[10], row[11] = g, h, i, z
        # the cofactor matrix is the inverse transpose times the determinant; the sign keeps mirrored instances right
        c0, c1, c2 = e * i - f * h, f * g - d * i, d * h - e * g
        determinant = a * c0 + b * c1 + c * c2
        size = math.sqrt(a * a + b * b + c * c + d * d + e * e + f * f + g * g + h * h + i * i)
        singular[k] = determinant == 0.0
        if singular[k]:
            scale = 1.0
            placements[k, 0:9] = 0.0
            placements[k, 0] = placements[k, 4] = placements[k, 8] = 1.0
        else:
            scale = 1.0 / determinant * size
            placements[k, 0], placements[k, 1], placements[k, 2] = c0 * scale, c1 * scale, c2 * scale
            placements[k, 3], placements[k, 4], placements[k, 5] = (
                (c * h - b * i) * scale,
                (a * i - c * g) * scale,
                (b * g - a * h) * scale,
            )
            placements[k, 6], placements[k, 7], placements[k, 8] = (
                (b * f - c * e) * scale,
                (c * d - a * f) * scale,
                (a * e - b * d) * scale,
            )
        norm = 0.0
        for q in range(9):
            norm += float(placements[k, q]) ** 2
        # condition number of the 3x3 part in the Frobenius norm over 3: 1 for rotation and uniform scale
        condition = max(1.0, math.sqrt(norm) / 3.0)
        root = math.sqrt(3.0)
        placements[k, PLACEMENT_BASE] = (
            root * ulps * HALF_ULP * (condition * (abs(x) + abs(y) + abs(z)) + extents[k] * size)
        )
        placements[k, PLACEMENT_SLOPE] = ulps * HALF_ULP
        placements[k, PLACEMENT_STRETCH] = root * ulps * HALF_ULP * condition
        set_transform(geometries[k], np.uint32(0), np.int32(FORMAT_FLOAT3X4_ROW_MAJOR), transforms.ctypes.data + 48 * k)
        commit_geometry(geometries[k])
