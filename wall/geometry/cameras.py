"""Cameras: where the eye stands before the wall and in the world, and how it moves with time."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from wall.config.loading import Loaded
from wall.config.schema import KeyframesPathConfig, OrbitPathConfig, PathConfig
from wall.config.views import DEFAULT_FOV_DEGREES
from wall.data import Camera, Float64
from wall.geometry.curves import catmull_rom
from wall.geometry.frusta import cone_inside, distance_before
from wall.geometry.panels import Panel, Wall

AUTO_AZIMUTH = math.radians(30.0)  # a scene seen from its front right and a little above shows three sides
AUTO_ELEVATION = math.radians(20.0)
NEAREST_EYE_M = 1e-6  # nearer to a panel's plane, its pixels have no directions
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

    def camera_at(self, time: float) -> Camera:
        """The camera at a scene time (seconds). Pure: the same time gives the same camera.

        An orbit turns the still camera rigidly about the target and `up`. Keyframes move position and target
        by Catmull-Rom splines, without roll.
        """
        if isinstance(self.path, OrbitPathConfig):
            return _orbited(self.still, self.target, self.up, turns=time / self.path.period_s)
        if isinstance(self.path, KeyframesPathConfig):
            position, target = _keyframed(self.path, time)
            return look_at(position, target, self.up)
        return self.still

    def target_at(self, time: float) -> Float64:
        """(3,) world: what the camera looks at then."""
        if isinstance(self.path, KeyframesPathConfig):
            return _keyframed(self.path, time)[1]
        return self.target


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
    return _camera(eye, rotation)


def default_eye(wall: Wall, fov_degrees: float) -> Float64:
    """(3,) metres, wall frame: before a flat wall's centre, so far that its height spans `fov_degrees`."""
    corners = outline(wall)
    height = float(np.linalg.norm(corners[2] - corners[0]))
    centre = (corners[1] + corners[2]) / 2
    distance = height / 2 / math.tan(math.radians(fov_degrees) / 2)
    eye: Float64 = centre + distance * wall.panels[0].plane.normal
    return eye


def outline(wall: Wall) -> Float64:
    """(3, 3) lower left, lower right, upper left of the rectangle around a flat wall; metres, wall frame."""
    first = wall.panels[0]
    right = first.plane.per_x / np.linalg.norm(first.plane.per_x)
    up = np.cross(first.plane.normal, right)
    around = np.concatenate([panel.corners for panel in wall.panels] + [[_fourth(panel)] for panel in wall.panels])
    x, y = (around - first.corners[0]) @ right, (around - first.corners[0]) @ up
    low, high = first.corners[0] + y.min() * up, first.corners[0] + y.max() * up
    return np.array([low + x.min() * right, low + x.max() * right, high + x.min() * right])


def resolve_view(loaded: Loaded, wall: Wall, center: ArrayLike, radius: float, *, view: int = 0) -> View:
    """Decide everything a view leaves open.

    Parameters
    ----------
    loaded : the configuration; view : which of its views; wall : its panels
    center, radius : (3,) float64 and float, world: a sphere around the whole scene, for a camera placed
    automatically

    Raises
    ------
    ConfigError : a wall that is not flat has no eye, or the eye is behind a panel
    """
    config = loaded.config.views[view]
    eye = _eye(loaded, wall, view)
    up = _unit(np.array(config.camera.up, dtype=np.float64), otherwise=(0.0, 1.0, 0.0))
    if config.camera.position is not None and config.camera.target is not None:
        target = np.array(config.camera.target, dtype=np.float64)
        still = look_at(config.camera.position, target, up)
    else:
        target = np.array(center, dtype=np.float64)
        still = framed(wall, eye, target, radius=radius, up=up)
    for vector in (eye, target, up):
        vector.setflags(write=False)
    return View(
        id=config.id,
        eye=eye,
        refresh_hz=config.refresh_hz,
        target=target,
        up=up,
        spread=_spread(window_ahead(wall, eye), eye),
        still=still,
        path=config.path,
        predicted=config.prediction == "velocity",
        display_delay_s=1.0 / config.refresh_hz if config.display_delay_s is None else config.display_delay_s,
    )


def _eye(loaded: Loaded, wall: Wall, view: int) -> Float64:
    config = loaded.config.views[view]
    if config.eye is None and not wall.flat:
        message = "the wall is not flat, so the eye's place is needed"
        raise loaded.error(("views", view), message, "eye: [x, y, z] in metres")
    if config.eye is None:
        return default_eye(wall, config.camera.fov or DEFAULT_FOV_DEGREES)
    eye = np.array(config.eye, dtype=np.float64)
    for panel in wall.panels:
        before = distance_before(panel, eye)
        if before < NEAREST_EYE_M:
            where = f"is {-before:.3g} m behind" if before < -NEAREST_EYE_M else "is in the plane of"
            accepted = "a point that sees the front of every panel"
            raise loaded.error(("views", view, "eye"), f"{where} panel {panel.id}", accepted)
    return eye


def framed(wall: Wall, eye: Float64, center: Float64, *, radius: float, up: Float64) -> Camera:
    """The camera that sees a sphere (world) whole: in a flat wall, else in the panel before the eye.

    The centre is seen in the middle of that rectangle, from 30 degrees to the right and 20 degrees above.
    """
    corners = window_ahead(wall, eye)
    axis = _unit((corners[1] + corners[2]) / 2 - eye, otherwise=(0.0, 0.0, -1.0))
    half_angle = min(cone_inside(corners, eye, axis), WIDEST_CONE)
    size = radius if radius > 0 and math.isfinite(radius) else 1.0
    distance = size / math.sin(half_angle)
    ahead, right = _ground_axes(up)
    level = math.sin(AUTO_AZIMUTH) * right - math.cos(AUTO_AZIMUTH) * ahead
    towards_eye = math.cos(AUTO_ELEVATION) * level + math.sin(AUTO_ELEVATION) * up
    rotation = look_at(towards_eye, np.zeros(3), up).rotation()
    return _camera(center - distance * (rotation @ axis), rotation)


def window_ahead(wall: Wall, eye: Float64) -> Float64:
    """(3, 3) lower left, lower right, upper left of what the eye looks through; metres, wall frame.

    All of a flat wall; of another the panel nearest to straight ahead (-z of the wall's frame).
    """
    if wall.flat:
        return outline(wall)
    middles = [(panel.corners[1] + panel.corners[2]) / 2 - eye for panel in wall.panels]
    ahead = int(np.argmin([_unit(middle, otherwise=(0.0, 0.0, -1.0))[2] for middle in middles]))
    return wall.panels[ahead].corners


def _spread(corners: Float64, eye: Float64) -> float:
    """Height of a rectangle over the eye's distance to its plane."""
    up, right = corners[2] - corners[0], corners[1] - corners[0]
    normal = np.cross(right, up) / (np.linalg.norm(right) * np.linalg.norm(up))
    return float(np.linalg.norm(up) / abs((eye - corners[0]) @ normal))


def _ground_axes(up: Float64) -> tuple[Float64, Float64]:
    """Two level unit vectors: ahead (-z where y is up) and right."""
    ahead = np.array([0.0, 0.0, -1.0]) if abs(up[2]) < 0.9 else np.array([0.0, 1.0, 0.0])
    ahead = _unit(ahead - (ahead @ up) * up, otherwise=(0.0, 0.0, -1.0))
    return ahead, np.cross(ahead, up)


def _fourth(panel: Panel) -> Float64:
    corner: Float64 = panel.corners[1] + panel.corners[2] - panel.corners[0]
    return corner


def _orbited(camera: Camera, target: Float64, up: Float64, *, turns: float) -> Camera:
    turn = rotation_about(up, 2 * math.pi * (turns % 1.0))
    return _camera(target + turn @ (camera.origin() - target), turn @ camera.rotation())


def _keyframed(path: KeyframesPathConfig, time: float) -> tuple[Float64, Float64]:
    times = [k.time for k in path.keyframes]
    position = catmull_rom(times, [k.position for k in path.keyframes], time, loop=path.loop)
    return position, catmull_rom(times, [k.target for k in path.keyframes], time, loop=path.loop)


def rotation_about(axis: Float64, angle: float) -> Float64:
    """(3, 3): the turn by `angle` radians about a unit axis, counterclockwise from its tip (Rodrigues)."""
    x, y, z = axis
    skew = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    turn: Float64 = np.eye(3) + math.sin(angle) * skew + (1.0 - math.cos(angle)) * (skew @ skew)
    return turn


def _camera(position: Float64, rotation: Float64) -> Camera:
    x, y, z = (float(v) for v in position)
    return Camera(position=(x, y, z), world_from_wall=tuple(float(v) for v in rotation.ravel()))


def _unit(vector: Float64, *, otherwise: tuple[float, float, float]) -> Float64:
    length = float(np.linalg.norm(vector))
    if not length > 0.0 or not math.isfinite(length):
        return np.array(otherwise, dtype=np.float64)
    found: Float64 = vector / length
    return found
