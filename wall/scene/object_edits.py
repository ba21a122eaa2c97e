"""Objects that edits moved or hid: `objects.NAME.offset` and `objects.NAME.visible`. All objects of a name are one."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from wall.core.data import Float64
from wall.scene.model import Instance

OBJECTS, OFFSET, VISIBLE = "objects.", "offset", "visible"


def edit_objects(
    poses: Float64,
    edits: Iterable[tuple[str, tuple[float, ...]]],
    instances: Sequence[Instance],
    rows: dict[str, list[int]],
) -> None:
    """Move instances by offsets, and give hidden ones no extent: matrices of zeros, which rays and samples pass.

    poses : (at least as many as instances, 4, 4), world from object, changed; edits : Shading.objects
    rows : of the instances, by name; filled with the first edit
    """
    for path, value in edits:
        if not rows:
            for row, instance in enumerate(instances):
                rows.setdefault(instance.name, []).append(row)
        name, _, what = path.removeprefix(OBJECTS).rpartition(".")
        own = rows.get(name, [])
        if what == OFFSET:
            poses[own, :3, 3] += value
        elif value[0] == 0.0:
            poses[own, :3, :3] = 0.0
