"""Turn mouse and keyboard input of a window into the steering commands of the page (page/steering.js).

Drag: orbit; right button or shift: pan; wheel, + and -: zoom; arrows: orbit, with shift pan; [ and ]: exposure;
comma and period: back and forth in time; space: pause; r: reset; Escape: the run ends.
"""

from __future__ import annotations

import math
from typing import Any

import glfw

from wall.display.window_layout import TURNS
from wall.geometry.steering import MAX_DRAG, MAX_SEEK_S, MAX_ZOOM

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
_ONCE = {glfw.KEY_SPACE: "pause", glfw.KEY_R: "reset"}


class InputHandler:
    """Sums the input of one window until `commands` takes it. Used by the main thread only."""

    def __init__(self, handle: Any, rotation: int, height: float) -> None:
        """`height` is the wall's, in pixels of this window; `rotation` that of its panel, degrees."""
        self._turn, self._height = TURNS[rotation], height
        self._sums = {"orbit": [0.0, 0.0], "pan": [0.0, 0.0]}
        self._zoom, self._stops, self._seek, self._once = 1.0, 0.0, 0.0, list[str]()
        self._held: str | None = None  # what a drag does
        self._at = (0.0, 0.0)
        self.escape = False
        glfw.set_cursor_pos_callback(handle, self._moved)
        glfw.set_mouse_button_callback(handle, self._pressed)
        glfw.set_scroll_callback(handle, lambda _, dx, dy: self._zoom_by(NOTCH_ZOOM**dy))
        glfw.set_key_callback(handle, self._key)

    def commands(self) -> list[dict[str, Any]]:
        """Steering commands since the last call, within the limits of wall.geometry.steering."""
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
        return asked

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

    def _pressed(self, handle: Any, button: int, action: int, modifiers: int) -> None:
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
        elif key == glfw.KEY_ESCAPE:
            self.escape = True


def _within(x: float, limit: float) -> float:
    return max(-limit, min(limit, x))
