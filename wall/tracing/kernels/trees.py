"""Rays through one tree of instances or two: closest hits, and whether anything is in the way."""

from __future__ import annotations

import numpy as np

from wall.core.jit import inline_kernel
from wall.tracing.embree import (
    DIRECTION_X,
    INSTANCE,
    PACKET,
    RAY_FLOATS,
    RAY_HIT_FLOATS,
    intersect16,
    occluded16,
)
from wall.tracing.kernels.rows import SHADOW_PACKET
from wall.tracing.kernels.values import MISS

INCOHERENT = np.uint32(0)  # a query's flags
ALMOST_ZERO = np.float32(1e-6)  # components of directions, which are unit vectors or ways to lights


@inline_kernel
def begin_query(work):
    """Takes the mark of a coherent packet from rays along a plane of two axes, or to both sides of it.

    Embree loses some of such rays where it walks its tree with a whole packet. Returns the flags to set again.
    """
    flags = work.arguments[0]
    if flags != INCOHERENT:
        for row in range(DIRECTION_X, DIRECTION_X + 3 * PACKET, PACKET):
            low, high = work.packet[row], work.packet[row]
            for lane in range(PACKET):
                low, high = min(low, work.packet[row + lane]), max(high, work.packet[row + lane])
            if low <= ALMOST_ZERO and high >= -ALMOST_ZERO:
                work.arguments[0] = INCOHERENT
    return flags


@inline_kernel
def record_query(recording, shadow, valid, first, work):
    """Writes down what Embree is about to be asked, while there is room; recording = None does nothing.

    shadow : bool, see Recording; valid : (16,) int32, of the rays' packet, which begins at `first`
    """
    if recording is not None:
        k = recording.asked[0]
        recording.asked[0] = k + 1
        if k < recording.packets.shape[0]:
            recording.shadow[k], recording.flags[k] = shadow, work.arguments[0]
            for lane in range(PACKET):
                recording.valid[k, lane] = valid[lane]
            for row in range(RAY_FLOATS if shadow else RAY_HIT_FLOATS):
                recording.packets[k, row] = work.bits[first + row]


@inline_kernel
def closest_hits(trees, work):
    """Finds the nearest hits of the packet's valid lanes."""
    rays, flags = work.packet.ctypes.data, begin_query(work)
    record_query(trees.recording, False, work.valid, 0, work)
    intersect16(work.valid.ctypes.data, trees.at_rest, rays, work.arguments.ctypes.data)
    if trees.moving != 0:
        closer_hits_of_moving(trees, rays, work)
    work.arguments[0] = flags


@inline_kernel
def closer_hits_of_moving(trees, rays, work):
    """Finds what moves and is nearer than the hits so far. rays : int, address of the packet"""
    bits, before = work.bits, work.hit_before
    for lane in range(PACKET):
        before[lane] = bits[INSTANCE + lane]
        bits[INSTANCE + lane] = MISS
    intersect16(work.valid.ctypes.data, trees.moving, rays, work.arguments.ctypes.data)
    for lane in range(PACKET):
        found = bits[INSTANCE + lane]
        bits[INSTANCE + lane] = before[lane] if found == MISS else trees.objects[found]


@inline_kernel
def any_hits(trees, work):
    """Sets T_FAR of the shadow packet's valid lanes to -inf where something is in the way."""
    p, valid = work.packet, work.shadow_valid
    rays, flags = p.ctypes.data + p.itemsize * SHADOW_PACKET, work.arguments[0]
    work.arguments[0] = INCOHERENT  # is faster, of whatever rays
    record_query(trees.recording, True, valid, SHADOW_PACKET, work)
    occluded16(valid.ctypes.data, trees.at_rest, rays, work.arguments.ctypes.data)
    if trees.moving != 0:
        occluded16(valid.ctypes.data, trees.moving, rays, work.arguments.ctypes.data)
    work.arguments[0] = flags
