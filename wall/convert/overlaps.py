"""Which panels light the same place, and how wide: what a configuration wants declared at each side."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from wall.data import Float64

SAME_PLANE = 1e-6  # sine between planes; share of a panel's size between them
LEAST_M = 1e-7  # less is rounding


def declare_overlaps(panels: Sequence[tuple[Float64, str]]) -> list[dict[str, float]]:
    """The width at each side of each panel that its neighbours light too, metres; only sides that have one.

    `panels` are (3, 3) corners (lower left, lower right, upper left; metres) with the eye that sees them:
    a panel for the left eye and one for the right may light the same place.
    """
    found: list[dict[str, float]] = [{} for _ in panels]
    frames = [_frame(corners) for corners, _ in panels]
    for i, (corners, stereo) in enumerate(panels):
        for k in range(i + 1, len(panels)):
            if {stereo, panels[k][1]} != {"left", "right"} and _one_plane(frames[i], frames[k]):
                _declare(found[i], found[k], _rectangle(frames[i], corners), _rectangle(frames[i], panels[k][0]))
    return found


def _frame(corners: Float64) -> tuple[Float64, Float64, Float64, float]:
    """Lower left corner, unit right, unit up, and the panel's longer side."""
    right, up = corners[1] - corners[0], corners[2] - corners[0]
    width, height = float(np.linalg.norm(right)), float(np.linalg.norm(up))
    return corners[0], right / width, up / height, max(width, height)


def _one_plane(a: tuple[Float64, Float64, Float64, float], b: tuple[Float64, Float64, Float64, float]) -> bool:
    turned = float(np.abs(a[1] - b[1]).max() + np.abs(a[2] - b[2]).max())
    if turned > 2 * SAME_PLANE:
        return False
    behind = abs(float((b[0] - a[0]) @ np.cross(a[1], a[2])))
    return behind <= SAME_PLANE * max(a[3], b[3])


def _rectangle(frame: tuple[Float64, Float64, Float64, float], corners: Float64) -> tuple[float, float, float, float]:
    """Left, bottom, right, top in the frame's plane, metres."""
    origin, right, up, _ = frame
    low = corners[0] - origin
    x, y = float(low @ right), float(low @ up)
    return x, y, float((corners[1] - origin) @ right), float((corners[2] - origin) @ up)


def _declare(
    mine: dict[str, float],
    other: dict[str, float],
    a: tuple[float, float, float, float],
    b: tuple[float, float, float, float],
) -> None:
    """Note where rectangles a and b share a part: beside each other if they share less of their widths."""
    wide, high = min(a[2], b[2]) - max(a[0], b[0]), min(a[3], b[3]) - max(a[1], b[1])
    if wide <= LEAST_M or high <= LEAST_M:
        return
    beside = wide / min(a[2] - a[0], b[2] - b[0]) <= high / min(a[3] - a[1], b[3] - b[1])
    width, middle = (wide, a[0] + a[2] <= b[0] + b[2]) if beside else (high, a[1] + a[3] <= b[1] + b[3])
    names = ("right", "left") if beside else ("top", "bottom")
    first, second = names if middle else names[::-1]
    mine[first] = max(mine.get(first, 0.0), round(width, 9))
    other[second] = max(other.get(second, 0.0), round(width, 9))
