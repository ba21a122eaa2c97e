"""Sums and nearest values of the samples of each pixel, for layers beside the colour."""

from __future__ import annotations

import math

import numpy as np

from wall.core.jit import kernel
from wall.core.kernels.albedo import unpack_albedo
from wall.deepbuffer.kernels.lights import pack_normal, unpack_normal

ZERO, ONE = np.float32(0.0), np.float32(1.0)


@kernel
def accumulate_layers(samples, x0, y0, squares, depth, object_id):
    """Add the squares of samples to their pixels, and keep depth and object of each pixel's nearest sample.

    samples : (n,) SAMPLE; x0, y0 : panel pixel of squares[0, 0]
    squares : (h, w, 3) float64, of linear RGB; depth : (h, w) float32; object_id : (h, w) uint32; updated
    """
    for k in range(samples.shape[0]):
        x, y = int(samples[k]["xy"][0]) - x0, int(samples[k]["xy"][1]) - y0
        for c in range(3):
            value = np.float64(samples[k]["radiance"][c])
            squares[y, x, c] += value * value
        if samples[k]["depth"] < depth[y, x]:
            depth[y, x], object_id[y, x] = samples[k]["depth"], samples[k]["object_id"]


@kernel
def accumulate_surfaces(samples, x0, y0, world_from_normal, albedo, normal, counts):
    """Add the albedos of samples to their pixels, and their unit normals in the world's axes; the sky adds 0.

    samples : (n,) SAMPLE with albedos and normals; x0, y0 : panel pixel of albedo[0, 0]
    world_from_normal : (objects, 9) float32, rows of the matrices that turn normals, up to a factor > 0
    albedo, normal : (h, w, 3) float64, counts : (h, w) int64; updated
    """
    for k in range(samples.shape[0]):
        x, y = int(samples[k]["xy"][0]) - x0, int(samples[k]["xy"][1]) - y0
        counts[y, x] += 1
        object_id = int(samples[k]["object_id"])
        if object_id == 0:
            continue
        r, g, b = unpack_albedo(samples[k]["albedo"])
        albedo[y, x, 0] += r
        albedo[y, x, 1] += g
        albedo[y, x, 2] += b
        u, v, w = unpack_normal(pack_normal(samples[k]["normal"][0], samples[k]["normal"][1]))
        m = world_from_normal[object_id - 1]
        nx = m[0] * u + m[1] * v + m[2] * w
        ny = m[3] * u + m[4] * v + m[5] * w
        nz = m[6] * u + m[7] * v + m[8] * w
        square = nx * nx + ny * ny + nz * nz
        scale = ONE / math.sqrt(square) if square > ZERO else ZERO
        normal[y, x, 0] += scale * nx
        normal[y, x, 1] += scale * ny
        normal[y, x, 2] += scale * nz
