"""Samples that lie where the scene is cut away are rejected."""

from __future__ import annotations

import numpy as np

from wall.core.jit import kernel
from wall.deepbuffer.kernels.columns import X, Y, Z

ZERO = np.float32(0.0)
NEAR = np.float32(1e-4)  # of a point's coordinates and its plane's distance: samples so near to a plane stay, and are
# doubted alone, since they were rounded on their way: a surface in the plane itself is to keep its samples


@kernel
def reject_cut_away(store, count, planes):
    """Take all confidence from samples beyond a plane of their object.

    Parameters
    ----------
    store : SampleStore, `confidence` updated; count : int, samples stored
    planes : (n + 1, k, 4) float32, see deepbuffer.cuts.planes_in_objects

    Returns
    -------
    rejected : int, samples that had confidence before
    """
    rejected = 0
    for k in range(count):
        own = planes[store.object_id[k]]
        x, y, z = store.position[X, k], store.position[Y, k], store.position[Z, k]
        for n in range(own.shape[0]):
            a, b, c = own[n, 0] * x, own[n, 1] * y, own[n, 2] * z
            beyond = a + b + c - own[n, 3]
            if beyond > NEAR * (abs(a) + abs(b) + abs(c) + abs(own[n, 3])):
                rejected += 1 if store.confidence[k] > ZERO else 0
                store.confidence[k] = ZERO
    return rejected
