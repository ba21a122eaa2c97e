"""Cameras: where the eye stands before the wall and in the world, and how it moves with time."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from wall.config.loading import Loaded, nearest
from wall.config.views import KeyframesPathConfig, OrbitPathConfig, PathConfig
from wall.core.data import STILL, Camera, Event, Float64
from wall.geometry.curves import catmull_rom
from wall.geometry.eyes import default_eye as default_eye
from wall.geometry.eyes import eye_of, standing_eye
from wall.geometry.frusta import cone_inside
from wall.geometry.lens import NamedCamera
from wall.geometry.moving import MovingEvent
from wall.geometry.panels import Panel, Wall
from wall.geometry.twist import rotation_by

AUTO_AZIMUTH = math.radians(30.0)  # a scene seen from its front right and a little above shows three sides
AUTO_ELEVATION = math.radians(20.0)
NEAREST_TARGET = 0.1  # radii of the scene, where a named camera has nothing ahead
NARROWEST_UNION = 0.6  # of the cone into one panel: so narrow a cone into several side by side is as good
WIDEST_CONE = math.radians(80.0)  # beyond it the eye would stand inside the scene


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class View:
    """A view with everything decided: where the eye is before the wall, and its camera at any time."""

    id: str
    eye: Float64  # (3,) metres, wall frame
    refresh_hz: float
    target: Float64  # (3,) world; what the camera looks at, and steering turns about, at time 0
    up: Float64  # (3,) world, unit
    spread: float  # height of the wall (metres) over the eye's distance to it
    still: Camera  # the camera without its path
    path: PathConfig | None
    predicted: bool  # to the moment of display
    display_delay_s: float  # from a refresh to its light
    eye_separation: float  # metres from the left eye to the right one
    scale: float  # world units a metre of the wall
    leader: View | None = None  # whose camera it has
    clock: View | None = None  # whose time it has, shifted; None: it has a time of its own
    offset_s: float = 0.0  # that are added to that time, or at which its own begins
    runs: bool = True  # whether its own time goes on at first

    def time_after(self, seconds: float) -> float:
        """The scene time that it shows so long after a run began whose time nobody steers."""
        since = seconds * self.runs if self.clock is None else self.clock.time_after(seconds)
        return max(0.0, since + self.offset_s)

    @property
    def timing(self) -> tuple[str, tuple[float, ...]]:
        """The view whose time it has, and by how many seconds that is shifted, one after another: none goes below 0.

        It is the same for views of one time.
        """
        if self.clock is None:
            return self.id, ()
        whose, shifts = self.clock.timing
        return whose, (*shifts, self.offset_s) if self.offset_s else shifts

    def camera_after(self, seconds: float) -> Camera:
        """The camera then: where it follows another view's, that is where that view's time has it."""
        steered = self
        while steered.leader is not None:
            steered = steered.leader
        return steered.camera_at(steered.time_after(seconds))

    def camera_at(self, time: float) -> Camera:
        """The camera at a scene time (seconds). Pure: the same time gives the same camera.

        An orbit turns the still camera rigidly about the target and `up`. Keyframes move position and target
        by Catmull-Rom splines, without roll.
        """
        if self.leader is not None:
            return self.leader.camera_at(time)
        if isinstance(self.path, OrbitPathConfig):
            turn = rotation_by(2 * math.pi * (time / self.path.period_s % 1.0) * self.up)
            away = self.still.origin() - self.target
            return Camera.of(self.target + turn @ away, turn @ self.still.rotation())
        if isinstance(self.path, KeyframesPathConfig):
            position, target = _keyframed(self.path, time)
            return look_at(position, target, self.up)
        return self.still

    def target_at(self, time: float) -> Float64:
        """(3,) world: what the camera looks at then."""
        if self.leader is not None:
            return self.leader.target_at(time)
        if isinstance(self.path, KeyframesPathConfig):
            return _keyframed(self.path, time)[1]
        return self.target

    def eye_of(self, panel: Panel) -> Float64:
        """(3,) metres, wall frame: who looks at a panel. The view's own eye, unless the panel says otherwise."""
        return eye_of(panel, self.eye, self.eye_separation)

    def offset(self, panel: Panel) -> Float64:
        """(3,) float64, world units, wall frame: from the view's eye in the world to the one that sees a panel."""
        offset: Float64 = (self.eye_of(panel) - self.eye) * self.scale
        return offset

    def seen(self, event: Event, panel: Panel) -> Event:
        """The event as the eye sees it that looks at a panel. A panel's own eye stays where it is, tracked or not."""
        tracked = event.camera.eye
        if panel.config.eye is None or not any(tracked):
            return seen_from(event, self.offset(panel))
        seen = seen_from(event, self.offset(panel) - self.scale * np.array(tracked))
        return replace(seen, camera=replace(seen.camera, eye=STILL.eye))


def seen_from(event: Event, offset: Float64) -> Event:
    """The event as an eye sees it that stands `offset` (3,) from the camera: world units, wall frame.

    The same object where it stands in the camera itself.
    """
    if not offset.any():
        return event
    rotation = event.camera.rotation()
    camera = Camera.of(event.camera.origin() + rotation @ offset, rotation)
    seen = replace(event, camera=replace(camera, eye=event.camera.eye))
    if isinstance(seen, MovingEvent):
        turn, shift = np.array(seen.twist[:3]), np.array(seen.twist[3:])
        return replace(seen, twist=(*turn.tolist(), *(shift + np.cross(turn, offset)).tolist()))
    return seen


class PanelView:
    """A view as one panel shows it: the eye that looks at the panel, and events with that eye's camera.

    The same event gives the same object.
    """

    def __init__(self, view: View, panel: Panel) -> None:
        """`eye` becomes (3,) metres, wall frame."""
        self.eye = view.eye_of(panel)
        self._view, self._panel = view, panel
        self._newest: tuple[Event, Event] | None = None

    def __call__(self, event: Event) -> Event:
        """The event with its camera moved to the panel's eye."""
        if self._newest is None or self._newest[0] is not event:
            self._newest = (event, self._view.seen(event, self._panel))
        return self._newest[1]


def look_at(position: ArrayLike, target: ArrayLike, up: ArrayLike) -> Camera:
    """The camera at `position` whose wall frame's -z points to `target`, its y as near to `up` as may be.

    All (3,) float64, world. An `up` along the line of sight is replaced by the axis farthest from it; a
    target at the position itself counts as one along -z.
    """
    eye = np.asarray(position, dtype=np.float64)
    forward = _unit(np.asarray(target, dtype=np.float64) - eye, otherwise=(0.0, 0.0, -1.0))
    right = np.cross(forward, _unit(np.asarray(up, dtype=np.float64), otherwise=(0.0, 1.0, 0.0)))
    if np.linalg.norm(right) < 1e-9:
        right = np.cross(forward, np.eye(3)[int(np.argmin(np.abs(forward)))])
    right /= np.linalg.norm(right)
    rotation = np.stack([right, np.cross(right, forward), -forward], axis=1)
    return Camera.of(eye, rotation)


def resolve_view(
    loaded: Loaded,
    wall: Wall,
    center: ArrayLike,
    radius: float,
    *,
    view: int = 0,
    cameras: Sequence[NamedCamera] = (),
    leaders: Mapping[str, View] | None = None,
) -> View:
    """Decide everything a view leaves open.

    Parameters
    ----------
    loaded : the configuration; view : which of its views; wall : its panels
    center, radius : (3,) float64 and float, world: a sphere around the whole scene, for a camera placed
    automatically
    cameras : those of the scene's source, for views that name one; leaders : views before this one, by id

    Raises
    ------
    ConfigError : a wall that is not flat has no eye, an eye is behind a panel, or a camera of that name is not there
    """
    config = loaded.config.views[view]
    leaders = leaders or {}
    leader = None if config.camera.follow is None else leaders.get(config.camera.follow)
    clock, time = next(iter(leaders.values()), None), config.time
    if time is not None:
        clock = None if time.follow is None else leaders.get(time.follow)
    named = None if config.camera.name is None else _named(loaded, view, config.camera.name, cameras)
    eye = standing_eye(loaded, wall, view, *(() if named is None else (named.fov,)))
    up = _unit(np.array(config.camera.up, dtype=np.float64), otherwise=(0.0, 1.0, 0.0))
    if config.camera.position is not None and config.camera.target is not None:
        target = np.array(config.camera.target, dtype=np.float64)
        still = look_at(config.camera.position, target, up)
    elif leader is not None:
        target, still = leader.target, leader.still
    elif named is not None:
        pose = named.world_from_camera
        still = Camera.of(pose[:3, 3], pose[:3, :3])
        away = float((np.asarray(center) - pose[:3, 3]) @ -pose[:3, 2])  # of the scene's middle, ahead
        target = pose[:3, 3] - max(away, NEAREST_TARGET * radius) * pose[:3, 2]
    else:
        target = np.array(center, dtype=np.float64)
        still = framed(wall, eye, target, radius=radius, up=up, direction=config.camera.direction)
    for vector in (eye, target, up):
        vector.setflags(write=False)
    window = wall.window_ahead(eye)
    made = View(
        id=config.id,
        eye=eye,
        refresh_hz=config.refresh_hz,
        target=target,
        up=up,
        spread=_spread(window, eye),
        still=still,
        path=config.path,
        predicted=config.prediction == "velocity",
        display_delay_s=config.light_after_s,
        eye_separation=config.eye_separation,
        scale=1.0 if config.scale is None else config.scale,
        leader=leader,
        clock=clock,
        offset_s=0.0 if time is None else time.offset_s,
        runs=time is None or not time.paused,
    )
    if config.scale is None:
        return replace(made, scale=_scale(window, eye, made.camera_after(0.0), made.target_at(made.time_after(0.0))))
    return made


def _named(loaded: Loaded, view: int, name: str, cameras: Sequence[NamedCamera]) -> NamedCamera:
    """The source's camera of a name."""
    found = next((camera for camera in cameras if camera.name == name), None)
    if found is None:
        known = ", ".join(sorted({camera.name for camera in cameras}))
        said = f"{known}{nearest(name, known.split(', '))}" if known else "no name: the scene's source has no cameras"
        raise loaded.error(("views", view, "camera", "name"), "there is no such camera", said)
    return found


def framed(
    wall: Wall, eye: Float64, center: Float64, *, radius: float, up: Float64, direction: ArrayLike | None = None
) -> Camera:
    """The camera that sees a sphere (world) whole: in a flat wall, else in the panels before the eye.

    These are those that are about as near to straight ahead as the nearest one, side by side, or this one alone, where
    much more room is in it. The centre is seen in the middle, along `direction` (3,), by default from 30 degrees to the
    right and 20 degrees above.
    """
    windows = wall.windows_ahead(eye)
    cones = []
    for some in (windows[:1], windows):
        ways = [_unit((corners[1] + corners[2]) / 2 - eye, otherwise=(0.0, 0.0, -1.0)) for corners in some]
        axis = _unit(np.mean(ways, axis=0), otherwise=(0.0, 0.0, -1.0))
        cones.append((min(cone_inside(some, eye, axis), WIDEST_CONE), axis))
    half_angle, axis = cones[0] if cones[1][0] < NARROWEST_UNION * cones[0][0] else cones[1]
    size = radius if radius > 0 and math.isfinite(radius) else 1.0
    distance = size / math.sin(half_angle)
    if direction is None:
        ahead, right = _ground_axes(up)
        level = math.sin(AUTO_AZIMUTH) * right - math.cos(AUTO_AZIMUTH) * ahead
        direction = -math.cos(AUTO_ELEVATION) * level - math.sin(AUTO_ELEVATION) * up
    rotation = look_at(np.zeros(3), direction, up).rotation()
    return Camera.of(center - distance * (rotation @ axis), rotation)


def _spread(corners: Float64, eye: Float64) -> float:
    """Height of a rectangle over the eye's distance to its plane."""
    up, right = corners[2] - corners[0], corners[1] - corners[0]
    normal = np.cross(right, up) / (np.linalg.norm(right) * np.linalg.norm(up))
    return float(np.linalg.norm(up) / abs((eye - corners[0]) @ normal))


def _scale(corners: Float64, eye: Float64, camera: Camera, target: Float64) -> float:
    """World units a metre, such that a target (3,) in the world stands in the plane of a rectangle before the eye.

    A target that is not before the eye counts as one straight ahead, as far away.
    """
    normal = _unit(np.cross(corners[1] - corners[0], corners[2] - corners[0]), otherwise=(0.0, 0.0, 1.0))
    away = camera.rotation().T @ (target - camera.origin())
    distance, depth, length = float((eye - corners[0]) @ normal), float(-away @ normal), float(np.linalg.norm(away))
    return (depth if depth > 1e-3 * length else length) / distance


def _ground_axes(up: Float64) -> tuple[Float64, Float64]:
    """Two level unit vectors: ahead (-z where y is up) and right."""
    ahead = np.array([0.0, 0.0, -1.0]) if abs(up[2]) < 0.9 else np.array([0.0, 1.0, 0.0])
    ahead = _unit(ahead - (ahead @ up) * up, otherwise=(0.0, 0.0, -1.0))
    return ahead, np.cross(ahead, up)


def _keyframed(path: KeyframesPathConfig, time: float) -> tuple[Float64, Float64]:
    times = [k.time for k in path.keyframes]
    position = catmull_rom(times, [k.position for k in path.keyframes], time, loop=path.loop)
    return position, catmull_rom(times, [k.target for k in path.keyframes], time, loop=path.loop)


def _unit(vector: Float64, *, otherwise: tuple[float, float, float]) -> Float64:
    length = float(np.linalg.norm(vector))
    if not length > 0.0 or not math.isfinite(length):
        return np.array(otherwise, dtype=np.float64)
    found: Float64 = vector / length
    return found
