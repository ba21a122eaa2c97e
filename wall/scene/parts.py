"""Objects of a share of a scene, for sort-last: by triangles, in the scene's order."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wall.scene.build import Scene


def objects_in(scene: Scene, share: tuple[float, float]) -> NDArray[np.bool_]:
    """(n,) bool: instances whose middle triangle lies in [from, to) of all, counted object after object.

    Shares that follow each other hold every object once. An object is never cut, so shares are as equal as objects
    allow.
    """
    sizes = np.array([len(scene.meshes[instance.mesh].triangles) for instance in scene.instances], np.float64)
    middle = (np.cumsum(sizes) - sizes / 2) / max(sizes.sum(), 1.0)
    found: NDArray[np.bool_] = (share[0] <= middle) & (middle < share[1])
    return found
