"""The limit that tracing is held against: Embree's queries on packets made beforehand, and nothing else."""

from __future__ import annotations

from wall.core.jit import kernel
from wall.tracing.embree import intersect16, occluded16


@kernel
def bare_queries(scene, hits, valid, shadows, lit, ends, arguments):
    """Trace prepared packets, each primary one followed by its own shadow packets, as in tracing.

    Parameters
    ----------
    scene : int, committed Embree scene
    hits : (n, 352) float32, 64-byte aligned ray-hit packets, written by Embree; valid : (16,) int32, aligned
    shadows : (m, 192) float32, aligned ray packets, written by Embree; lit : (m, 16) int32, aligned
    ends : (n,) int64, how many shadow packets belong to primary packets 0..k
    arguments : (16,) uint32, RTCIntersectArguments

    Returns
    -------
    packets : int, n + m
    """
    done = 0
    for k in range(hits.shape[0]):
        intersect16(valid.ctypes.data, scene, hits[k].ctypes.data, arguments.ctypes.data)
        while done < ends[k]:
            occluded16(lit[done].ctypes.data, scene, shadows[done].ctypes.data, arguments.ctypes.data)
            done += 1
    return hits.shape[0] + done


@kernel
def bare_recording(scene, packets, valid, shadow, flags, arguments):
    """Ask Embree what was recorded, in order.

    Parameters
    ----------
    scene : int, committed Embree scene
    packets, valid, shadow, flags : a Recording's, of n queries; packets are written by Embree
    arguments : (16,) uint32, RTCIntersectArguments, whose flags are left as those of the last query

    Returns
    -------
    packets : int, n
    """
    for k in range(packets.shape[0]):
        arguments[0] = flags[k]
        if shadow[k]:
            occluded16(valid[k].ctypes.data, scene, packets[k].ctypes.data, arguments.ctypes.data)
        else:
            intersect16(valid[k].ctypes.data, scene, packets[k].ctypes.data, arguments.ctypes.data)
    return packets.shape[0]
