"""Lambert's reflection, mirrored directions and where secondary rays start, for all integrators.

Paths scatter by scatter.py, opaque.py and glass.py. Under direct light, a lobe that is not diffuse needs a place
outside `Diffuse.of` (deepbuffer/lights.py), or it is relit as if it were diffuse.
"""

from __future__ import annotations

import numpy as np

from wall.core.jit import lane_kernel
from wall.tracing import embree
from wall.tracing.kernels import rows
from wall.tracing.kernels.rows import set_xyz, xyz
from wall.tracing.kernels.values import INV_PI, ZERO

TWO = np.float32(2.0)


@lane_kernel
def diffuse(cosine):
    """Lambert's BSDF of albedo 1 times the cosine between the shading normal and the direction to the light."""
    return cosine * INV_PI


@lane_kernel
def mirrored(p, lane):
    """A lane's direction mirrored at its hit: by the geometric normal where the shading normal would send it inside."""
    gx, gy, gz = xyz(p, rows.GEOMETRIC_NORMAL_X, lane)
    nx, ny, nz = xyz(p, rows.SHADING_NORMAL_X, lane)
    dx, dy, dz = xyz(p, embree.DIRECTION_X, lane)
    turn = TWO * (nx * dx + ny * dy + nz * dz)
    if (dx - turn * nx) * gx + (dy - turn * ny) * gy + (dz - turn * nz) * gz <= ZERO:
        nx, ny, nz = gx, gy, gz
        turn = TWO * (nx * dx + ny * dy + nz * dz)
    return dx - turn * nx, dy - turn * ny, dz - turn * nz


@lane_kernel
def start_off_surface(p, row, lane):
    """Writes the start of a lane's secondary ray to `row`: its hit, moved off the surface by the ray offset."""
    offset = p[rows.RAY_OFFSET + lane]
    px, py, pz = xyz(p, rows.POSITION_X, lane)
    gx, gy, gz = xyz(p, rows.GEOMETRIC_NORMAL_X, lane)
    set_xyz(p, row, lane, px + offset * gx, py + offset * gy, pz + offset * gz)
