"""The limit that tracing is held against: Embree's queries on packets made beforehand, and nothing else."""

from __future__ import annotations

from wall.jit import kernel
from wall.tracing.embree import intersect16, occluded16


@kernel
def bare_queries(scene, hits, valid, shadows, lit, arguments):
    """Trace prepared packets.

    hits : (n, 352) float32, 64-byte aligned ray-hit packets; valid : (16,) int32; shadows : (m, 192) float32, aligned
    ray packets; lit : (m, 16) int32, aligned; arguments : (16,) uint32. Shadow packets follow their primary packets
    evenly, as in tracing, so that memory is touched in the same order.
    """
    n, m = hits.shape[0], shadows.shape[0]
    done = 0
    for k in range(n):
        intersect16(valid.ctypes.data, scene, hits[k].ctypes.data, arguments.ctypes.data)
        until = (k + 1) * m // n
        while done < until:
            occluded16(lit[done].ctypes.data, scene, shadows[done].ctypes.data, arguments.ctypes.data)
            done += 1
    return n + m
