"""Where everything is under one event: object points to panel pixels and back, and the lamps beside them."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from wall.core.data import Camera, Event, Float64, Rect
from wall.deepbuffer.kernels.reproject import object_tables
from wall.geometry.frusta import ray_frame
from wall.geometry.panels import Panel
from wall.reconstruction.lamps import NO_LAMPS, Lamps
from wall.scene.build import Scene

SAME_TURN = 1e-9  # of a matrix element; packets bring a rotation back to 1e-15


class Pose:
    """The matrices of one event: object points to panel pixels (of a rectangle), and back from hits."""

    def __init__(
        self,
        panel: Panel,
        eye: Float64,
        scene: Scene,
        camera: Camera,
        scene_time: float,
        rect: Rect | None = None,
        *,
        objects: bool = True,
        lamps: bool = False,
        last: Pose | None = None,
    ) -> None:
        """`rect` is the part of the panel that is pictured, all if None.

        Without `objects` none ever moves; with `lamps` theirs are taken along, from `last` if nothing moved since.
        """
        n, moment = len(scene.instances), scene.at(scene_time)
        placed = moment.world_from_object if objects else scene.rest[:n]
        self.frame = ray_frame(panel, eye, camera)
        self.corner = np.array(panel.screen, np.float64)
        self.object_from_eye = np.empty((n + 1, 12), np.float32)
        self.panel_from_object = np.empty((n + 1, 12), np.float32)
        corner = self.corner if rect is None else self.corner + np.array([rect.x, rect.y])
        object_tables(placed, camera.origin(), self.frame, corner, self.object_from_eye, self.panel_from_object)
        self._moment = moment
        same = last is not None and last._moment is moment
        self.lamps: Lamps = last.lamps if last is not None and same else Lamps.at(scene, moment) if lamps else NO_LAMPS


class Posed(Protocol):
    """What fixes where everything is: an Event, or a Batch that was traced under one."""

    @property
    def camera(self) -> Camera: ...

    @property
    def scene_time(self) -> float: ...

    @property
    def camera_event(self) -> int: ...

    @property
    def scene_event(self) -> int: ...


class Poses:
    """The poses of one picture, the newest of them kept: many batches share one."""

    def __init__(
        self, panel: Panel, eye: Float64, scene: Scene, rect: Rect, *, objects: bool = True, lamps: bool
    ) -> None:
        """See Pose."""
        self._panel, self._eye, self._scene, self._rect = panel, eye, scene, rect
        self._objects, self._lamps = objects, lamps
        self._newest: tuple[tuple[Camera, float], Pose] | None = None

    def of(self, event: Posed) -> Pose:
        key = (event.camera, event.scene_time)
        if self._newest is None or self._newest[0] != key:
            last = self._newest[1] if self._newest else None
            made = Pose(
                self._panel, self._eye, self._scene, *key, self._rect, objects=self._objects, lamps=self._lamps,
                last=last,
            )  # fmt: skip
            self._newest = (key, made)
        return self._newest[1]


def is_shown(event: Posed, shown: Event | None) -> bool:
    """Whether samples belong to the very picture that is shown; a foreseen pose has its event's number too."""
    if shown is None or (event.camera_event, event.scene_event) != shown.number:
        return False
    turned = zip(event.camera.world_from_wall, shown.camera.world_from_wall, strict=True)
    same = (event.scene_time, event.camera.position) == (shown.scene_time, shown.camera.position)
    return same and max(abs(a - b) for a, b in turned) < SAME_TURN
