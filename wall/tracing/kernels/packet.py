"""What 16 rays need, laid out for vector code: the rows of a packet, and the arrays that kernels read.

Kernels see these numbers as constants, so this file belongs to what decides their compilation.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wall.core.data import Float32
from wall.tracing.embree import NO_HIT, RAY_FLOATS, RAY_HIT_FLOATS

INF = np.float32(np.inf)
ZERO, ONE = np.float32(0.0), np.float32(1.0)
MISS = np.uint32(NO_HIT)
INV_PI = np.float32(1.0 / math.pi)
MAX_BOUNCES = 4  # mirror chains are cut here; what is behind the last mirror is dropped

# One flat array holds everything about 16 rays, one row of 16 floats a quantity, so that LLVM sees constant
# distances between rows and turns the loops over lanes into vector code. Rows start at these offsets:
# the ray-hit packet at 0 (see embree.py), the shadow packet, then scratch.
SHADE = RAY_HIT_FLOATS
PX, PY, PZ, NX, NY, NZ, GX, GY, GZ, LIFT = range(SHADE + RAY_FLOATS, SHADE + RAY_FLOATS + 160, 16)
AR, AG, AB, LR, LG, LB, TR, TG, TB, MIRROR, COS, DEPTH, OBJECT, HITS = range(LIFT + 16, LIFT + 240, 16)
LIFT_BASE, LIFT_SLOPE, LIFT_STRETCH, LIGHT, SEES = range(HITS + 16, HITS + 96, 16)
LIGHT_VISIBILITY, NORMAL_CODE, SAMPLE_VISIBILITY = range(SEES + 16, SEES + 64, 16)
PACKET_FLOATS = SAMPLE_VISIBILITY + 16
SEEN, UNSEEN = 1, 2  # Embree masks of objects that primary rays may hit, and of those that only light and mirrors know
ALL = 0xFFFFFFFF
ALL_LIGHTS = np.uint32(0xFFFFFFFF)  # light visibility mask where nothing is hidden
NO_NORMAL = np.uint32(0x8080)  # code of the normal (0, 0), two bytes offset by 128: of the sky and of mirrors

# counts that a kernel returns
PRIMARY, SHADOW, SECONDARY, BAD = range(4)
COUNTS = 4


class Workspace(NamedTuple):
    """One thread's packet, 64-byte aligned; see workspace() in tracer.py, which sets the rows that never change."""

    packet: Float32  # (PACKET_FLOATS,)
    bits: NDArray[np.uint32]  # the same memory
    valid: NDArray[np.int32]  # (16,) -1 or 0, lanes of the ray-hit packet
    lit: NDArray[np.int32]  # (16,) -1 or 0, lanes of the shadow packet
    arguments: NDArray[np.uint32]  # RTCIntersectArguments
    counts: NDArray[np.int64]  # (4,) rays by kind


class Surfaces(NamedTuple):
    """What every scene has; meshes stand one after another in the vertex and triangle arrays."""

    triangles: NDArray[np.uint32]  # (t, 3) vertex numbers within the mesh
    mesh_table: NDArray[np.uint32]  # (n, 4) of each instance: first triangle, first vertex, material,
    # flags: 1 normals, 2 colours, 4 uvs
    materials: Float32  # (k, 8) base colour, mirror share, emission, 0
    placements: Float32  # (n, 12) normal_from_object (9, row major), lift: base, slope, stretched slope
    sky: Float32  # (3, 3) radiance of zenith, horizon, ground
    irradiance: Float32  # (257, 3) sky irradiance over pi, by height of the normal
