"""Find panels that overlap, and the widths that a configuration declares at their sides."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from wall.core.data import Float64

SAME_PLANE = 1e-6  # sine between planes; share of a panel's size between them
LEAST_M = 1e-7  # metres; less is rounding
EYES = {"mono": "m", "left": "l", "right": "r"}  # other kinds of stereo show both, l and r


def declare_overlaps(panels: Sequence[tuple[Float64, str]]) -> list[dict[str, float]]:
    """The width of the overlap at each side of each panel, metres; only sides that have one.

    `panels` are (3, 3) corners (lower left, lower right, upper left; metres) with their kind of stereo: panels for
    different eyes do not overlap.
    """
    found: list[dict[str, float]] = [{} for _ in panels]
    corners = np.array([corners for corners, _ in panels])  # (n, 3, 3)
    eyes = [set(EYES.get(stereo, "lr")) for _, stereo in panels]
    for i in range(len(panels) - 1):
        rectangles = _in_plane_of(corners[i:])
        others = np.flatnonzero(_same_plane(corners[i:]) & _meets(rectangles)) + i
        for k in others[others > i]:
            if not eyes[i].isdisjoint(eyes[k]):
                _declare(found[i], found[k], rectangles[0], rectangles[k - i])
    return found


def _same_plane(corners: Float64) -> NDArray[np.bool_]:
    """(n,) whether each panel lies in the first one's plane, and the same way up."""
    across, up = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    width, height = np.linalg.norm(across, axis=1), np.linalg.norm(up, axis=1)
    right, high = across / width[:, None], up / height[:, None]
    turned = np.abs(right - right[0]).max(axis=1) + np.abs(high - high[0]).max(axis=1)
    behind = np.abs((corners[:, 0] - corners[0, 0]) @ np.cross(right[0], high[0]))
    size = np.maximum(width, height)
    return np.asarray((turned <= 2 * SAME_PLANE) & (behind <= SAME_PLANE * np.maximum(size, size[0])))


def _in_plane_of(corners: Float64) -> Float64:
    """(n, 4) left, bottom, right, top of panels in the first one's plane, metres from its lower left corner."""
    across, up = corners[0, 1] - corners[0, 0], corners[0, 2] - corners[0, 0]
    right, high = across / np.linalg.norm(across), up / np.linalg.norm(up)
    away = corners - corners[0, 0]
    return np.stack([away[:, 0] @ right, away[:, 0] @ high, away[:, 1] @ right, away[:, 2] @ high], axis=1)


def _meets(rectangles: Float64) -> NDArray[np.bool_]:
    """(n,) whether each rectangle shares more than rounding with the first."""
    shared = np.minimum(rectangles[:, 2:], rectangles[0, 2:]) - np.maximum(rectangles[:, :2], rectangles[0, :2])
    return np.asarray((shared > LEAST_M).all(axis=1))


def _declare(mine: dict[str, float], other: dict[str, float], a: Float64, b: Float64) -> None:
    """Record the overlap of rectangles a and b: they are side by side if they share less of their width than height.

    The overlap is at the right of the panel that begins farther left, or at the bottom of the one that ends higher.
    """
    wide, high = min(a[2], b[2]) - max(a[0], b[0]), min(a[3], b[3]) - max(a[1], b[1])
    beside = wide / min(a[2] - a[0], b[2] - b[0]) <= high / min(a[3] - a[1], b[3] - b[1])
    width, ahead = (wide, b[0] - a[0]) if beside else (high, a[3] - b[3])
    names = ("right", "left") if beside else ("bottom", "top")
    sides = [names] * bool(ahead > -LEAST_M) + [names[::-1]] * bool(ahead < LEAST_M)
    for first, second in sides:
        mine[first] = max(mine.get(first, 0.0), round(float(width), 9))
        other[second] = max(other.get(second, 0.0), round(float(width), 9))
