"""Albedos and normals of samples, as rows that are splatted in place of radiance."""

from __future__ import annotations

import math

import numpy as np

from wall.core.jit import kernel
from wall.deepbuffer.kernels.lights import unpack_normal

ZERO, ONE = np.float32(0.0), np.float32(1.0)


@kernel
def rows_of_surfaces(store, weight, count, object_from_eye, albedo, normal):
    """Write the albedo of each sample, and its normal in the world's axes: 0 of the sky.

    A normal n of an object's space turns to the transpose of object_from_eye times n, whatever the scaling.

    store : SampleStore with albedos; weight : (capacity,) float32, only samples with weight are written
    count : int, samples stored; object_from_eye : (n + 1, 12) float32, see Pose
    albedo, normal : (capacity, 4) float32, first three columns written
    """
    for k in range(count):
        if not weight[k] > ZERO:
            continue
        for c in range(3):
            albedo[k, c], normal[k, c] = store.albedo[c, k], ZERO
        object_id = int(store.object_id[k])
        if object_id > 0:
            x, y, z = unpack_normal(store.normal[k])
            table = object_from_eye[object_id]
            u = table[0] * x + table[4] * y + table[8] * z
            v = table[1] * x + table[5] * y + table[9] * z
            w = table[2] * x + table[6] * y + table[10] * z
            square = u * u + v * v + w * w
            scale = ONE / math.sqrt(square) if square > ZERO else ZERO
            normal[k, 0], normal[k, 1], normal[k, 2] = scale * u, scale * v, scale * w
