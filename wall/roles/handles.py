"""Where the object that is selected stands on the wall, so that a page can draw handles that move it."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from wall.core.data import Event, Float64
from wall.display.base import Handles, HandlesPlace
from wall.geometry.cameras import PanelView
from wall.geometry.frusta import ray_frame
from wall.geometry.panels import NO_VIEW, Panel
from wall.roles.plan import Plan
from wall.scene.object_edits import OBJECTS, OFFSET, middles_of, placed_middle

DIGITS = 9  # of the numbers that pages get


class HandlesMaker:
    """`handles` of the object of a name, under the event that each view shows. The same object until they change."""

    def __init__(self, plan: Plan, name: str) -> None:
        scene = plan.scene
        self._scene, self._parameter = scene, f"{OBJECTS}{name}.{OFFSET}"
        self._rows = [row for row, instance in enumerate(scene.instances) if instance.name == name]
        self._middles = middles_of([scene.meshes[scene.instances[row].mesh] for row in self._rows])
        panels = [panel for panel in plan.layout.wall.viewports if panel.view != NO_VIEW] if self._rows else []
        self._views = [(panel, PanelView(plan.view_of(panel), panel)) for panel in panels]
        self._newest: Handles | None = None

    def handles(self, events: Mapping[int, Event]) -> Handles | None:
        """events : by view, what it shows; None: none of the views shows anything, or no object has that name."""
        known = [(panel, seen.eye, seen(events[panel.view])) for panel, seen in self._views if panel.view in events]
        if not known:
            return None
        newest = max((event for _, _, event in known), key=lambda event: event.scene_event)
        values = self._scene.values(newest.scene_time, newest.edits)
        x, y, z = values.get(self._parameter, (0.0, 0.0, 0.0))
        made = Handles(
            parameter=self._parameter,
            value=(x, y, z),
            places=tuple(self._place(panel, eye, event) for panel, eye, event in known),
        )
        if made != self._newest:
            self._newest = made
        return self._newest

    def _place(self, panel: Panel, eye: Float64, event: Event) -> HandlesPlace:
        placed = self._scene.at(event.scene_time, event.edits).world_from_object[self._rows]
        middle = placed_middle(placed, self._middles)
        panel_from_world = np.linalg.inv(ray_frame(panel, eye, event.camera).T)  # rows w, x w, y w
        at = panel_from_world @ (middle - event.camera.origin())
        rows = np.column_stack([panel_from_world, at])
        corner, pixels, span = (
            np.array(pair, np.float64)[:, None] for pair in (panel.screen, panel.pixels, panel.span)
        )
        rows[1:] = (rows[1:] - corner * rows[0]) * span / pixels + corner * rows[0]
        rows /= np.abs(rows).max()
        return HandlesPlace(
            view=panel.view,
            rect=(panel.screen[0], panel.screen[1], panel.span[0], panel.span[1]),
            wall_from_object=tuple(float(f"{number:.{DIGITS}g}") for number in rows.ravel().tolist()),
        )
