"""Samples that saw the scene before an edit lose confidence; they are still shown where nothing newer is."""

from __future__ import annotations

import numpy as np

from wall.core.jit import kernel

ZERO, ONE = np.float32(0.0), np.float32(1.0)
KEPT = np.float32(0.5)  # share of confidence that a doubtful sample keeps at each edit
LEAST = np.float32(0.25)  # confidence that doubt leaves: edit after edit a picture stays, without holes (TRUSTED)
FRESH = np.float32(2.0)  # confidence of a sample that saw edits which the image does not show yet


@kernel
def doubt(store, first, count, doubted, unlit):
    """Take confidence from the samples of doubted objects. Fresh ones lose none: they become as any other.

    Parameters
    ----------
    store : SampleStore, `confidence` updated of the slots from `first` to before `count`
    doubted : (n + 1,) uint8, objects
    unlit : bool, samples that cannot be lit anew are doubtful too, whatever their object

    Returns
    -------
    changed : int, samples that lost confidence
    """
    changed = 0
    for k in range(first, count):
        confidence = store.confidence[k]
        if confidence > ONE:
            store.confidence[k] = ONE
        elif confidence > LEAST and (
            doubted[store.object_id[k]] != 0 or (unlit and store.object_id[k] != 0 and store.albedo[0, k] < ZERO)
        ):
            store.confidence[k] = max(confidence * KEPT, LEAST)
            changed += 1
    return changed
