"""What a click at a place of the wall hits: how far ahead it stands, and which object it is."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from wall.core.data import Event
from wall.core.errors import EditError
from wall.geometry.cameras import PanelView
from wall.geometry.frusta import ray_frame
from wall.geometry.panels import NO_VIEW, Panel
from wall.roles.plan import Plan
from wall.scene.picking import Picking


class Clicks:
    """Follows a ray of the head's own through what is shown somewhere: no renderer is asked.

    x, y : fractions of the wall, from its top left. Raises EditError where no panel is.
    """

    def __init__(self, plan: Plan) -> None:
        self._plan = plan
        self._picking: Picking | None = None  # from the first click on

    def distance(self, events: Sequence[Event], x: float, y: float) -> float:
        """World units along the direction of view; inf at the sky. events : the newest of every view.

        Raises EditError also for what is not ahead, and in a view without a lens.
        """
        viewport, column, row = self._place(x, y)
        where = f"focus at pixel {column:.0f}, {row:.0f}"
        if self._plan.scene_of(viewport.view).lens is None:
            raise EditError(f"{where}: {viewport.id} shows no view with a lens")
        away, _, ahead = self._hit(viewport, events[viewport.view], column, row)
        if not ahead > 0.0:
            raise EditError(f"{where}: what panel {viewport.id} shows there is not ahead")
        return away * ahead if math.isfinite(away) else math.inf

    def object_at(self, events: Sequence[Event], x: float, y: float) -> str:
        """The name of the object that is shown; "" for the sky. events : the newest of every view."""
        return self._object_at(events, x, y)[1]

    def select(self, names: Sequence[str], events: Sequence[Event], x: float, y: float) -> list[str]:
        """What is selected in each view once what is at a place is, in the view that shows it and those linked to it.

        names : what was, by view; [] nothing. events : the newest of every view.
        """
        (view, name), config = self._object_at(events, x, y), self._plan.layout.config
        linked = [config.selection_of(k) == config.selection_of(view) for k in range(len(config.views))]
        before = names or [""] * len(linked)
        return [name if new else old for new, old in zip(linked, before, strict=True)]

    def _object_at(self, events: Sequence[Event], x: float, y: float) -> tuple[int, str]:
        viewport, column, row = self._place(x, y)
        _, instance, _ = self._hit(viewport, events[viewport.view], column, row)
        return viewport.view, self._plan.scene.instances[instance].name if instance >= 0 else ""

    def _place(self, x: float, y: float) -> tuple[Panel, float, float]:
        """The nearest viewport at a place, and the place in virtual-screen pixels."""
        wall = self._plan.layout.wall
        x, y = x * wall.width, y * wall.height
        found = next((v for v in reversed(wall.viewports) if v.view != NO_VIEW and _shows(v, x, y)), None)
        if found is None:
            raise EditError(f"a click at pixel {x:.0f}, {y:.0f}: no panel is there")
        return found, x, y

    def _hit(self, viewport: Panel, event: Event, x: float, y: float) -> tuple[float, int, float]:
        """What Picking.first finds for a pixel, and how far ahead a length of its ray leads."""
        seen = PanelView(self._plan.view_of(viewport), viewport)
        event = seen(event)
        across, down = (x - viewport.screen[0]) / viewport.span[0], (y - viewport.screen[1]) / viewport.span[1]
        pixels = viewport.screen[0] + across * viewport.pixels[0], viewport.screen[1] + down * viewport.pixels[1]
        direction = np.array((1.0, *pixels)) @ ray_frame(viewport, seen.eye, event.camera)
        self._picking = self._picking or Picking(self._plan.scene)
        moment = self._plan.scene.at(event.scene_time, event.edits)
        away, instance = self._picking.first(moment, event.camera.origin(), direction)
        return away, instance, float(direction @ -event.camera.rotation()[:, 2])


def _shows(panel: Panel, x: float, y: float) -> bool:
    """Whether a pixel of the virtual screen is one of a panel's."""
    return 0.0 <= x - panel.screen[0] < panel.span[0] and 0.0 <= y - panel.screen[1] < panel.span[1]
