"""Panels that light the same directions from planes of their own, as projectors before a bent screen do."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from wall.core.data import Float64
from wall.geometry.panels import Panel

WIDEST_SEAM = 0.5  # pixels: what is narrower is a seam of rounded corners
SAME_PLANE = 1e-6  # of a normal, and of the wall's size


class FoldedOverlap(NamedTuple):
    """What an eye sees through two panels that do not lie in one plane."""

    first: Panel
    second: Panel
    share: float  # of the second panel's area


def folded_overlaps(panels: Sequence[Panel], eyes: Float64) -> Iterator[FoldedOverlap]:
    """Pairs of panels that one eye sees behind each other, and that lie in different planes.

    Exact: a panel is cut by the four planes through the eye and the other's edges.

    Parameters
    ----------
    panels : what lights; eyes : (n, 3) metres, wall frame: who looks at each
    """
    outlines = np.array([_around(panel) for panel in panels])
    away = outlines - eyes[:, None]
    directions = away / np.linalg.norm(away, axis=2, keepdims=True)
    axes = directions.sum(axis=1)
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    widths = np.arccos(np.clip((directions * axes[:, None]).sum(axis=2).min(axis=1), -1.0, 1.0))
    normals = np.array([panel.plane.normal for panel in panels])
    size = float(np.abs(outlines - outlines[0, 0]).max())
    for k in range(len(panels) - 1):
        beside = np.arccos(np.clip(axes[k + 1 :] @ axes[k], -1.0, 1.0))
        near = beside < widths[k] + widths[k + 1 :]
        near &= (eyes[k + 1 :] == eyes[k]).all(axis=1)
        same = normals[k + 1 :] @ normals[k] > 1.0 - SAME_PLANE
        same &= np.abs((outlines[k + 1 :, 0] - outlines[k, 0]) @ normals[k]) < SAME_PLANE * size
        for m in (k + 1 + np.flatnonzero(near & ~same)).tolist():
            seen = _cut(away[m], away[k])
            if _width(seen) > WIDEST_SEAM * min(panels[m].pitch):
                yield FoldedOverlap(panels[k], panels[m], _area(seen) / _area(away[m]))


def _around(panel: Panel) -> Float64:
    """(4, 3) metres, wall frame: the corners of what shines, anticlockwise as the viewer sees them."""
    lower_left, lower_right, upper_left = panel.lit
    return np.array([lower_left, lower_right, lower_right + upper_left - lower_left, upper_left])


def _cut(polygon: Float64, window: Float64) -> Float64:
    """(k, 3) what an eye at 0 sees of a polygon (n, 3) through a window (4, 3), after Sutherland and Hodgman (1974)."""
    for start, end in zip(window, np.roll(window, -1, axis=0), strict=True):
        inward = np.cross(end, start)
        depth = polygon @ inward
        kept = []
        for k in range(len(polygon)):
            before, here = depth[k - 1], depth[k]
            if (before >= 0.0) != (here >= 0.0):
                kept.append(polygon[k - 1] + before / (before - here) * (polygon[k] - polygon[k - 1]))
            if here >= 0.0:
                kept.append(polygon[k])
        polygon = np.array(kept).reshape(-1, 3)
    return polygon


def _area(polygon: Float64) -> float:
    """Of a plane polygon (n, 3)."""
    if len(polygon) < 3:
        return 0.0
    edges = polygon - polygon[0]
    return float(np.linalg.norm(np.cross(edges[1:-1], edges[2:]).sum(axis=0)) / 2.0)


def _width(polygon: Float64) -> float:
    """Mean width of a polygon (n, 3) across its longest line."""
    if len(polygon) < 3:
        return 0.0
    longest = float(np.linalg.norm(polygon[:, None] - polygon[None], axis=2).max())
    return _area(polygon) / longest if longest > 0.0 else 0.0
