"""The tracker of one view: its packets in, the viewer's eye out. Packets are checked here; see geometry.tracking."""

from __future__ import annotations

import numpy as np

from wall.core.errors import RemoteProtocolError
from wall.geometry.tracking import NEAREST_M, Planes, Position, TrackedEye, wall_from_tracker
from wall.packets.osc import positions
from wall.roles.instructions import TrackerPacket
from wall.roles.plan import Plan


class Tracker:
    """The eye of one view. Without `tracking` of that view it never moves."""

    def __init__(self, plan: Plan, view: int) -> None:
        self._config = plan.layout.config.views[view].tracking
        shown = plan.views[view]
        panels = [panel for panel in plan.layout.wall.of_view(view).panels if panel.config.eye is None]
        normals = np.array([panel.plane.normal for panel in panels]).reshape(-1, 3)
        # an eye beside the tracked one may be nearer by its part of their distance
        beside = [abs(panel.shift * shown.eye_separation * panel.plane.normal[0]) for panel in panels]
        corners = np.array([panel.corners[0] for panel in panels]).reshape(-1, 3)
        planes = Planes(normals, (normals * corners).sum(axis=1) + NEAREST_M + np.array(beside))
        ahead_s = shown.display_delay_s + 0.5 / shown.refresh_hz if shown.predicted else None
        self.key = (self._config, shown.eye.tolist(), planes.normals.tolist(), planes.nearest.tolist(), ahead_s)
        self._eye = TrackedEye(shown.eye, planes, ahead_s=ahead_s)

    def take(self, packet: TrackerPacket) -> str:
        """Take in a packet. Returns the counter of what was left out, "" where nothing was."""
        config = self._config
        if config is None or config.port != packet.port or config.source != packet.source:
            return ""
        try:
            told = positions(packet.data, config.address, config.first)
        except RemoteProtocolError:
            return "tracker_bad_packet"
        left_out = [self._eye.take(wall_from_tracker(config, each), packet.time, config.delay_s) for each in told[-1:]]
        return "".join(left_out)

    def eye(self, now: float) -> Position:
        """From the view's own eye to the viewer's, metres, wall frame, when what is told now becomes light."""
        return self._eye.at(now) if self._config is not None else (0.0, 0.0, 0.0)
