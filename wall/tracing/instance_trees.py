"""InstanceTrees: one thread's Embree trees over a scene's instances, placed relative to the eye.

An instance is placed again only if it, or the eye, moved. Embree builds a tree over instances anew, 0.7 us for each of
them, whatever moved; so where they are many, those that move have a tree of their own, which every ray meets second.
An instance that begins to move, since someone edits it, goes over to that tree and stays there.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wall.core.data import Float64
from wall.scene.cuts import planes_of
from wall.scene.model import Moment
from wall.tracing import embree
from wall.tracing.kernels.placement import place_instances
from wall.tracing.kernels.values import PLACEMENT_COLUMNS, Trees
from wall.tracing.steps import LaidSteps
from wall.tracing.tracer_scene import TracerScene

LEAST_APART = 4096  # instances; fewer are one tree, which takes less than 3 ms to build
OFFSET_ULPS = 16.0  # float32 roundings from a hit to its secondary ray; eight times the need, docs/guide/accuracy.md


class InstanceTrees:
    """`place` puts everything where a moment has it; `trees` is for kernels that trace."""

    def __init__(self, tracer_scene: TracerScene, masks: NDArray[np.uint32]) -> None:
        """`masks`: (n,) of the instances; a ray passes those whose mask has no bit of its own."""
        n = len(tracer_scene.meshes)
        self.placed = 0  # instances so far, each as often as it was
        self.built = 0  # trees so far
        self.transforms = embree.aligned((n, 12), np.float32)
        self.placements = np.zeros((n, PLACEMENT_COLUMNS), np.float32)
        self._meshes, self._extents = list(tracer_scene.meshes), tracer_scene.extents
        self._tracer_scene, self._masks = tracer_scene, masks
        self._device = tracer_scene.device
        self._handles = self._device.handles()
        self._geometries = np.zeros(n, np.intp)
        self._singular = np.zeros(n, np.bool_)
        self._hidden = np.zeros(n, np.bool_)
        self._moves_apart = np.zeros(n, np.bool_)
        cuts = np.zeros((len(tracer_scene.scene.cuts), 4), np.float32) if tracer_scene.scene.cuts else None
        self.trees = Trees(self._device.tree(self._handles), 0, np.zeros(0, np.uint32), cuts)
        animated = tracer_scene.scene.animated_objects
        self._many = n >= LEAST_APART
        if self._many and len(animated) <= n // 2:
            self._move_apart(animated)
        for k in np.flatnonzero(~self._moves_apart).tolist():
            self._geometries[k] = self._instance(self.trees.at_rest, k, k)
        self._device.check("creating instances")
        self._origin = np.full(3, np.nan)
        self._shown: Moment | None = None

    @property
    def singular(self) -> int:
        """Instances whose matrix has no inverse, as last placed."""
        return int(self._singular.sum())

    def show(self, laid: LaidSteps) -> None:
        """Gives instances the meshes of the steps that are shown; to be placed then, where those and others changed."""
        before, self._meshes = self._meshes, list(self._tracer_scene.meshes)
        self._extents = self._tracer_scene.extents.copy()
        for step in laid.steps:
            self._meshes[step.instance], self._extents[step.instance] = step.mesh, step.extent
        for k, (was, mesh) in enumerate(zip(before, self._meshes, strict=True)):
            if was != mesh:
                self._device.show(int(self._geometries[k]), mesh)
        self._handles.devices[1:] = [step.device for step in laid.steps]

    def place(self, moment: Moment, origin: Float64) -> None:
        """Places what is not yet where it is to be, relative to the eye at `origin` (3,), world."""
        if self.trees.cuts is not None:
            self.trees.cuts[:] = planes_of(moment.shading.cuts, origin)
        before, self._shown = self._shown, moment
        if before is None or (origin != self._origin).any():
            self._origin = origin.copy()
            self._place(moment.world_from_object, np.arange(len(self._geometries)))
            self._build(rest=True)
            return
        rows = np.union1d(before.moved, moment.moved)
        new, old = moment.world_from_object[rows], before.world_from_object[rows]
        rows = rows[(new != old).any(axis=(1, 2))]
        if len(rows) == 0:
            return
        begun = rows[~self._moves_apart[rows]]
        goes_over = self._many and 0 < len(begun) <= len(self._geometries) // 2
        if goes_over:
            for k in begun.tolist():
                self._device.show(int(self._geometries[k]), self._tracer_scene.meshes[k])  # a step's would be kept
                self._device.mask(int(self._geometries[k]), 0)
            self._move_apart(begun)
        self._place(moment.world_from_object, rows)
        self._build(rest=len(begun) > 0)

    def _place(self, world_from_object: Float64, rows: NDArray[np.intp]) -> None:
        self._hide(rows, np.asarray(~world_from_object[rows, :3, :3].any(axis=(1, 2))))
        place_instances(
            world_from_object,
            self._origin,
            rows,
            self._geometries,
            self.transforms,
            self.placements,
            self._extents,
            self._tracer_scene.depth_scales,
            self._singular,
            OFFSET_ULPS,
        )
        self.placed += len(rows)

    def _hide(self, rows: NDArray[np.intp], hidden: NDArray[np.bool_]) -> None:
        """Let rays pass what has no extent: under a matrix of zeros they would visit a mesh's whole tree."""
        for k in rows[hidden != self._hidden[rows]].tolist():
            self._device.mask(int(self._geometries[k]), int(self._masks[k]) if self._hidden[k] else 0)
        self._hidden[rows] = hidden

    def _build(self, *, rest: bool) -> None:
        for tree in (self.trees.at_rest if rest else 0, self.trees.moving):
            if tree != 0:
                self._device.commit(tree)
                self.built += 1

    def _move_apart(self, rows: NDArray[np.intp]) -> None:
        """Gives instances to the tree of those that move; they are to be placed."""
        if len(rows) == 0:
            return
        first, moving = len(self.trees.objects), self.trees.moving or self._device.tree(self._handles)
        for number, k in enumerate(rows.tolist(), start=first):
            self._geometries[k] = self._instance(moving, number, k)
        self._moves_apart[rows], self._hidden[rows] = True, False
        objects = np.concatenate([self.trees.objects, rows.astype(np.uint32)])
        self.trees = self.trees._replace(moving=moving, objects=objects)

    def _instance(self, tree: embree.Handle, number: int, k: int) -> embree.Handle:
        mesh, mask = self._meshes[k], int(self._masks[k])
        return self._device.instance(self._handles, tree, number, mesh=mesh, mask=mask)
