"""How much of an image stored samples would still show under another pose: told by a few of them."""

from __future__ import annotations

import numpy as np

from wall.core.jit import kernel
from wall.deepbuffer.kernels.reproject import pixel_of

ZERO = np.float32(0.0)


@kernel
def count_by_cell(store, count, step, panel_from_object, width, height, cells):
    """Count every `step`-th sample in the cell of the image that it would be seen in.

    Parameters
    ----------
    store : SampleStore; count : int, samples
    panel_from_object : (n + 1, 12) float32, of the pose
    width, height : float32, pixels of the image
    cells : (rows, columns) int32, added to: the image in equal parts

    Returns
    -------
    looked_at : int, samples that are not rejected
    """
    looked_at = 0
    for k in range(0, count, step):
        if not store.confidence[k] > ZERO:
            continue
        looked_at += 1
        position, object_id = store.position, store.object_id[k]
        x, y, depth = pixel_of(position[0, k], position[1, k], position[2, k], object_id, panel_from_object)
        if depth > ZERO and ZERO <= x < width and ZERO <= y < height:
            cells[int(y * cells.shape[0] / height), int(x * cells.shape[1] / width)] += 1
    return looked_at
