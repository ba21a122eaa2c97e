"""Turn mouse and keyboard input of a window into the steering commands of the page (page/steering.js).

Drag: orbit; right button or shift: pan; wheel, + and -: zoom; arrows: orbit, with shift pan; [ and ]: exposure;
comma and period: back and forth in time; space: pause; r: reset; z: undo; Escape: the run ends. A drag and the wheel
steer the view beneath the pointer, keys the one that was steered last; n or Tab goes on to the next one.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import glfw

from wall.display.window_layout import TURNS, Place
from wall.geometry.steering import MAX_DRAG, MAX_SEEK_S, MAX_ZOOM, OF_ONE_TIME, OF_ONE_VIEW

TAP = 0.04  # wall heights of one key press, and of each repeat while it is held
KEY_ZOOM = 1.12
NOTCH_ZOOM = 1.17  # one notch of the wheel
_ARROWS = {glfw.KEY_LEFT: (-1, 0), glfw.KEY_RIGHT: (1, 0), glfw.KEY_UP: (0, -1), glfw.KEY_DOWN: (0, 1)}
_ZOOMS = {
    glfw.KEY_EQUAL: KEY_ZOOM,
    glfw.KEY_KP_ADD: KEY_ZOOM,
    glfw.KEY_MINUS: 1 / KEY_ZOOM,
    glfw.KEY_KP_SUBTRACT: 1 / KEY_ZOOM,
}
_STOPS = {glfw.KEY_LEFT_BRACKET: -1 / 3, glfw.KEY_RIGHT_BRACKET: 1 / 3}  # of exposure, of one press
_SEEKS = {glfw.KEY_COMMA: -0.5, glfw.KEY_PERIOD: 0.5}  # seconds, of one press
_ONCE = {glfw.KEY_SPACE: "pause", glfw.KEY_R: "reset", glfw.KEY_Z: "undo"}


class Views:
    """The view that is steered in all windows of one X display, and where each window shows which."""

    def __init__(self) -> None:
        self.steered, self._count = 0, 1
        self._places: list[list[Place]] = []

    def lay_out(self, places: Sequence[Sequence[Place]], count: int) -> None:
        """Know the places of each window, the nearest last, and how many views the wall has. Any thread may call.

        Windows that do not show the steered view steer the first that they show.
        """
        self._places, self._count = [list(own) for own in places], count
        seen = sorted(place.view for own in places for place in own)
        if seen and self.steered not in seen:
            self.steered = seen[0]

    @property
    def several(self) -> bool:
        """Whether the wall has more than one."""
        return self._count > 1

    def next(self) -> None:
        """Steer the next one."""
        self.steered = (self.steered + 1) % self._count

    def take(self, window: int, x: float, y: float) -> None:
        """Steer what a window shows at a place, fractions of its image."""
        own = self._places[window] if window < len(self._places) else []
        found = [p.view for p in own if p.left <= x < p.right and p.top <= y < p.bottom]
        self.steered = found[-1] if found else self.steered


class InputHandler:
    """Sums the input of one window until `commands` takes it. Used by the main thread only."""

    def __init__(
        self, handle: Any, rotation: int, height: float, *, window: int, size: tuple[int, int], views: Views
    ) -> None:
        """`height` is the wall's, in pixels of this window; `rotation` that of its panel, degrees.

        `window`: its index, `size`: its width and height, pixels.
        """
        self._turn, self._height = TURNS[rotation], height
        self._window, self._size, self._views = window, size, views
        self._done = list[dict[str, Any]]()  # commands for the view that was steered before
        self._sums = {"orbit": [0.0, 0.0], "pan": [0.0, 0.0]}
        self._zoom, self._stops, self._seek, self._once = 1.0, 0.0, 0.0, list[str]()
        self._held: str | None = None  # what a drag does
        self._at = (0.0, 0.0)
        self.escape = False
        glfw.set_cursor_pos_callback(handle, self._moved)
        glfw.set_mouse_button_callback(handle, self._pressed)
        glfw.set_scroll_callback(handle, self._scrolled)
        glfw.set_key_callback(handle, self._key)

    def commands(self) -> list[dict[str, Any]]:
        """Steering commands since the last call, within the limits of wall.geometry.steering."""
        self._close()
        done, self._done = self._done, []
        return done

    def _close(self) -> None:
        """Make commands of what came for the view that is steered now."""
        asked: list[dict[str, Any]] = [{"kind": kind} for kind in self._once]
        for kind, (x, y) in self._sums.items():
            if x or y:
                asked.append({"kind": kind, "x": _within(x, MAX_DRAG), "y": _within(y, MAX_DRAG)})
        if self._zoom != 1.0:
            asked.append({"kind": "zoom", "x": math.exp(_within(math.log(self._zoom), math.log(MAX_ZOOM)))})
        if self._stops:
            asked.append({"kind": "expose", "x": _within(self._stops, MAX_DRAG)})
        if self._seek:
            asked.append({"kind": "seek", "x": _within(self._seek, MAX_SEEK_S)})
        self._sums, self._zoom = {"orbit": [0.0, 0.0], "pan": [0.0, 0.0]}, 1.0
        self._stops, self._seek, self._once = 0.0, 0.0, []
        view = self._views.steered
        named = (*(OF_ONE_VIEW if view else ()), *(OF_ONE_TIME if self._views.several else ()))
        self._done += [c | {"view": view} if c["kind"] in named else c for c in asked]

    def _take(self) -> None:
        """Steer the view beneath the pointer; a drag stays with the one where it began."""
        if self._held is not None:
            return
        self._close()
        (a, b, c, d), (x, y) = self._turn, (at / size - 0.5 for at, size in zip(self._at, self._size, strict=True))
        self._views.take(self._window, a * x + b * y + 0.5, c * x + d * y + 0.5)

    def _add(self, kind: str, x: float, y: float) -> None:
        self._sums[kind][0] += x
        self._sums[kind][1] += y

    def _zoom_by(self, factor: float) -> None:
        self._zoom *= factor

    def _moved(self, handle: Any, x: float, y: float) -> None:
        if self._held is not None:
            a, b, c, d = self._turn
            dx, dy = (x - self._at[0]) / self._height, (y - self._at[1]) / self._height
            self._add(self._held, a * dx + b * dy, c * dx + d * dy)
        self._at = (x, y)

    def _scrolled(self, handle: Any, dx: float, dy: float) -> None:
        self._take()
        self._zoom_by(NOTCH_ZOOM**dy)

    def _pressed(self, handle: Any, button: int, action: int, modifiers: int) -> None:
        if action == glfw.PRESS:
            self._take()
        pan = button == glfw.MOUSE_BUTTON_RIGHT or bool(modifiers & glfw.MOD_SHIFT)
        self._held = ("pan" if pan else "orbit") if action == glfw.PRESS else None

    def _key(self, handle: Any, key: int, scancode: int, action: int, modifiers: int) -> None:
        if action == glfw.RELEASE:
            return
        if key in _ARROWS:
            x, y = _ARROWS[key]
            self._add("pan" if modifiers & glfw.MOD_SHIFT else "orbit", TAP * x, TAP * y)
        elif key in _ZOOMS:
            self._zoom_by(_ZOOMS[key])
        elif key in _STOPS:
            self._stops += _STOPS[key]
        elif key in _SEEKS:
            self._seek += _SEEKS[key]
        elif action == glfw.PRESS and key in _ONCE:
            self._once.append(_ONCE[key])
        elif key in (glfw.KEY_N, glfw.KEY_TAB) and not modifiers & glfw.MOD_SHIFT:
            self._close()
            self._views.next()
        elif key == glfw.KEY_ESCAPE:
            self.escape = True


def _within(x: float, limit: float) -> float:
    return max(-limit, min(limit, x))
