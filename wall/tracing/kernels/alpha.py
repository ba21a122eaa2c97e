"""Surfaces that are not there in places: a filter that Embree asks about every hit of theirs.

By alpha_mode `mask` a hit counts where alpha reaches the cutoff; by `blend` with probability alpha, decided by a hash
of the ray and the place, so that the mean over samples is the blend, whatever the order of surfaces.
"""

from __future__ import annotations

import numpy as np

from wall.core.jit import inline_kernel
from wall.core.kernels.hashing import hash_uint32
from wall.core.kernels.memory import callback, clear_uint32, float32_at, int64_at, uint8_at, uint32_at
from wall.tracing.kernels.texture_filter import texels_about, wrapped
from wall.tracing.kernels.values import ONE

# int64 that the filter gets for a mesh: addresses (0: there is none), sizes in texels, and bits of float32
TRIANGLES, UVS, TEXELS, WIDTH, HEIGHT, WRAP_U, WRAP_V, BLENDS, ALPHA, CUTOFF = range(10)
MESH_NUMBERS = 10
VALID, USER_DATA, RAYS, HITS, COUNT = 0, 1, 3, 4, 5  # of RTCFilterFunctionNArguments, 8 bytes each
RAY_ID, HIT_U, HIT_V, PRIMITIVE = 10, 3, 4, 5  # rows of RTCRayN and RTCHitN
LOW_BITS = np.int64(0xFFFFFFFF)
HALF, BYTE = np.float32(0.5), np.float32(1.0 / 255.0)
UNIT = np.float32(2.0**-24)


def pass_transparent(arguments):
    """Marks hits as passed where their surface is not there; arguments : address of RTCFilterFunctionNArguments."""
    count = int64_at(arguments, COUNT) & LOW_BITS
    valid, mesh = int64_at(arguments, VALID), int64_at(arguments, USER_DATA)
    rays, hits = int64_at(arguments, RAYS), int64_at(arguments, HITS)
    for lane in range(count):
        if uint32_at(valid, lane) == np.uint32(0):
            continue
        primitive = uint32_at(hits, PRIMITIVE * count + lane)
        alpha, least = float32_at(mesh, 2 * ALPHA), float32_at(mesh, 2 * CUTOFF)
        if int64_at(mesh, TEXELS) != 0:
            s, t = float32_at(hits, HIT_U * count + lane), float32_at(hits, HIT_V * count + lane)
            alpha *= alpha_at(mesh, primitive, s, t)
        if int64_at(mesh, BLENDS) != 0:
            key = hash_uint32(uint32_at(rays, RAY_ID * count + lane), primitive)
            key = hash_uint32(key, uint32_at(hits, HIT_U * count + lane))
            key = hash_uint32(key, uint32_at(hits, HIT_V * count + lane))
            least = (np.float32(key >> np.uint32(8)) + HALF) * UNIT
        if not alpha >= least:
            clear_uint32(valid, lane)


@inline_kernel
def alpha_at(mesh, primitive, s, t):
    """Bilinear alpha of a mesh's texture, 0..1, at the weights s, t of a triangle's corners 1 and 2."""
    triangles, uvs, texels = int64_at(mesh, TRIANGLES), int64_at(mesh, UVS), int64_at(mesh, TEXELS)
    first = 3 * np.int64(primitive)
    i = 2 * np.int64(uint32_at(triangles, first))
    j, k = 2 * np.int64(uint32_at(triangles, first + 1)), 2 * np.int64(uint32_at(triangles, first + 2))
    u, v = float32_at(uvs, i), float32_at(uvs, i + 1)
    u += s * (float32_at(uvs, j) - float32_at(uvs, i)) + t * (float32_at(uvs, k) - float32_at(uvs, i))
    v += s * (float32_at(uvs, j + 1) - float32_at(uvs, i + 1)) + t * (float32_at(uvs, k + 1) - float32_at(uvs, i + 1))
    width, height = int64_at(mesh, WIDTH), int64_at(mesh, HEIGHT)
    u, v = wrapped(u, np.float32(width), int64_at(mesh, WRAP_U)), wrapped(v, np.float32(height), int64_at(mesh, WRAP_V))
    x = (u - np.floor(u)) * np.float32(width) + HALF  # of the texel right of it
    y = (ONE - (v - np.floor(v))) * np.float32(height) + HALF
    x0, x1, y0, y1, fx, fy = texels_about(x, y, width, height)
    top, bottom = texels + y0 * width, texels + y1 * width
    above = (ONE - fx) * np.float32(uint8_at(top, x0)) + fx * np.float32(uint8_at(top, x1))
    below = (ONE - fx) * np.float32(uint8_at(bottom, x0)) + fx * np.float32(uint8_at(bottom, x1))
    return BYTE * ((ONE - fy) * above + fy * below)


PASS_TRANSPARENT = callback(pass_transparent)
