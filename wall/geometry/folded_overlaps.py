"""Panels that light the same directions from planes of their own, or turned in one plane, as projectors before a bent
screen do."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wall.core.data import Float64
from wall.geometry.panels import Panel
from wall.geometry.surfaces import pixels_seen

CELLS = 64  # a side, by whose middles a curved panel is compared with another
WIDEST_SEAM = 0.5  # pixels: what is narrower is a seam of rounded corners
SAME_PLANE = 1e-6  # of a normal's cosine and an axis', and of the wall's size


class FoldedOverlap(NamedTuple):
    """What an eye sees through two panels that do not lie in one plane side by side."""

    first: Panel
    second: Panel
    share: float  # of the second panel's area


def folded_overlaps(panels: Sequence[Panel], eyes: Float64) -> Iterator[FoldedOverlap]:
    """Pairs of panels that one eye sees behind each other, and that lie in different planes or turned in one.

    Exact for flat ones: a panel is cut by the four planes through the eye and the other's edges. Of a pair with a
    curved one, what is wider than 1 / CELLS of the second is found. Parts of one cylinder or dome are no pair.

    Parameters
    ----------
    panels : what lights; eyes : (n, 3) metres, wall frame: who looks at each
    """
    outlines = np.array([_around(panel) for panel in panels])
    away = outlines - eyes[:, None]
    cones = [_cone(panel, eye) for panel, eye in zip(panels, eyes, strict=True)]
    axes, widths = np.array([axis for axis, _ in cones]), np.array([width for _, width in cones])
    normals = np.array([panel.plane.normal for panel in panels])
    rights = np.array([panel.plane.per_x / np.linalg.norm(panel.plane.per_x) for panel in panels])
    size = float(np.abs(outlines - outlines[0, 0]).max())
    for k in range(len(panels) - 1):
        beside = np.arccos(np.clip(axes[k + 1 :] @ axes[k], -1.0, 1.0))
        near = beside < widths[k] + widths[k + 1 :]
        near &= (eyes[k + 1 :] == eyes[k]).all(axis=1)
        same = normals[k + 1 :] @ normals[k] > 1.0 - SAME_PLANE
        same &= rights[k + 1 :] @ rights[k] > 1.0 - SAME_PLANE
        same &= np.abs((outlines[k + 1 :, 0] - outlines[k, 0]) @ normals[k]) < SAME_PLANE * size
        curved = np.array([panels[k].surface is not None or p.surface is not None for p in panels[k + 1 :]])
        for m in (k + 1 + np.flatnonzero(near & (curved | ~same))).tolist():
            if curved[m - k - 1]:
                share = (
                    0.0 if _on_one_surface(panels[k], panels[m]) else _share_of_curved(panels[k], panels[m], eyes[k])
                )
                if share > 0.0:
                    yield FoldedOverlap(panels[k], panels[m], share)
                continue
            seen = _cut(away[m], away[k])
            if _width(seen) > WIDEST_SEAM * min(panels[m].pitch):
                yield FoldedOverlap(panels[k], panels[m], _area(seen) / _area(away[m]))


def _cone(panel: Panel, eye: Float64) -> tuple[Float64, float]:
    """Axis, unit, and half angle, radians, of a cone around what an eye sees of a panel."""
    edges = _around(panel) if panel.surface is None else panel.surface.outline()
    directions = (edges - eye) / np.linalg.norm(edges - eye, axis=1, keepdims=True)
    axis = directions.sum(axis=0) / np.linalg.norm(directions.sum(axis=0))
    return axis, float(np.arccos(np.clip((directions @ axis).min(), -1.0, 1.0)))


def _on_one_surface(first: Panel, second: Panel) -> bool:
    one, other = first.surface, second.surface
    return one is not None and other is not None and one.config.whole == other.config.whole


def _share_of_curved(first: Panel, second: Panel, eye: Float64) -> float:
    """What part of the second panel's cells an eye sees behind or before the first."""
    inside = (np.arange(CELLS) + 0.5) / CELLS
    w, h = second.pixels
    if second.surface is not None:
        points = second.surface.points(w * inside, h * inside)[0].reshape(-1, 3)
    else:
        x, y = second.screen[0] + w * inside, (second.screen[1] + h * inside)[:, None]
        points = second.plane.point(x[..., None], y[..., None]).reshape(-1, 3)
    edges = _around(first) if first.surface is None else first.surface.outline()
    polygon, at = (pixels_seen(first.plane, first.screen, eye, p) for p in (edges, points))
    return float(_inside(polygon, at).mean())


def _inside(polygon: Float64, points: Float64) -> NDArray[np.bool_]:
    """(n,) whether points (n, 2) are in a polygon (m, 2), by the parity of its edges to their right."""
    found = np.zeros(len(points), np.bool_)
    for (x0, y0), (x1, y1) in zip(polygon, np.roll(polygon, -1, axis=0), strict=True):
        spans = (points[:, 1] < y0) != (points[:, 1] < y1)
        at = x0 + (points[spans, 1] - y0) * (x1 - x0) / (y1 - y0)
        found[spans] ^= points[spans, 0] < at
    return found


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
