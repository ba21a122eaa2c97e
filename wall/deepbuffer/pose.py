"""Where everything is under one event: matrices from hits to object space and to image pixels, and the lights."""

from __future__ import annotations

import math
import operator
from typing import NamedTuple, Protocol

import numpy as np

from wall.core.data import Camera, Edits, Event, Float32, Float64, Rect
from wall.deepbuffer.kernels.reproject import object_tables
from wall.deepbuffer.lights import NO_LIGHTS, ObjectLights
from wall.geometry.frusta import ray_frame
from wall.geometry.panels import Panel
from wall.scene.build import Scene
from wall.scene.model import Moment, Shading

SAME_TURN = 1e-9  # of a matrix element; packets bring a rotation back to 1e-15


class Pose(NamedTuple):
    """The matrices of one event, for an image of a panel or of a part of it; see object_tables."""

    frame: Float64  # (3, 3), see geometry.frusta.ray_frame
    corner: Float64  # (2,) of the panel, virtual-screen pixels
    object_from_eye: Float32  # (n + 1, 12)
    panel_from_object: Float32  # (n + 1, 12)
    lights: ObjectLights

    @classmethod
    def of(
        cls,
        panel: Panel,
        eye: Float64,
        camera: Camera,
        world_from_object: Float64,
        *,
        rect: Rect | None = None,
        lights: ObjectLights = NO_LIGHTS,
    ) -> Pose:
        """`world_from_object` (n, 4, 4); `rect` is the part of the panel that the image shows, all if None."""
        n = len(world_from_object)
        frame, corner = ray_frame(panel, eye, camera), np.array(panel.screen, np.float64)
        object_from_eye = np.empty((n + 1, 12), np.float32)
        panel_from_object = np.empty((n + 1, 12), np.float32)
        origin = corner if rect is None else corner + np.array([rect.x, rect.y])
        object_tables(world_from_object, camera.origin(), frame, origin, object_from_eye, panel_from_object)
        return cls(frame, corner, object_from_eye, panel_from_object, lights)

    @classmethod
    def at(cls, panel: Panel, eye: Float64, scene: Scene, camera: Camera, scene_time: float) -> Pose:
        """Of a whole panel, with every object where it is at `scene_time`."""
        return cls.of(panel, eye, camera, scene.at(scene_time).world_from_object)

    @property
    def pixel(self) -> float:
        """Longer edge of a pixel over its distance: by how much depths differ across it, of a surface at 45 degrees."""
        first, across, down = self.frame.tolist()  # three numbers each: NumPy takes ten times as long
        axis = [across[k - 2] * down[k - 1] - across[k - 1] * down[k - 2] for k in range(3)]
        edge, along = max(math.hypot(*across), math.hypot(*down)), float(sum(map(operator.mul, first, axis)))
        return edge * math.hypot(*axis) / max(abs(along), math.ulp(0.0))


class Posed(Protocol):
    """What fixes where everything is: an Event, or a Batch that was traced under one."""

    @property
    def camera(self) -> Camera:
        """The camera of the event."""

    @property
    def scene_time(self) -> float:
        """Time of the scene's animation, in seconds."""

    @property
    def camera_event(self) -> int:
        """Number of the camera event."""

    @property
    def scene_event(self) -> int:
        """Number of the scene event."""

    @property
    def edits(self) -> Edits:
        """Edits of the scene."""


class Poses:
    """Makes the poses of one image and keeps the newest of them: many batches share one."""

    def __init__(
        self, panel: Panel, eye: Float64, scene: Scene, rect: Rect, *, objects: bool = True, lit: bool
    ) -> None:
        """Without `objects` none ever moves; `lit`: poses bring the lights."""
        self._panel, self._eye, self._scene, self._rect = panel, eye, scene, rect
        self._objects, self._lit = objects, lit
        self._key: tuple[Camera, float, Edits] | None = None
        self._newest: Pose
        self._moment: Moment | None = None

    def of(self, event: Posed) -> Pose:
        """The pose of an event; the lights are the same object while nothing changes in the scene."""
        key = (event.camera, event.scene_time, event.edits)
        if self._key != key:
            moment = self._scene.at(event.scene_time, event.edits)
            lights = NO_LIGHTS
            if self._lit:
                lights = self._newest.lights if moment is self._moment else ObjectLights.at(self._scene, moment)
            self._newest = Pose.of(
                self._panel, self._eye, event.camera, self._placed(moment), rect=self._rect, lights=lights
            )
            self._key, self._moment = key, moment
        return self._newest

    def table(self, event: Posed) -> Float32:
        """(n + 1, 12) float32: panel_from_object of an event, whose pose is not kept."""
        return self._table(event.camera, self._scene.at(event.scene_time, event.edits))

    def seen_by(self, camera: Camera) -> Float32:
        """(n + 1, 12) float32: panel_from_object of a camera, where objects stay as the newest pose has them.

        Only after the first pose: finding every object's place anew takes many times as long.
        """
        assert self._moment is not None
        return self._table(camera, self._moment)

    def _table(self, camera: Camera, moment: Moment) -> Float32:
        placed = self._placed(moment)
        return Pose.of(self._panel, self._eye, camera, placed, rect=self._rect).panel_from_object

    def _placed(self, moment: Moment) -> Float64:
        """(n, 4, 4) float64, world from object: at rest where no object is ever followed."""
        return moment.world_from_object if self._objects else self._scene.rest[: len(self._scene.instances)]

    def shading(self, event: Posed) -> Shading:
        """The shading that an event, or samples, saw."""
        return self._scene.shading(event.scene_time, event.edits)


def same_camera(event: Posed, shown: Event | None) -> bool:
    """Whether samples were traced from where the image is seen: what they hit is visible in it, unless objects move."""
    if shown is None or (event.camera.position, event.camera.eye) != (shown.camera.position, shown.camera.eye):
        return False
    turned = zip(event.camera.world_from_wall, shown.camera.world_from_wall, strict=True)
    return max(abs(a - b) for a, b in turned) < SAME_TURN


def is_shown(event: Posed, shown: Event | None) -> bool:
    """Whether samples belong to the very image that is shown; a predicted pose has its event's number too."""
    if shown is None or (event.camera_event, event.scene_event) != shown.number:
        return False
    return event.scene_time == shown.scene_time and same_camera(event, shown)
