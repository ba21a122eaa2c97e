"""What the graph sees of a layer that has a resolution or a rate of its own.

A smaller image is enlarged to its panel. A slower one is kept with its depth, and goes with camera and objects until
the layer is reconstructed again: so at every refresh all layers show the same moment.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wall.compositing.graph import Layer
from wall.core.data import Event
from wall.reconstruction.channels import blank_framelet
from wall.reconstruction.enlarging import Enlarger
from wall.roles.pace import Pace
from wall.roles.plan import Plan
from wall.roles.timewarp import Timewarp


class LayerOutput:
    """Between `source`, which the layer writes, and `framelet`, which the graph reads. `show` after each refresh."""

    def __init__(self, plan: Plan, layer: Layer) -> None:
        step, wall = plan.layout.graph.step(layer.node), plan.layout.wall
        self._plan, self._layer = plan, layer
        slow, small = layer.refresh_hz is not None, layer.scale < 1.0
        panel, kept = wall.viewports[layer.panel], step.channels | ({"depth", "object_id"} if slow else frozenset())
        self.framelet = blank_framelet(panel, step.channels, encoded=step.encoded, order=step.order)
        held = self.framelet
        if slow:
            held = blank_framelet(panel, kept, encoded=step.encoded, order=step.order)
        self._held, self.source = held, held
        self._enlarger: Enlarger | None = None
        if small:
            self.source = blank_framelet(wall.traced[layer.traced], kept, encoded=False, order=step.order)
            self._enlarger = Enlarger(self.source, held)
        self._pace = Pace(layer.refresh_hz, plan.views[layer.view].refresh_hz) if layer.refresh_hz else None
        self._timewarp = Timewarp(plan)
        self._moved = False  # the framelet shows another moment than what is held
        self._mine = plan.scene.objects_in(layer.range or (0.0, 1.0))

    def begin(self, now: float, *, force: bool = False) -> bool:
        """Whether the layer is to be reconstructed at this refresh: at every one before it shows anything."""
        return self._pace is None or self._pace.begin(now, force=force or self._held.event is None)

    def show(self, dirty: NDArray[np.bool_], event: Event, now: float) -> NDArray[np.bool_]:
        """Bring the framelet to `event`, after the dirty tiles of `source` changed.

        Returns the framelet's 16-pixel tiles that changed, (rows, columns) bool.
        """
        if self._enlarger is not None:
            dirty = self._enlarger.enlarge(dirty)
        if self._pace is None:
            return dirty
        held, shown = self._held, self.framelet
        moves = held.event is not None and self._moves(held.event, event)
        if moves and not dirty.any() and shown.event is not None and not self._moves(shown.event, event):
            return dirty
        dirty = dirty | moves | self._moved
        if moves:
            self._timewarp.fill(held, event, self._layer.panel, shown)
        elif dirty.any():
            shown.refreshed_at = held.refreshed_at
            for name in shown.channels:
                np.copyto(shown.channel(name), held.channel(name))
        if held.event is not None:
            shown.event = event
            shown.stamp(now)
        self._moved = moves
        return dirty

    def _moves(self, old: Event, new: Event) -> bool:
        """Whether the camera or any object of the layer is elsewhere in another event."""
        if old.number == new.number:
            return False
        if old.camera != new.camera:
            return True
        if old.scene_time == new.scene_time and old.edits.number == new.edits.number:
            return False
        scene, mine = self._plan.scene, self._mine
        before, after = (scene.at(e.scene_time, e.edits).world_from_object[mine] for e in (old, new))
        return not np.array_equal(before, after)
