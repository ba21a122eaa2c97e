"""Primary rays: from positions on a panel to a packet of 16 rays."""

from __future__ import annotations

import math

from wall.core.jit import inline_kernel, lane_kernel
from wall.tracing import embree
from wall.tracing.kernels import rows
from wall.tracing.kernels.rows import set_xyz, xyz
from wall.tracing.kernels.values import EVERY_OBJECT_MASK, INF, MISS, ONE, ZERO


@inline_kernel
def make_rays(camera, xy, first, count, work):
    """Fills the packet with primary rays from the eye through `count` positions (panel pixels) from `first` on.

    Directions are computed in float64, so that a panel's rays are those of the whole wall, then made unit in float32.
    """
    p = work.packet
    frame = camera.frame
    x0, y0 = camera.corner[0], camera.corner[1]
    ax, ay, az = frame[0, 0], frame[0, 1], frame[0, 2]
    bx, by, bz = frame[1, 0], frame[1, 1], frame[1, 2]
    cx, cy, cz = frame[2, 0], frame[2, 1], frame[2, 2]
    for lane in range(16):
        k = first + min(lane, count - 1)
        x = x0 + xy[k, 0]
        y = y0 + xy[k, 1]
        set_xyz(p, embree.DIRECTION_X, lane, ax + x * bx + y * cx, ay + x * by + y * cy, az + x * bz + y * cz)
    for lane in range(16):
        dx, dy, dz = xyz(p, embree.DIRECTION_X, lane)
        scale = ONE / math.sqrt(dx * dx + dy * dy + dz * dz)
        set_xyz(p, embree.DIRECTION_X, lane, dx * scale, dy * scale, dz * scale)
        set_xyz(p, embree.ORIGIN_X, lane, ZERO, ZERO, ZERO)
    open_rays(count, True, work)


@lane_kernel
def open_rays(count, primary, work):
    """Has the first `count` rays of the packet go on for ever, and hit nothing yet; `primary`: those from the eye."""
    p, bits = work.packet, work.bits
    for lane in range(16):
        p[embree.T_FAR + lane] = INF
        bits[embree.MASK + lane] = bits[rows.PRIMARY_MASK + lane] if primary else EVERY_OBJECT_MASK
        bits[embree.GEOMETRY + lane] = MISS
        bits[embree.INSTANCE + lane] = MISS
        work.valid[lane] = -1 if lane < count else 0
