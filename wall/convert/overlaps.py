"""Which panels light the same place, and how wide: what a configuration wants declared at each side."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from wall.data import Float64

SAME_PLANE = 1e-6  # sine between planes; share of a panel's size between them
LEAST_M = 1e-7  # less is rounding
EYES = {"mono": "m", "left": "l", "right": "r"}  # other kinds of stereo show both, l and r

_Frame = tuple[Float64, Float64, Float64, float]  # lower left corner, unit right, unit up, longer side
_Rectangle = tuple[float, float, float, float]  # left, bottom, right, top in a plane, metres


def declare_overlaps(panels: Sequence[tuple[Float64, str]]) -> list[dict[str, float]]:
    """The width at each side of each panel that its neighbours light too, metres; only sides that have one.

    `panels` are (3, 3) corners (lower left, lower right, upper left; metres) with the eye that sees them:
    a panel for the left eye and one for the right may light the same place.
    """
    found: list[dict[str, float]] = [{} for _ in panels]
    frames = [_frame(corners) for corners, _ in panels]
    for i, (corners, stereo) in enumerate(panels):
        for k in range(i + 1, len(panels)):
            if _one_eye(stereo, panels[k][1]) and _one_plane(frames[i], frames[k]):
                _declare(found[i], found[k], _rectangle(frames[i], corners), _rectangle(frames[i], panels[k][0]))
    return found


def _one_eye(a: str, b: str) -> bool:
    """Whether an eye sees both."""
    return not set(EYES.get(a, "lr")).isdisjoint(EYES.get(b, "lr"))


def _frame(corners: Float64) -> _Frame:
    """Lower left corner, unit right, unit up, and the panel's longer side."""
    right, up = corners[1] - corners[0], corners[2] - corners[0]
    width, height = float(np.linalg.norm(right)), float(np.linalg.norm(up))
    return corners[0], right / width, up / height, max(width, height)


def _one_plane(a: _Frame, b: _Frame) -> bool:
    turned = float(np.abs(a[1] - b[1]).max() + np.abs(a[2] - b[2]).max())
    if turned > 2 * SAME_PLANE:
        return False
    behind = abs(float((b[0] - a[0]) @ np.cross(a[1], a[2])))
    return behind <= SAME_PLANE * max(a[3], b[3])


def _rectangle(frame: _Frame, corners: Float64) -> _Rectangle:
    origin, right, up, _ = frame
    low = corners[0] - origin
    x, y = float(low @ right), float(low @ up)
    return x, y, float((corners[1] - origin) @ right), float((corners[2] - origin) @ up)


def _declare(mine: dict[str, float], other: dict[str, float], a: _Rectangle, b: _Rectangle) -> None:
    """Note where rectangles a and b share a part: beside each other if they share less of their widths.

    Of two panels the one that begins farther left has it at its right, the one that ends higher at its bottom.
    """
    wide, high = min(a[2], b[2]) - max(a[0], b[0]), min(a[3], b[3]) - max(a[1], b[1])
    if wide <= LEAST_M or high <= LEAST_M:
        return
    beside = wide / min(a[2] - a[0], b[2] - b[0]) <= high / min(a[3] - a[1], b[3] - b[1])
    width, ahead = (wide, b[0] - a[0]) if beside else (high, a[3] - b[3])
    names = ("right", "left") if beside else ("bottom", "top")
    sides = [names] * (ahead > -LEAST_M) + [names[::-1]] * (ahead < LEAST_M)
    for first, second in sides:
        mine[first] = max(mine.get(first, 0.0), round(width, 9))
        other[second] = max(other.get(second, 0.0), round(width, 9))
