"""Where the objects that are selected stand on the wall, so that a page can draw handles that move them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

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
    """`handles` of what is selected, under the event that each view shows. The same object until they change."""

    def __init__(self, plan: Plan, names: Sequence[str]) -> None:
        """`names`: by view, of the object that is selected in it; "" none."""
        self._scene = plan.scene
        self._selected = {name: self._of(name) for name in names if name}
        shown = [panel for panel in plan.layout.wall.viewports if panel.view != NO_VIEW and names[panel.view]]
        self._views = [(panel, names[panel.view], PanelView(plan.view_of(panel), panel)) for panel in shown]
        self._newest: Handles | None = None

    def _of(self, name: str) -> tuple[list[int], Float64]:
        """The instances of an object, and the middles of their meshes."""
        scene = self._scene
        rows = [row for row, instance in enumerate(scene.instances) if instance.name == name]
        return rows, middles_of([scene.meshes[scene.instances[row].mesh] for row in rows])

    def handles(self, events: Mapping[int, Event]) -> Handles | None:
        """events : by view, what it shows; None: no view that shows anything has an object of its name."""
        places = tuple(
            self._place(panel, name, seen.eye, seen(events[panel.view]))
            for panel, name, seen in self._views
            if panel.view in events and self._selected[name][0]
        )
        made = Handles(places=places) if places else None
        if made != self._newest:
            self._newest = made
        return self._newest

    def _place(self, panel: Panel, name: str, eye: Float64, event: Event) -> HandlesPlace:
        (instances, middles), parameter = self._selected[name], f"{OBJECTS}{name}.{OFFSET}"
        x, y, z = self._scene.values(event.scene_time, event.edits).get(parameter, (0.0, 0.0, 0.0))
        placed = self._scene.at(event.scene_time, event.edits).world_from_object[instances]
        middle = placed_middle(placed, middles)
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
            parameter=parameter,
            value=(x, y, z),
            rect=(panel.screen[0], panel.screen[1], panel.span[0], panel.span[1]),
            wall_from_object=tuple(float(f"{number:.{DIGITS}g}") for number in rows.ravel().tolist()),
        )
