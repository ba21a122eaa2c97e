"""The top view of a wall: screens as lines, the eyes, and the frusta between them. Metres, x right, y = z down.

The viewer is at the lower edge, so the page's y grows with the wall frame's z.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from wall.commands.drawing.model import Screen
from wall.core.data import Float64

BEYOND = 1.12  # length of a frustum's edges in distances to the screen, so that they show behind it
SAME_M = 1e-4  # metres between points that count as one
NO_GAP = math.radians(2.0)  # largest angle of a bezel between frusta that count as adjacent


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Wedge:
    """A frustum from above: an eye and the two edges of a screen."""

    eye: Float64  # (2,) x, z
    left: Float64  # (2,) where its left edge meets the screen
    right: Float64

    def ends(self) -> tuple[Float64, Float64]:
        """The ends of its edges, a little behind the screen."""
        return self.eye + BEYOND * (self.left - self.eye), self.eye + BEYOND * (self.right - self.eye)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TopView:
    """Screens, eyes and frusta, metres, x and z of the wall frame."""

    screens: tuple[Float64, ...]  # (4, 2) each: a line, seen from above, for an upright screen; without repetition
    # a curved screen: (n, 2) around it
    eyes: tuple[Float64, ...]  # (2,) each
    wedges: tuple[Wedge, ...]

    def bounds(self) -> tuple[float, float, float, float]:
        """Left, far, right, near: min x, min z, max x, max z."""
        ends = [end for wedge in self.wedges for end in wedge.ends()]
        points = np.concatenate([*self.screens, np.array(self.eyes).reshape(-1, 2), np.array(ends).reshape(-1, 2)])
        (left, far), (right, near) = points.min(axis=0), points.max(axis=0)
        return float(left), float(far), float(right), float(near)

    def edges(self, *, most: int) -> list[tuple[Float64, Float64]]:
        """Eye and end of the frusta's edges; of more than `most`, only those with no other frustum next to them."""
        found = [(wedge.eye, end) for wedge in self.wedges for end in wedge.ends()]
        if len(found) <= most:
            return found
        middle = [(wedge.left + wedge.right) / 2 for wedge in self.wedges for _ in wedge.ends()]
        turned = [_side(eye, end, at) for (eye, end), at in zip(found, middle, strict=True)]
        return [edge for edge, side in zip(found, turned, strict=True) if not self._seen_beside(*edge, side)]

    def _seen_beside(self, eye: Float64, end: Float64, side: float) -> bool:
        """Whether another frustum of this eye is adjacent at the other side of an edge."""
        for wedge in self.wedges:
            if not np.array_equal(wedge.eye, eye):
                continue
            for near, far in (wedge.ends(), wedge.ends()[::-1]):
                other = _side(eye, end, (near + far) / 2)
                if other * side < 0 and abs(_angle(end - eye, near - eye)) < NO_GAP:
                    return True
        return False


def top_view(screens: Sequence[Screen]) -> TopView:
    """Project screens and eyes to the floor; screens above each other are one."""
    outlines = _different([_outline(screen) for screen in screens])
    eyes = _different([eye[[0, 2]] for screen in screens for eye in screen.eyes])
    wedges: dict[tuple[int, ...], Wedge] = {}
    for screen in screens:
        for eye in screen.eyes:
            wedge = _wedge(_outline(screen), eye[[0, 2]])
            if wedge is not None:
                wedges.setdefault(_key(np.concatenate([wedge.eye, wedge.left, wedge.right])), wedge)
    return TopView(screens=tuple(outlines), eyes=tuple(eyes), wedges=tuple(wedges.values()))


def _outline(screen: Screen) -> Float64:
    """(4, 2) corners of a screen from above; (n, 2) around a curved one."""
    if screen.arc is not None:
        around: Float64 = screen.arc[:, [0, 2]]
        return around
    lower_left, lower_right, upper_left = screen.corners[:, [0, 2]]
    return np.array([lower_left, lower_right, lower_right + upper_left - lower_left, upper_left])


def _wedge(outline: Float64, eye: Float64) -> Wedge | None:
    """The wedge of the two corners farthest apart as seen from the eye; None for an eye above the screen or in line."""
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
    """Shapes without repetitions, in order of their first appearance."""
    return list({_key(shape): shape for shape in reversed(shapes)}.values())[::-1]


def _key(shape: Float64) -> tuple[int, ...]:
    """Equal for shapes whose points agree to SAME_M."""
    return tuple(int(value) for value in np.round(shape.ravel() / SAME_M))


def _side(eye: Float64, end: Float64, point: Float64) -> float:
    """Positive if a point is anticlockwise of the line from the eye to `end`, x to z."""
    along, away = end - eye, point - eye
    return float(along[0] * away[1] - along[1] * away[0])


def _angle(a: Float64, b: Float64) -> float:
    """The signed angle from a to b, radians."""
    return math.atan2(a[0] * b[1] - a[1] * b[0], float(a @ b))
