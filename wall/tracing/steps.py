"""The steps of series as the tracer reads them: meshes beside those of the scene, while some thread shows them.

Arrays that kernels read are the scene's with the steps' behind them, made anew when another step is shown. Threads of
a process that show the same steps share them; what no thread shows any more goes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from threading import Lock
from typing import TYPE_CHECKING
from weakref import WeakValueDictionary

import numpy as np

from wall.core.data import Float32
from wall.scene.build import Scene
from wall.scene.model import Mesh
from wall.tracing.embree import Device, Handle
from wall.tracing.kernels.values import (
    FIRST_SEGMENT,
    FIRST_SPHERE,
    FIRST_TRIANGLE,
    FIRST_VERTEX,
    HAS_COLORS,
    HAS_NORMALS,
    MESH_FLAGS,
    Surfaces,
)
from wall.tracing.mesh_trees import extent_of, mesh_tree, padded, round_flags

if TYPE_CHECKING:
    from wall.tracing.tracer_scene import TracerScene


@dataclass(frozen=True, slots=True, kw_only=True, weakref_slot=True)
class LaidStep:
    """One step of a series."""

    instance: int
    data: Mesh
    mesh: Handle
    extent: float  # see TracerScene.extents
    device: Device  # which keeps the mesh


@dataclass(frozen=True, slots=True, kw_only=True, weakref_slot=True)
class LaidSteps:
    """The steps of all series that are shown at a moment, but for first ones, and the arrays of meshes with them.

    Arrays stand in the fields that they have in Surfaces and in Meshes; those that a scene lacks are None.
    """

    steps: tuple[LaidStep, ...]
    arrays: Surfaces  # whose meshes have no placements or eye_from_object


class Steps:
    """Lays the steps of a scene's series out for tracing. For any thread."""

    def __init__(self) -> None:
        self._lock = Lock()
        self._laid: WeakValueDictionary[tuple[bool, tuple[int, ...]], LaidSteps] = WeakValueDictionary()
        self._each: WeakValueDictionary[tuple[int, int], LaidStep] = WeakValueDictionary()

    def of(self, tracer_scene: TracerScene, steps: tuple[int, ...]) -> LaidSteps:
        """The steps shown, of each series; waits for those that are not loaded yet."""
        with self._lock:
            key = tracer_scene.surfaces.vertices is None, steps  # other integrators may have use for them
            if (known := self._laid.get(key)) is not None:
                return known
            shown = tuple(self._step(tracer_scene.scene, k, step) for k, step in enumerate(steps) if step > 0)
            laid = LaidSteps(steps=shown, arrays=_with_steps(tracer_scene.surfaces, shown))
            self._laid[key] = laid
            return laid

    def _step(self, scene: Scene, number: int, step: int) -> LaidStep:
        if (known := self._each.get((number, step))) is not None:
            return known
        series = scene.series[number]
        like, device = scene.meshes[scene.instances[series.first].mesh], Device()
        mesh = replace(series.meshes.mesh(step), material=like.material)
        laid = LaidStep(
            instance=series.first + step,
            data=mesh,
            mesh=mesh_tree(device, scene, mesh, padded(mesh.vertices), np.ascontiguousarray(mesh.triangles)),
            extent=extent_of(mesh),
            device=device,
        )
        self._each[number, step] = laid
        return laid


def _with_steps(static: Surfaces, steps: Sequence[LaidStep]) -> Surfaces:
    """The arrays of a scene with those of steps behind them."""
    of_corners = (static.vertices, static.normals, static.colors)
    corner = max((len(each) for each in of_corners if each is not None), default=0)
    triangle, sphere = len(static.meshes.triangles), 0 if static.point_colors is None else len(static.point_colors)
    segment = 0 if static.segments is None else len(static.segments)
    table = static.meshes.mesh_table.copy()
    meshes = [step.data for step in steps]
    solid = [mesh for mesh in meshes if mesh.spheres is None]
    for step in steps:
        row, mesh = table[step.instance], step.data
        if mesh.spheres is not None:
            row[FIRST_SPHERE], row[MESH_FLAGS] = sphere, round_flags(mesh)
            if mesh.segments is not None:
                row[FIRST_SEGMENT], segment = segment, segment + len(mesh.segments)
            sphere += len(mesh.spheres) if mesh.colors is not None else 0
            continue
        flags = HAS_NORMALS * (mesh.normals is not None) + HAS_COLORS * (mesh.colors is not None)
        row[FIRST_TRIANGLE], row[FIRST_VERTEX], row[MESH_FLAGS] = triangle, corner, flags
        triangle, corner = triangle + len(mesh.triangles), corner + len(mesh.vertices)
    colored = [mesh.colors for mesh in meshes if mesh.spheres is not None and mesh.colors is not None]
    curves = [mesh.segments for mesh in meshes if mesh.segments is not None]
    triangles = np.concatenate([static.meshes.triangles, *(mesh.triangles for mesh in solid)])
    return static._replace(
        meshes=static.meshes._replace(mesh_table=table, triangles=triangles),
        vertices=_behind(static.vertices, [mesh.vertices for mesh in solid], solid, corner),
        normals=_behind(static.normals, [mesh.normals for mesh in solid], solid, corner),
        colors=_behind(static.colors, [mesh.colors for mesh in solid], solid, corner),
        point_colors=None if static.point_colors is None else np.concatenate([static.point_colors, *colored]),
        segments=None if static.segments is None else np.concatenate([static.segments, *curves]),
    )


def _behind(static: Float32 | None, rows: Sequence[Float32 | None], meshes: Sequence[Mesh], end: int) -> Float32 | None:
    """(end, 3) rows of the scene's vertices, and at the end those of meshes; zero where there are none."""
    if static is None:
        return None
    whole = np.zeros((end, 3), np.float32)
    whole[: len(static)] = static
    at = end - sum(len(mesh.vertices) for mesh in meshes)
    for own, mesh in zip(rows, meshes, strict=True):
        if own is not None:
            whole[at : at + len(mesh.vertices)] = own
        at += len(mesh.vertices)
    return whole
