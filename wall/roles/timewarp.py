"""Bring a framelet of another moment to this one: its pixels go with camera and objects, as stored samples do."""

from __future__ import annotations

import numpy as np

from wall.compositing.kernels import timewarp as kernels
from wall.core.data import BLANK, Event, Framelet, Rect
from wall.deepbuffer.pose import Pose
from wall.roles.plan import Plan


class Timewarp:
    """Moves framelets of the panels of one plan."""

    def __init__(self, plan: Plan) -> None:
        self._plan = plan

    def __call__(self, framelet: Framelet, event: Event, panel: int, fill: bool = False) -> Framelet:
        """A framelet of `panel` as it looks under `event`.

        Pixels that show nothing of the old framelet have no colour, infinite depth, alpha 0, or, with `fill`, show what
        is farther of what stands beside them. Positions are exact to half a pixel, as pixels move whole; to one and a
        half where a crack closed.
        """
        moved = Framelet.blank(framelet.rect, framelet.channels, encoded=framelet.encoded, order=framelet.order)
        self._move(framelet, event, panel, moved, fill=fill)
        return moved

    def fill(self, framelet: Framelet, event: Event, panel: int, out: Framelet) -> None:
        """Write to `out`, which has some of its channels, all of a framelet of `panel` as it looks under `event`.

        Pixels that show nothing of the old framelet show what is farther of what stands beside them.
        """
        for name in out.channels:
            out.channel(name)[...] = BLANK[name][0] if name in BLANK else 0
        self._move(framelet, event, panel, out, fill=True)

    def _move(self, framelet: Framelet, event: Event, panel: int, moved: Framelet, *, fill: bool) -> None:
        assert framelet.event is not None
        assert framelet.depth is not None
        rect = framelet.rect
        old, new = self._pose(framelet.event, panel, rect), self._pose(event, panel, rect)
        size = framelet.depth.shape
        object_id = framelet.object_id if framelet.object_id is not None else np.zeros(size, np.uint32)
        near, source = np.empty(size, np.float32), np.empty(size, np.int32)
        corner = np.array([rect.x, rect.y], np.float64)
        kernels.move_pixels(
            framelet.depth, object_id, old.frame, corner, old.object_from_eye, new.panel_from_object, near, source
        )
        if fill:
            kernels.fill_unseen(near, source)
        moved.event, moved.refreshed_at = event, framelet.refreshed_at
        for name in ("colour", *BLANK):
            if name in moved.channels:
                values, out = framelet.channel(name), moved.channel(name)
                kernels.gather(source.ravel(), values.reshape(source.size, -1), out.reshape(source.size, -1))
        if moved.depth is not None:
            kernels.true_depth(near, new.frame, corner, moved.depth)

    def _pose(self, event: Event, index: int, rect: Rect) -> Pose:
        panel = self._plan.layout.wall.viewports[index]
        within = Rect(x=rect.x - panel.screen[0], y=rect.y - panel.screen[1], width=rect.width, height=rect.height)
        view = self._plan.view_of(panel)
        event = view.seen(event, panel)
        moment = self._plan.scene.at(event.scene_time, event.edits)
        return Pose.of(panel, view.eye_of(panel), event.camera, moment.world_from_object, rect=within)
