"""Objects that edits moved, turned, scaled or hid: `objects.NAME.offset`, `.rotation`, ... All of a name are one.

What lies below an object in its file goes along with it.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from wall.core.data import Float64
from wall.scene.model import Instance, Mesh

OBJECTS, OFFSET, ROTATION, SCALE, VISIBLE = "objects.", "offset", "rotation", "scale", "visible"
EDITS = (OFFSET, ROTATION, SCALE, VISIBLE)  # in the order in which pages show them


class EditedObjects:
    """Edits the poses of a scene's instances; remembers which are of a name, and their middles."""

    def __init__(self) -> None:
        self._rows: dict[str, list[int]] = {}  # of the instances, by name; filled with the first edit
        self._below: dict[str, list[int]] = {}  # the same, and those below them
        self._depths: dict[str, int] = {}  # by name: how many are above
        self._middles: dict[str, Float64] = {}  # by name, where needed: (n, 4), in each one's own frame

    def apply(
        self,
        poses: Float64,
        edits: Iterable[tuple[str, tuple[float, ...]]],
        instances: Sequence[Instance],
        meshes: Sequence[Mesh],
    ) -> None:
        """Move, turn and scale instances, and give hidden ones no extent: zeros, which rays and samples pass.

        poses : (at least as many as instances, 4, 4), world from object, changed; edits : Shading.objects
        """
        self._look_at(instances)
        named = [(*path.removeprefix(OBJECTS).rpartition(".")[::2], value) for path, value in edits]
        for name, what, value in sorted(named, key=lambda each: self._depths.get(each[0], 0)):  # what is above, first
            own, moved = self._rows.get(name, []), self._below.get(name, [])
            if what == OFFSET:
                poses[moved, :3, 3] += value
            elif what in (ROTATION, SCALE):
                middle = self._middle(name, poses[own], [meshes[instances[row].mesh] for row in own])
                turn = rotation_of(value) if what == ROTATION else value[0] * np.eye(3)
                poses[moved, :3, :3] = turn @ poses[moved, :3, :3]
                poses[moved, :3, 3] = (poses[moved, :3, 3] - middle) @ turn.T + middle
            elif value[0] == 0.0:
                poses[moved, :3, :3] = 0.0

    def rows(self, edits: Iterable[tuple[str, tuple[float, ...]]], instances: Sequence[Instance]) -> NDArray[np.intp]:
        """(m,) instances that edits are of."""
        self._look_at(instances)
        names = {path.removeprefix(OBJECTS).rpartition(".")[0] for path, _ in edits}
        found = {row for name in names for row in self._below.get(name, [])}
        return np.array(sorted(found), np.intp)

    def _look_at(self, instances: Sequence[Instance]) -> None:
        if self._rows:
            return
        for row, instance in enumerate(instances):
            self._rows.setdefault(instance.name, []).append(row)
            self._depths[instance.name] = max(self._depths.get(instance.name, 0), len(instance.parents))
            for name in (instance.name, *instance.parents):
                self._below.setdefault(name, []).append(row)

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
