"""Off-axis frusta: the ray of every panel pixel, and back from world points to pixels.

The eye looks through the panel as through a window (Cruz-Neira et al. 1993; Kooima 2009), so the world
direction of a pixel is linear in its coordinates; three vectors hold the whole frustum.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from wall.core.data import Camera, Float64
from wall.geometry.panels import Panel


def ray_frame(panel: Panel, eye: ArrayLike, camera: Camera) -> Float64:
    """The three vectors from which every primary ray of a panel follows.

    Parameters
    ----------
    panel : with (X, Y) = panel.screen
    eye : (3,) metres, wall frame; a tracked one is where the camera says, from there
    camera : its position is where the eye is in the world

    Returns
    -------
    frame : (3, 3) float64, rows A, B, C: the world direction (metres, not normalised) of panel pixel
        coordinates (x, y) is A + (X + x) * B + (Y + y) * C, its origin camera.position. Pixel (i, j)'s centre
        is (i + 0.5, j + 0.5). Panels that share a Plane have the same bits in A, B, C, so a wall rendered in
        parts equals the wall rendered whole.
    """
    rotation = camera.rotation()
    plane = panel.plane
    away = plane.origin - np.asarray(eye, dtype=np.float64) - np.array(camera.eye)
    window = np.array([away, plane.per_x, plane.per_y])
    frame: Float64 = np.ascontiguousarray((rotation @ window.T).T)
    return frame


def project(panel: Panel, eye: ArrayLike, camera: Camera, points: ArrayLike) -> tuple[Float64, Float64]:
    """World points to panel pixels: the inverse of `ray_frame`.

    Parameters
    ----------
    points : (n, 3) float64, world

    Returns
    -------
    xy : (n, 2) float64, panel pixels, not clipped to the panel; NaN for points that are not before the eye
    depth : (n,) float64, distance from the eye, world units
    """
    away = np.asarray(points, dtype=np.float64).reshape(-1, 3) - camera.origin()
    weights = np.linalg.solve(ray_frame(panel, eye, camera).T, away.T)
    with np.errstate(divide="ignore", invalid="ignore"):
        xy = (weights[1:] / weights[0]).T - np.array(panel.screen, dtype=np.float64)
    xy[weights[0] <= 0.0] = np.nan
    return xy, np.linalg.norm(away, axis=1)


def distance_before(panel: Panel, eye: ArrayLike) -> float:
    """How far the eye is before the panel's plane, metres; not positive = it cannot see the panel's face."""
    return float((np.asarray(eye, dtype=np.float64) - panel.corners[0]) @ panel.plane.normal)


def cone_inside(rectangles: Sequence[Float64], eye: ArrayLike, axis: Float64) -> float:
    """Half angle (radians) of the widest cone about an axis from the eye that stays in rectangles side by side.

    Exact: the angle to the nearest of the planes through the eye and an edge, but for edges where another rectangle
    begins: its edge's middle is nearer than a quarter of the edge. Not positive if the axis itself leaves them.

    Parameters
    ----------
    rectangles : (3, 3) float64 each, rows lower left, lower right, upper left; metres, wall frame
    eye : (3,) metres, wall frame
    axis : (3,) float64, unit, wall frame
    """
    edges = []  # of which rectangle, and its ends
    for number, corners in enumerate(rectangles):
        lower_left, lower_right, upper_left = corners - np.asarray(eye, dtype=np.float64)
        around = [lower_left, lower_right, lower_right + upper_left - lower_left, upper_left]
        edges += [(number, ends) for ends in zip(around, around[1:] + around[:1], strict=True)]
    angles = []
    for number, (start, end) in edges:
        near = np.linalg.norm(end - start) / 4.0
        if any(np.linalg.norm(sum(ends) - start - end) / 2.0 < near for other, ends in edges if other != number):
            continue
        inward = np.cross(end, start)  # counterclockwise edges, seen from the eye
        angles.append(float(np.arcsin(np.clip(inward @ axis / np.linalg.norm(inward), -1.0, 1.0))))
    return min(angles, default=0.0)
