"""A look at each view before anything runs, for a note where it would begin black."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from wall.core.data import Event
from wall.geometry.cameras import PanelView
from wall.geometry.panels import Panel
from wall.roles.plan import Plan, first_event
from wall.tracing.tracer import Tracer
from wall.tracing.tracer_scene import TracerScene

ACROSS, DOWN = 16, 9  # samples of a panel
MOST_PANELS = 16  # of a view, that are looked at


def dark_views(plan: Plan, tracer_scene: TracerScene) -> list[str]:
    """A note for each view in which no light is found: a camera behind a wall looks like a wall that does not work."""
    notes = []
    for k, view in enumerate(plan.views):
        event = first_event(plan, 0.0, k)
        panels = [panel for panel in plan.layout.wall.traced if panel.view == k]
        panels = panels[:: -(-len(panels) // MOST_PANELS) or 1]  # evenly
        if panels and not _finds_light(plan, tracer_scene, panels, event):
            notes.append(
                f"view {view.id} begins black, as far as a few samples tell. Its camera may be outside of a room, or "
                "inside an object (views: camera: position and target), or the scene has no light (scene: lights, sky)"
            )
    return notes


def _finds_light(plan: Plan, tracer_scene: TracerScene, panels: Sequence[Panel], event: Event) -> bool:
    """Whether some samples of a view's panels are not black."""
    eye = PanelView(plan.view_of(panels[0]), panels[0]).eye
    tracer = Tracer(tracer_scene.under(plan.scene_of(event.view)), panels[0], eye, coherent=False)
    places = np.stack(np.meshgrid(np.arange(ACROSS) + 0.5, np.arange(DOWN) + 0.5), axis=-1).reshape(-1, 2)
    for panel in panels:
        panel_view = PanelView(plan.view_of(panel), panel)
        width, height = panel.pixels
        tracer.look_through(panel, panel_view.eye, panel_view(event))
        samples, _ = tracer.trace((places * (width / ACROSS, height / DOWN)).astype(np.float32))
        if samples["radiance"].any():
            return True
    return False
