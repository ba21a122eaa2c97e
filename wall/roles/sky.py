"""A `sky` node at work: what a panel sees where nothing is, made anew when the camera turns."""

from __future__ import annotations

import numpy as np

from wall.compositing.executor import Regions
from wall.compositing.graph import Step
from wall.config.graph import SkyNode
from wall.core.data import Camera, Event
from wall.core.tone_mapping import Tone
from wall.geometry.cameras import PanelView
from wall.geometry.frusta import ray_frame
from wall.reconstruction.channels import blank_framelet, show_sky
from wall.roles.plan import Plan
from wall.scene.model import Sky


class SkyLayer:
    """Layer that shows the scene's sky on one panel as seen by the newest camera."""

    def __init__(self, plan: Plan, step: Step) -> None:
        assert isinstance(step.node, SkyNode)
        self._plan, self._panel = plan, plan.layout.wall.panel(step.node.panel)
        self.view, self._panel_view = self._panel.view, PanelView(plan.view_of(self._panel), self._panel)
        self.framelet = blank_framelet(self._panel, step.channels, encoded=step.encoded, order=step.order)
        self._shown: tuple[Camera, Sky, float, Tone] | None = None

    def refresh(self, event: Event, now: float) -> Regions:
        """Bring the framelet to what `event` sees. Returns what changed."""
        shading, shown = self._plan.scene.shading(event.scene_time, event.edits), self._shown
        news = shading.sky, shading.environment_strength, event.tone
        same = shown is not None and shown[1:] == news
        camera = self._panel_view(event).camera
        if same and shown is not None and _turned_alike(camera, shown[0]):
            return []  # it is the same from everywhere
        self._shown = camera, *news
        frame = ray_frame(self._panel, self._panel_view.eye, camera)
        corner, environment = np.array(self._panel.screen, np.float64), self._plan.scene.environment
        show_sky(
            shading.sky, environment, frame, corner, self.framelet,
            tone=event.tone, strength=shading.environment_strength,
        )  # fmt: skip
        return [self.framelet.rect]


def _turned_alike(camera: Camera, shown: Camera) -> bool:
    """Whether two cameras see the same directions in every pixel."""
    return (camera.world_from_wall, camera.eye) == (shown.world_from_wall, shown.eye)
