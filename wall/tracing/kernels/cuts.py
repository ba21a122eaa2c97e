"""Planes that cut the scene open, see scene.cuts: rays keep the one piece that all planes leave of them."""

from __future__ import annotations

import numpy as np

from wall.core.jit import lane_kernel
from wall.scene import cuts as scene_cuts
from wall.tracing import embree
from wall.tracing.kernels.rows import xyz
from wall.tracing.kernels.values import INF, MISS, ZERO

SLACK = np.float32(scene_cuts.SLACK)


@lane_kernel
def shorten_rays(cuts, first, work):
    """Sets where a packet's rays begin, and where they end if that is sooner; None does nothing.

    A ray of which nothing is left begins behind its end, 0 or more: it hits nothing, and counts as one that misses.

    cuts : Trees.cuts; first : offset of the packet's rows: 0, or SHADOW_PACKET
    """
    if cuts is not None:
        p = work.packet
        for lane in range(16):
            p[first + embree.T_NEAR + lane] = ZERO
        for k in range(cuts.shape[0]):
            nx, ny, nz = cuts[k, 0], cuts[k, 1], cuts[k, 2]
            distance = cuts[k, 3] + SLACK * abs(cuts[k, 3])
            for lane in range(16):
                ox, oy, oz = xyz(p, first + embree.ORIGIN_X, lane)
                dx, dy, dz = xyz(p, first + embree.DIRECTION_X, lane)
                rise = nx * dx + ny * dy + nz * dz - SLACK * (abs(dx) + abs(dy) + abs(dz))
                room = distance - (nx * ox + ny * oy + nz * oz) + SLACK * (abs(ox) + abs(oy) + abs(oz))
                way = room / rise
                begin, end = p[first + embree.T_NEAR + lane], p[first + embree.T_FAR + lane]
                outside = (rise == ZERO) & (room < ZERO)
                p[first + embree.T_NEAR + lane] = INF if outside else (max(begin, way) if rise < ZERO else begin)
                p[first + embree.T_FAR + lane] = min(end, max(way, ZERO)) if rise > ZERO else end


@lane_kernel
def reopen_misses(cuts, work):
    """Lets the rays of an intersected packet that hit nothing go on for ever; None does nothing."""
    if cuts is not None:
        p, bits = work.packet, work.bits
        for lane in range(16):
            missed = bits[embree.GEOMETRY + lane] == MISS
            p[embree.T_FAR + lane] = INF if missed else p[embree.T_FAR + lane]


@lane_kernel
def way_left(cuts, lane, p):
    """How long the piece of a lane's ray is from where cuts let it begin to its hit; None: the whole ray."""
    if cuts is not None:
        return p[embree.T_FAR + lane] - p[embree.T_NEAR + lane]
    return p[embree.T_FAR + lane]


@lane_kernel
def is_cut_away(cuts, x, y, z):
    """Whether a point relative to the eye is beyond any of (k, 4) planes."""
    beyond = False
    for k in range(cuts.shape[0]):
        room = cuts[k, 3] - (cuts[k, 0] * x + cuts[k, 1] * y + cuts[k, 2] * z)
        beyond |= room + SLACK * (abs(cuts[k, 3]) + abs(x) + abs(y) + abs(z)) < ZERO
    return beyond
