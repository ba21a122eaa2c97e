"""Steering by hand: the commands of pages and windows, their only parser, and what they do to the camera. Pure."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Literal, TypeAlias, get_args

import numpy as np
from numpy.typing import ArrayLike

from wall.config.sampling import METHODS
from wall.config.views import MOST_VIEWS
from wall.core.data import Camera, Float64
from wall.core.errors import RemoteProtocolError
from wall.geometry.cameras import View, look_at

Kind: TypeAlias = Literal[
    "orbit", "pan", "zoom", "pause", "sampler", "reset", "compare", "statistics", "set", "expose", "focus",
    "select", "undo", "seek", "bookmark", "recall",
]  # fmt: skip
Vector: TypeAlias = tuple[float, float, float]

STEEPEST = math.radians(89.0)  # at the pole itself "up" has no direction, and beyond it the image would flip
ZOOM_RANGE = 1000.0  # times nearer or farther than where steering began
MAX_ZOOM = 64.0  # factor of one command; page/steering.js has the same
MAX_SEEK_S = 3600.0  # of one command
MAX_DRAG = 10.0  # wall heights of one command, which sums the drags of one animation frame; page/steering.js too
ORBIT_PER_HEIGHT = math.pi  # a drag over the whole height looks from the other side
LONGEST_NAME, MOST_NUMBERS, LARGEST = 255, 16, 1e300  # of a parameter, of its value, of each
BOOKMARKS = tuple("123456789")
OF_ONE_VIEW = ("orbit", "pan", "zoom", "reset", "sampler")  # kinds that may name a view by its index, else the first
OF_ONE_TIME = ("pause", "seek")  # likewise, else every view
EVERY_VIEW = -1
NUMBERS: dict[str, tuple[str, ...]] = {
    "orbit": ("x", "y"), "pan": ("x", "y"), "zoom": ("x",), "expose": ("x",), "seek": ("x",),
    "focus": ("x", "y"), "select": ("x", "y"),
}  # fmt: skip
VALUES: dict[str, tuple[str, ...]] = {
    "sampler": METHODS,
    "compare": ("", *(method for method in METHODS if method != "adaptive")),
    "statistics": ("", "on"),
    "bookmark": BOOKMARKS,
    "recall": BOOKMARKS,
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Command:
    """One steering command of a viewer.

    orbit, pan: x and y are drags in fractions of the wall's height, x to the right, y down. zoom: x is the
    factor by which things grow. pause: stops or resumes; with `value` "on" or "off" it is one of both. sampler: `value`
    is one of METHODS. reset: back to the path. compare: `value` gets half of the rays, the adaptive sampler the other,
    "" ends that. statistics: "on" has compositors look at their samples, "" ends that. set: the parameter `value` is to
    be `numbers`, None as configured.
    expose: x is added to the exposure, stops. focus: what is shown at (x, y), fractions of the wall's width and height
    from its top left, is to be in focus. seek: x seconds are added to the time of the scene and of camera paths.
    select: pages are to show the parameters of the object at (x, y). undo: the newest edit is taken back.
    bookmark: the cameras of all views are kept as `value`; recall: they go back there. Kinds of OF_ONE_VIEW and
    OF_ONE_TIME are for `view` alone, or for the view whose camera or time it has.
    """

    kind: Kind
    x: float = 0.0
    y: float = 0.0
    value: str = ""
    numbers: tuple[float, ...] | None = None
    view: int = 0  # whom a kind of OF_ONE_VIEW or OF_ONE_TIME is for; the others are for every view


def parse(message: object) -> Command:
    """The command of a page's or a window's message: a mapping of `kind` and that kind's fields.

    Raises RemoteProtocolError for whatever is not exactly a command.
    """
    kind = message.get("kind") if isinstance(message, Mapping) else None
    if not isinstance(message, Mapping) or not isinstance(kind, str) or kind not in get_args(Kind):
        raise RemoteProtocolError(f"command kind {_short(kind)}: want one of {', '.join(get_args(Kind))}")
    if kind == "set":
        return _set_command(message)
    wanted, view = NUMBERS.get(kind, ("value",) if kind in VALUES else ()), message.get("view", 0)
    if kind in OF_ONE_TIME and "view" not in message:
        view = EVERY_VIEW
    elif type(view) is not int or not 0 <= view < MOST_VIEWS:
        raise RemoteProtocolError(f"command {kind}: view = {_short(view)}: want a number from 0 to {MOST_VIEWS - 1}")
    if kind == "pause" and message.keys() - {"view"} == {"kind", "paused"}:
        return _pause_command(message["paused"], view)
    if set(message) - {"kind", *(["view"] if kind in OF_ONE_VIEW + OF_ONE_TIME else [])} != set(wanted):
        got = ", ".join(sorted(_short(key) for key in message if key != "kind")) or "nothing"
        raise RemoteProtocolError(f"command {kind} came with {got}: want {', '.join(wanted) or 'nothing'}")
    if kind in VALUES and message["value"] not in VALUES[kind]:
        known = ", ".join(value or "nothing" for value in VALUES[kind])
        raise RemoteProtocolError(f"command {kind} {_short(message['value'])}: want one of {known}")
    numbers = {name: _number(kind, name, message[name]) for name in wanted if name != "value"}
    value = str(message["value"]) if kind in VALUES else ""
    return Command(kind=kind, value=value, view=view, **numbers)  # type: ignore[arg-type]  # kind is one of Kind by now


def _set_command(message: Mapping[Any, Any]) -> Command:
    """A parameter's name and its numbers, or null; whether there is such a one is for its owner to say."""
    name, numbers = message.get("name"), message.get("numbers")
    named = isinstance(name, str) and 0 < len(name) <= LONGEST_NAME and message.keys() == {"kind", "name", "numbers"}
    known = numbers is None or (isinstance(numbers, list) and 0 < len(numbers) <= MOST_NUMBERS)
    if not named or not known or not all(type(x) in (int, float) and abs(x) <= LARGEST for x in numbers or ()):
        raise RemoteProtocolError(f"command set {_short(name)}: want a name, and numbers or null")
    values = None if numbers is None else tuple(map(float, numbers))
    return Command(kind="set", value=str(name), numbers=values)


def _pause_command(paused: Any, view: int) -> Command:
    if not isinstance(paused, bool):
        raise RemoteProtocolError(f"command pause: paused = {_short(paused)}: want true or false, or nothing")
    return Command(kind="pause", value="on" if paused else "off", view=view)


def _number(kind: str, name: str, number: Any) -> float:
    limits = {"zoom": (1 / MAX_ZOOM, MAX_ZOOM), "seek": (-MAX_SEEK_S, MAX_SEEK_S)}
    low, high = limits.get(kind, (-MAX_DRAG, MAX_DRAG))
    is_number = isinstance(number, (int, float)) and not isinstance(number, bool)
    if not is_number or not low <= number <= high:
        raise RemoteProtocolError(f"command {kind}: {name} = {_short(number)}: want a number from {low:g} to {high:g}")
    return float(number)


def _short(value: Any) -> str:
    kinds = (str, int, float, bool, type(None))
    text = repr(value[:40] if isinstance(value, str) else value) if isinstance(value, kinds) else type(value).__name__
    return text if len(text) <= 44 else text[:41] + "..."


@dataclass(frozen=True, slots=True, kw_only=True)
class Steering:
    """A camera held by hand: it looks at a target from a distance, an azimuth and an elevation.

    Azimuth (radians) turns about `up`, counterclockwise seen from its tip; elevation (radians) is measured
    from the level plane. The camera never rolls. Every verb gives a new value.
    """

    target: Vector  # world
    distance: float  # world units
    azimuth: float
    elevation: float
    up: Vector  # world, unit
    spread: float  # the wall's height over the eye's distance to it
    nearest: float  # world units
    farthest: float

    @classmethod
    def from_camera(
        cls, camera: Camera, target: ArrayLike, *, up: ArrayLike = (0.0, 1.0, 0.0), spread: float = 0.8284271
    ) -> Steering:
        """Take over a camera without a jump.

        The held target is the point of the line of sight nearest to `target` (world), so a camera that looks
        past it keeps its direction. Only a roll about the line of sight, and a tilt above 89 degrees, are
        taken out. `spread` defaults to that of 45 degrees.
        """
        above = np.asarray(up, dtype=np.float64) / np.linalg.norm(np.asarray(up, dtype=np.float64))
        forward = -camera.rotation()[:, 2]
        span = float((np.asarray(target, dtype=np.float64) - camera.origin()) @ forward)
        if not span > 0.0:
            span = float(np.linalg.norm(np.asarray(target, dtype=np.float64) - camera.origin())) or 1.0
        first, second = _level(above)
        back = -forward
        elevation = math.asin(float(np.clip(back @ above, -1.0, 1.0)))
        azimuth = math.atan2(float(back @ second), float(back @ first))
        if abs(elevation) > STEEPEST:  # looking straight down: what is up in the image says where we stand
            ahead = camera.rotation()[:, 1] * (-1.0 if elevation > 0 else 1.0)
            azimuth = math.atan2(float(ahead @ second), float(ahead @ first))
        return cls(
            target=_vector(camera.origin() + span * forward),
            distance=span,
            azimuth=azimuth,
            elevation=min(max(elevation, -STEEPEST), STEEPEST),
            up=_vector(above),
            spread=spread,
            nearest=span / ZOOM_RANGE,
            farthest=span * ZOOM_RANGE,
        )

    @classmethod
    def from_view(cls, view: View, time: float) -> Steering:
        """Take over a view where its path is at a scene time (seconds)."""
        return cls.from_camera(view.camera_at(time), view.target_at(time), up=view.up, spread=view.spread)

    def orbit(self, dx: float, dy: float) -> Steering:
        """Turn about the target: dragging right turns the scene right, dragging down shows it from above."""
        elevation = min(max(self.elevation + dy * ORBIT_PER_HEIGHT, -STEEPEST), STEEPEST)
        azimuth = math.remainder(self.azimuth - dx * ORBIT_PER_HEIGHT, 2 * math.pi)
        return replace(self, azimuth=azimuth, elevation=elevation)

    def pan(self, dx: float, dy: float) -> Steering:
        """Shift the scene with the pointer: what lies at the target's distance stays under it."""
        rotation = self.camera().rotation()
        shift = self.spread * self.distance * (dy * rotation[:, 1] - dx * rotation[:, 0])
        return replace(self, target=_vector(np.array(self.target) + shift))

    def zoom(self, factor: float) -> Steering:
        """Come nearer by a factor (above 1: things grow), within 1/1000 and 1000 times the first distance."""
        return replace(self, distance=min(max(self.distance / factor, self.nearest), self.farthest))

    def apply(self, command: Command) -> Steering:
        """What orbit, pan and zoom commands do; others leave the camera alone."""
        if command.kind == "orbit":
            return self.orbit(command.x, command.y)
        if command.kind == "pan":
            return self.pan(command.x, command.y)
        return self.zoom(command.x) if command.kind == "zoom" else self

    def camera(self) -> Camera:
        """The camera as it is held now."""
        first, second = _level(np.array(self.up))
        level = math.cos(self.azimuth) * first + math.sin(self.azimuth) * second
        back = math.cos(self.elevation) * level + math.sin(self.elevation) * np.array(self.up)
        position = np.array(self.target) + self.distance * back
        # the direction is taken from the angles, not from two positions: a target 1e6 away costs no digits
        return replace(look_at(back, np.zeros(3), self.up), position=_vector(position))


def _level(up: Float64) -> tuple[Float64, Float64]:
    """Two unit vectors across `up` that make a right-handed frame (first, second, up)."""
    first = np.cross(np.eye(3)[int(np.argmin(np.abs(up)))], up)
    first /= np.linalg.norm(first)
    return first, np.cross(up, first)


def _vector(values: Float64) -> Vector:
    x, y, z = (float(v) for v in values)
    return (x, y, z)
