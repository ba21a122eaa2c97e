"""What panels span together: the rectangle around a flat wall, and the one picture that it is."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from wall.core.data import Float64
from wall.geometry.panels import Panel, Plane, Wall


class Whole(NamedTuple):
    """A flat wall as one picture."""

    plane: Plane
    width: int  # pixels
    height: int


def whole(wall: Wall) -> Whole | None:
    """The wall as one picture, as finely as its finest panel; None if it is not flat, or is seen from several eyes.

    Where all panels share a plane it is theirs, and its pixels are those of the virtual screen.
    """
    first, sights = wall.panels[0], {panel.sight for panel in wall.panels}
    if len(sights) > 1 or not wall.flat:
        return None
    if all(panel.plane is first.plane for panel in wall.panels):
        return Whole(first.plane, wall.width, wall.height)
    corners = outline(wall)
    across, down = corners[1] - corners[0], corners[0] - corners[2]
    pitch = np.min([panel.pitch for panel in wall.panels], axis=0)
    width, height = (max(1, round(float(np.linalg.norm(v)) / p)) for v, p in zip((across, down), pitch, strict=True))
    return Whole(Plane(origin=corners[2], per_x=across / width, per_y=down / height), width, height)


def outline(wall: Wall) -> Float64:
    """(3, 3) lower left, lower right, upper left of the rectangle around a flat wall; metres, wall frame."""
    first = wall.panels[0]
    right = first.plane.per_x / np.linalg.norm(first.plane.per_x)
    up = np.cross(first.plane.normal, right)
    around = np.concatenate([panel.corners for panel in wall.panels] + [[_fourth(panel)] for panel in wall.panels])
    x, y = (around - first.corners[0]) @ right, (around - first.corners[0]) @ up
    low, high = first.corners[0] + y.min() * up, first.corners[0] + y.max() * up
    return np.array([low + x.min() * right, low + x.max() * right, high + x.min() * right])


def window_ahead(wall: Wall, eye: Float64) -> Float64:
    """(3, 3) lower left, lower right, upper left of what the eye looks through; metres, wall frame.

    All of a flat wall; of another the panel nearest to straight ahead (-z of the wall's frame).
    """
    if wall.flat:
        return outline(wall)
    middles = np.array([(panel.corners[1] + panel.corners[2]) / 2 - eye for panel in wall.panels])
    return wall.panels[int(np.argmin(middles[:, 2] / np.linalg.norm(middles, axis=1)))].corners


def _fourth(panel: Panel) -> Float64:
    corner: Float64 = panel.corners[1] + panel.corners[2] - panel.corners[0]
    return corner
