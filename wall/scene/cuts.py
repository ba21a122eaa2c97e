"""Planes that cut a scene open (clipping planes, section planes): what lies beyond one, where its normal points, is not
there, for rays of every kind.

What is left is convex, so of each ray one piece is left: rays are shortened, and geometry stays as it is. A plane is
four numbers, unit normal and distance: a point x is cut away where normal . x > distance + slack. The slack is what
float32 rounds a point and a plane to, so that a surface in the plane itself stays, and stays whole.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from wall.config.scene import CutConfig
from wall.core.data import Float64
from wall.scene.model import Cut

SLACK = 16.0 * 2.0**-24  # of the sum of a point's coordinates and the plane's distance, as it is for rays' offsets
SHORTEST = 1e-9  # length of a normal; a shorter one, between opposite keyframes, cuts nothing


def cuts_of(configs: Sequence[CutConfig]) -> tuple[Cut, ...]:
    """The cuts that a configuration describes."""
    return tuple(Cut(position=c.position, normal=c.normal, enabled=c.enabled) for c in configs)


def planes_of(cuts: Sequence[Cut], origin: Float64) -> Float64:
    """(k, 4) normals and distances from `origin` (3,), world; normals of zeros where a cut cuts nothing."""
    planes = np.tile((0.0, 0.0, 0.0, 1.0), (len(cuts), 1))
    for plane, cut in zip(planes, cuts, strict=True):
        length = math.hypot(*cut.normal)
        if cut.enabled and length >= SHORTEST:
            plane[:3] = np.array(cut.normal) / length
            plane[3] = plane[:3] @ (np.array(cut.position) - origin)
    return planes


def piece_left(planes: Float64, direction: Float64) -> tuple[float, float]:
    """Where the piece of a ray from the planes' origin begins and ends that they leave, in lengths of `direction` (3,).

    Without planes 0 and infinity; it ends before it begins where nothing is left.
    """
    first, last, slack = 0.0, math.inf, SLACK * float(np.abs(direction).sum())
    for *normal, distance in planes.tolist():
        rise, room = float(np.dot(normal, direction)) - slack, distance + SLACK * abs(distance)
        if rise > 0.0:
            last = min(last, room / rise)
        elif rise < 0.0:
            first = max(first, room / rise)
        elif room < 0.0:
            last = -math.inf
    return first, last
