"""Rays through one tree of instances or two: closest hits, and whether anything is in the way."""

from __future__ import annotations

from wall.core.jit import inline_kernel
from wall.tracing.embree import INSTANCE, PACKET, intersect16, occluded16
from wall.tracing.kernels.rows import SHADOW_PACKET
from wall.tracing.kernels.values import MISS


@inline_kernel
def closest_hits(trees, work):
    """Finds the nearest hits of the packet's valid lanes."""
    rays = work.packet.ctypes.data
    intersect16(work.valid.ctypes.data, trees.at_rest, rays, work.arguments.ctypes.data)
    if trees.moving == 0:
        return
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
    rays = p.ctypes.data + p.itemsize * SHADOW_PACKET
    occluded16(valid.ctypes.data, trees.at_rest, rays, work.arguments.ctypes.data)
    if trees.moving != 0:
        occluded16(valid.ctypes.data, trees.moving, rays, work.arguments.ctypes.data)
