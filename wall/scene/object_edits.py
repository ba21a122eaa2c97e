"""Objects that edits moved, turned or hid: `objects.NAME.offset`, `.rotation`, `.visible`. All of a name are one.

What lies below an object in its file goes along with it.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from wall.core.data import Float64
from wall.scene.model import Instance, Mesh

OBJECTS, OFFSET, ROTATION, VISIBLE = "objects.", "offset", "rotation", "visible"


class EditedObjects:
    """Edits the poses of a scene's instances; remembers which are of a name, and their middles."""

    def __init__(self) -> None:
        self._rows: dict[str, list[int]] = {}  # of the instances, by name; filled with the first edit
        self._middles: dict[str, Float64] = {}  # by name, of those that were turned: (n, 4), in each one's own frame

    def apply(
        self,
        poses: Float64,
        edits: Iterable[tuple[str, tuple[float, ...]]],
        instances: Sequence[Instance],
        meshes: Sequence[Mesh],
    ) -> None:
        """Move and turn instances, and give hidden ones no extent: matrices of zeros, which rays and samples pass.

        poses : (at least as many as instances, 4, 4), world from object, changed; edits : Shading.objects
        """
        for path, value in edits:
            name, _, what = path.removeprefix(OBJECTS).rpartition(".")
            own = self._named(name, instances)
            if what == OFFSET:
                poses[own, :3, 3] += value
            elif what == ROTATION:
                middle = self._middle(name, poses[own], [meshes[instances[row].mesh] for row in own])
                turn = rotation_of(value)
                poses[own, :3, :3] = turn @ poses[own, :3, :3]
                poses[own, :3, 3] = (poses[own, :3, 3] - middle) @ turn.T + middle
            elif value[0] == 0.0:
                poses[own, :3, :3] = 0.0

    def rows(self, edits: Iterable[tuple[str, tuple[float, ...]]], instances: Sequence[Instance]) -> NDArray[np.intp]:
        """(m,) instances that edits are of."""
        names = {path.removeprefix(OBJECTS).rpartition(".")[0] for path, _ in edits}
        found = [row for name in names for row in self._named(name, instances)]
        return np.array(found, np.intp)

    def _named(self, name: str, instances: Sequence[Instance]) -> list[int]:
        if not self._rows:
            for row, instance in enumerate(instances):
                for each in (instance.name, *instance.parents):
                    self._rows.setdefault(each, []).append(row)
        return self._rows.get(name, [])

    def _middle(self, name: str, poses: Float64, meshes: Sequence[Mesh]) -> Float64:
        """(3,) world: the mean of the middles of their bounding boxes."""
        if name not in self._middles:
            self._middles[name] = middles_of(meshes)
        return placed_middle(poses, self._middles[name])


def middles_of(meshes: Sequence[Mesh]) -> Float64:
    """(n, 4) middles of the meshes' bounding boxes, in each one's own frame, and a 1."""
    middles = [(mesh.vertices.min(axis=0) + mesh.vertices.max(axis=0)) / 2.0 for mesh in meshes]
    return np.array([[*middle, 1.0] for middle in middles], np.float64)


def placed_middle(poses: Float64, middles: Float64) -> Float64:
    """(3,) world: the mean of `middles_of` meshes at poses (n, 4, 4), world from object."""
    return np.asarray((poses @ middles[:, :, None])[:, :3, 0].mean(axis=0))


def rotation_of(degrees: Sequence[float]) -> Float64:
    """(3, 3): a turn about the x axis, then about y, then about z, each counterclockwise seen from its tip."""
    (cx, sx), (cy, sy), (cz, sz) = ((math.cos(math.radians(a)), math.sin(math.radians(a))) for a in degrees)
    about_x = np.array([[1.0, 0.0, 0.0], [0.0, cx, -sx], [0.0, sx, cx]])
    about_y = np.array([[cy, 0.0, sy], [0.0, 1.0, 0.0], [-sy, 0.0, cy]])
    about_z = np.array([[cz, -sz, 0.0], [sz, cz, 0.0], [0.0, 0.0, 1.0]])
    return np.asarray(about_z @ about_y @ about_x)
