"""The wall from above: screens as lines, the eyes, and what each screen shows them. Metres, x right, y = z down.

A plan is drawn with the viewer at its lower edge, so the page's y grows with the wall frame's z.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from wall.commands.drawing.model import Screen
from wall.core.data import Float64

BEYOND = 1.12  # a frustum goes on behind its screen, so that its edges are seen
SAME_M = 1e-4
NO_GAP = math.radians(2.0)  # between two frusta: bezels seen from far away


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Wedge:
    """What an eye sees through a screen, from above."""

    eye: Float64  # (2,) x, z
    left: Float64  # (2,) where its left edge meets the screen
    right: Float64

    def ends(self) -> tuple[Float64, Float64]:
        """Where its edges are left off, a little behind the screen."""
        return self.eye + BEYOND * (self.left - self.eye), self.eye + BEYOND * (self.right - self.eye)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Plan:
    """Everything in metres, x and z of the wall frame."""

    screens: tuple[Float64, ...]  # (4, 2) each: a line, seen from above, for an upright screen; without repetition
    eyes: tuple[Float64, ...]  # (2,) each
    wedges: tuple[Wedge, ...]

    def bounds(self) -> tuple[float, float, float, float]:
        """Left, far, right, near: min x, min z, max x, max z."""
        ends = [end for wedge in self.wedges for end in wedge.ends()]
        points = np.concatenate([*self.screens, np.array(self.eyes).reshape(-1, 2), np.array(ends).reshape(-1, 2)])
        (left, far), (right, near) = points.min(axis=0), points.max(axis=0)
        return float(left), float(far), float(right), float(near)

    def edges(self, *, most: int) -> list[tuple[Float64, Float64]]:
        """Eye and end of the frusta's edges; of more than `most`, only those with nothing seen beyond them."""
        found = [(wedge.eye, end) for wedge in self.wedges for end in wedge.ends()]
        if len(found) <= most:
            return found
        middle = [(wedge.left + wedge.right) / 2 for wedge in self.wedges for _ in wedge.ends()]
        turned = [_side(eye, end, at) for (eye, end), at in zip(found, middle, strict=True)]
        return [edge for edge, side in zip(found, turned, strict=True) if not self._seen_beside(*edge, side)]

    def _seen_beside(self, eye: Float64, end: Float64, side: float) -> bool:
        """Whether another frustum of this eye goes on at the other side of an edge, within a degree."""
        for wedge in self.wedges:
            if not np.array_equal(wedge.eye, eye):
                continue
            for near, far in (wedge.ends(), wedge.ends()[::-1]):
                other = _side(eye, end, (near + far) / 2)
                if other * side < 0 and abs(_angle(end - eye, near - eye)) < NO_GAP:
                    return True
        return False


def plan(screens: Sequence[Screen]) -> Plan:
    """Project screens and eyes on the floor; screens above each other are one."""
    outlines = _different([_outline(screen) for screen in screens])
    eyes = _different([eye[[0, 2]] for screen in screens for eye in screen.eyes])
    wedges: dict[tuple[int, ...], Wedge] = {}
    for screen in screens:
        for eye in screen.eyes:
            wedge = _wedge(_outline(screen), eye[[0, 2]])
            if wedge is not None:
                wedges.setdefault(_key(np.concatenate([wedge.eye, wedge.left, wedge.right])), wedge)
    return Plan(screens=tuple(outlines), eyes=tuple(eyes), wedges=tuple(wedges.values()))


def _outline(screen: Screen) -> Float64:
    lower_left, lower_right, upper_left = screen.corners[:, [0, 2]]
    return np.array([lower_left, lower_right, lower_right + upper_left - lower_left, upper_left])


def _wedge(outline: Float64, eye: Float64) -> Wedge | None:
    """The two corners farthest apart as seen from the eye; None from above a screen or on its line."""
    away = outline - eye
    middle = away.mean(axis=0)
    if np.linalg.norm(middle) < SAME_M:
        return None
    facing = math.atan2(middle[1], middle[0])
    angles = (np.arctan2(away[:, 1], away[:, 0]) - facing + math.pi) % (2 * math.pi) - math.pi
    if np.ptp(angles) > math.pi or np.ptp(angles) < 1e-6:
        return None
    return Wedge(eye=eye, left=outline[int(np.argmin(angles))], right=outline[int(np.argmax(angles))])


def _different(shapes: list[Float64]) -> list[Float64]:
    return list({_key(shape): shape for shape in reversed(shapes)}.values())[::-1]


def _key(shape: Float64) -> tuple[int, ...]:
    return tuple(int(value) for value in np.round(shape.ravel() / SAME_M))


def _side(eye: Float64, end: Float64, point: Float64) -> float:
    """Positive if a point is anticlockwise of the line from the eye to `end`, x to z."""
    along, away = end - eye, point - eye
    return float(along[0] * away[1] - along[1] * away[0])


def _angle(a: Float64, b: Float64) -> float:
    return math.atan2(a[0] * b[1] - a[1] * b[0], float(a @ b))
