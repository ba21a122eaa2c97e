"""Panels that are parts of cylinders and domes: where their pixels are, and the flat image from which they are made.

An eye sees a curved panel through the rectangle of a plane before it. That rectangle is rendered as any flat panel is,
with as many pixels as the curved one has; each curved pixel takes what the flat image shows on the line from the eye
through the point that it lights (Raskar et al. 1998, The office of the future; Bourke 2009, for domes). The line is
exact for every pixel and every eye. The rectangle covers the panel for all eyes that look at it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from wall.config.surfaces import CylinderConfig, DomeConfig, SurfaceConfig
from wall.core.data import Float64
from wall.core.errors import ConfigError
from wall.geometry.plane import Plane

STEEPEST = 75.0  # degrees from straight before the flat image: there its pixels look 15 times as small as in its middle
NODES = 65  # a side, at which a surface is looked at
MARGIN = 1  # pixels around what the eyes see: what lies between nodes, and neighbours to interpolate with
LEAST_STEP = 1e-3  # of the widest step between nodes: at a dome's zenith they meet
NEAREST_M = 1e-4  # of an eye before the flat image


class SightError(ConfigError):
    """A curved panel of which an eye does not see enough; `panel`: its index in the file, once it is known."""

    def __init__(self, what: str, wanted: str, panel: int | None = None) -> None:
        super().__init__(f"{what}; accepted: {wanted}")
        self.what, self.wanted, self.panel = what, wanted, panel


class Directions(NamedTuple):
    """The frame of a surface: to where its angles are 0, to where they are 90, and its axis; unit, wall frame."""

    ahead: Float64
    right: Float64
    up: Float64


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Surface:
    """The part of a curved screen that one panel lights."""

    config: SurfaceConfig
    pixels: tuple[int, int]  # width, height, as the viewer sees it

    @property
    def pitch(self) -> tuple[float, float]:
        """Metres a pixel along the surface, across and down; across a dome on its equator."""
        (width, height), (w, h) = self.config.size, self.pixels
        return width / w, height / h

    def nodes(self, count: int = NODES) -> tuple[Float64, Float64]:
        """(count, count, 3) metres, wall frame: points of it from edge to edge, and their normals."""
        w, h = self.pixels
        share = np.linspace(0.0, 1.0, count, dtype=np.float64)
        return self.points(w * share, h * share)

    def points(self, x: Float64, y: Float64) -> tuple[Float64, Float64]:
        """Where panel pixel coordinates are, and unit normals there to the side that shines.

        x (n,), y (m,) -> (m, n, 3) metres, wall frame, and (m, n, 3)
        """
        c = self.config
        s, t = np.asarray(x) / self.pixels[0], np.asarray(y)[:, None] / self.pixels[1]
        frame, centre = directions(c), np.array(c.centre)
        if isinstance(c, CylinderConfig):
            angle, up = _between(c.angles, s), c.heights[1] + t * (c.heights[0] - c.heights[1])
            outwards = np.cos(angle)[:, None] * frame.ahead + np.sin(angle)[:, None] * frame.right
            outwards = np.broadcast_to(outwards, (len(t), *outwards.shape))
            found = centre + c.radius * outwards + up[..., None] * frame.up
        else:
            angle, up = _between(c.azimuths, s), _between((c.elevations[1], c.elevations[0]), t)
            level = np.cos(angle)[:, None] * frame.ahead + np.sin(angle)[:, None] * frame.right
            outwards = np.cos(up)[..., None] * level + np.sin(up)[..., None] * frame.up
            found = centre + c.radius * outwards
        return found, outwards if c.side == "outside" else -outwards

    def centres(self) -> Float64:
        """(h, w, 3) metres, wall frame: the centres of its pixels."""
        x, y = (np.arange(n, dtype=np.float64) + 0.5 for n in self.pixels)
        return self.points(x, y)[0]

    @property
    def corners(self) -> Float64:
        """(3, 3) metres, wall frame: rows lower left, lower right, upper left."""
        w, h = self.pixels
        grid = self.points(np.array([0.0, w]), np.array([0.0, h]))[0]
        return np.array([grid[1, 0], grid[1, 1], grid[0, 0]])

    def outline(self, nodes: int = NODES) -> Float64:
        """(4 (nodes - 1), 3) metres, wall frame: around its edges, anticlockwise from the lower left corner."""
        grid = self.nodes(nodes)[0]
        sides = grid[-1, :-1], grid[:0:-1, -1], grid[0, :0:-1], grid[:-1, 0]
        return np.concatenate(sides)


def directions(config: SurfaceConfig) -> Directions:
    """The frame of a surface's angles. Of one that is seen from outside 0 is before the viewer, right still right."""
    if isinstance(config, DomeConfig):
        tilt = math.radians(config.tilt)
        up = np.array([0.0, math.cos(tilt), -math.sin(tilt)])
    else:
        up = _unit(np.array(config.axis))
    ahead = np.array([0.0, 0.0, -1.0]) if abs(up[2]) < 0.9 else np.array([0.0, 1.0, 0.0])
    ahead = _unit(ahead - (ahead @ up) * up)
    right = np.cross(ahead, up)
    return Directions(-ahead if config.side == "outside" else ahead, right, up)


def _between(degrees: tuple[float, float], share: Float64) -> Float64:
    first, last = np.radians(degrees)
    found: Float64 = first + share * (last - first)
    return found


def flat_image(surface: Surface, eyes: Float64) -> Plane:
    """The plane whose pixels, as many as the panel's, show all that eyes (n, 3), metres, wall frame, see of it.

    It touches the panel where that comes nearest to the viewer, and faces as the panel does on average. For eyes
    between these it covers the panel too: where a line from the eye meets the plane, is a fraction of linear terms.

    Raises SightError for an eye that does not see all of the panel's front, or sees it too slantwise.
    """
    w, h = surface.pixels
    grid, normals = surface.nodes()
    middle = NODES // 2
    normal = _unit(normals.sum(axis=(0, 1)))
    right = grid[middle, -1] - grid[middle, 0]
    right = _unit(right - (right @ normal) * normal)
    up = np.cross(normal, right)
    points = grid.reshape(-1, 3)
    start = points[int(np.argmax(points @ normal))]
    low, high = np.full(2, np.inf), np.full(2, -np.inf)
    for eye in eyes:
        away = points - eye
        before, depth = float((eye - start) @ normal), -(away @ normal)
        _check_sight(away, normals.reshape(-1, 3), before, depth)
        at = (eye - start + away * (before / depth)[:, None]) @ np.stack([right, up], axis=1)
        low, high = np.minimum(low, at.min(axis=0)), np.maximum(high, at.max(axis=0))
    pitch = (high - low) / (np.array([w, h]) - 2 * MARGIN)
    corner = start + (low[0] - MARGIN * pitch[0]) * right + (high[1] + MARGIN * pitch[1]) * up
    return Plane(origin=corner, per_x=pitch[0] * right, per_y=-pitch[1] * up)


def _check_sight(away: Float64, normals: Float64, before: float, depth: Float64) -> None:
    if before < NEAREST_M:
        raise SightError(f"the eye is {-before:.3g} m behind the plane before this part", "a narrower panel")
    if (np.einsum("nk,nk->n", away, normals) >= 0.0).any():
        raise SightError("the eye sees the back of a part of it", "a part whose front the eye sees, or another side")
    slant = math.degrees(math.acos(float((depth / np.linalg.norm(away, axis=1)).min())))
    if slant > STEEPEST:
        wanted = f"at most {STEEPEST:g}: a narrower panel, or an eye farther away"
        raise SightError(f"the eye sees it {slant:.0f} degrees from straight before its flat image", wanted)


def density(surface: Surface, plane: Plane, screen: tuple[int, int], eye: Float64) -> tuple[float, float]:
    """The least and the largest number of the flat image's pixels for the pitch of a panel's, across or down."""
    points = surface.nodes()[0]
    at = pixels_seen(plane, screen, eye, points)
    found = []
    for axis, pitch in ((1, surface.pitch[0]), (0, surface.pitch[1])):
        metres, pixels = (np.linalg.norm(np.diff(each, axis=axis), axis=2) for each in (points, at))
        somewhere = metres > LEAST_STEP * metres.max()
        found.append(pixels[somewhere] / metres[somewhere] * pitch)
    return float(min(each.min() for each in found)), float(max(each.max() for each in found))


def pixels_seen(plane: Plane, screen: tuple[int, int], eye: Float64, points: Float64) -> Float64:
    """(..., 2) flat panel pixels through which an eye (3,) sees points (..., 3), metres, wall frame; else NaN."""
    weights = (points - eye) @ np.linalg.inv(np.array([plane.origin - eye, plane.per_x, plane.per_y]))
    ahead = np.where(weights[..., :1] > 0.0, weights[..., :1], np.nan)
    found: Float64 = weights[..., 1:] / ahead - np.array(screen, np.float64)
    return found


def _unit(vector: Float64) -> Float64:
    found: Float64 = vector / np.linalg.norm(vector)
    return found
