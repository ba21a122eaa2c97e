"""Focus by a click: how far ahead the surface stands that is shown at a place of the wall."""

from __future__ import annotations

import math

import numpy as np

from wall.core.data import Event
from wall.core.errors import EditError
from wall.geometry.cameras import PanelView
from wall.geometry.frusta import ray_frame
from wall.geometry.panels import Panel
from wall.roles.plan import Plan
from wall.scene.picking import Picking


class Focusing:
    """`distance` to what is shown somewhere, with a ray of the head's own: no renderer is asked."""

    def __init__(self, plan: Plan) -> None:
        self._plan = plan
        self._picking: Picking | None = None  # from the first click on

    def distance(self, event: Event, x: float, y: float) -> float:
        """World units along the direction of view; inf at the sky. x, y : fractions of the wall, from its top left.

        Raises EditError where no panel is, or for what is not ahead of the view.
        """
        wall = self._plan.layout.wall
        x, y = x * wall.width, y * wall.height
        panel = next((viewport for viewport in reversed(wall.viewports) if _shows(viewport, x, y)), None)
        if panel is None:
            raise EditError(f"focus at pixel {x:.0f}, {y:.0f}: no panel is there")
        if panel.view != event.view:
            raise EditError(f"focus at pixel {x:.0f}, {y:.0f}: {panel.id} shows no view with a lens")
        seen = PanelView(self._plan.view_of(panel), panel)
        event = seen(event)
        across, down = ((x - panel.screen[0]) / panel.span[0], (y - panel.screen[1]) / panel.span[1])
        place = (1.0, panel.screen[0] + across * panel.pixels[0], panel.screen[1] + down * panel.pixels[1])
        direction = np.array(place) @ ray_frame(panel, seen.eye, event.camera)
        ahead = float(direction @ -event.camera.rotation()[:, 2])
        if not ahead > 0.0:
            raise EditError(f"focus at pixel {x:.0f}, {y:.0f}: what panel {panel.id} shows there is not ahead")
        self._picking = self._picking or Picking(self._plan.scene)
        away = self._picking.distance(
            self._plan.scene.at(event.scene_time, event.edits), event.camera.origin(), direction
        )
        return away * ahead if math.isfinite(away) else math.inf


def _shows(panel: Panel, x: float, y: float) -> bool:
    """Whether a pixel of the virtual screen is one of a panel's."""
    return 0.0 <= x - panel.screen[0] < panel.span[0] and 0.0 <= y - panel.screen[1] < panel.span[1]
