"""A tracked eye: positions of a tracker in, the eye at the moment when an image becomes light out. Pure.

A straight line is fitted to the positions of the last WINDOW_S by least squares, and followed to that moment (dead
reckoning at constant velocity, smoothed; see LaValle et al., "Head Tracking for the Oculus Rift", 2014). For a head
whose acceleration is at most a, told at equal intervals over W seconds, it is off by at most

    a / 2 * (h^2 + h W + W^2 / 6)

h seconds after the newest position: the error of a line fitted to a parabola, the worst case since the error's Peano
kernel has one sign. Without prediction it would be off by the way of h seconds.

A tracker that falls silent: after FADED_S the eye stays where it was last; after HELD_S it glides back to the view's
own eye. Whatever the tracker tells, the eye moves steadily and stays before the panels.
"""

from __future__ import annotations

import math
from collections import deque
from typing import NamedTuple

import numpy as np

from wall.config.tracking import TrackingConfig
from wall.core.data import Float64

WINDOW_S = 0.06  # of the line: longer is smoother, and later to see a turn
FEWEST, SHORTEST_S = 3, 0.01  # positions, seconds: of less no speed is taken
REMEMBERED = 64  # positions; at 1000 a second the window is as long as these
LONGEST_S = 0.1  # beyond the newest position nothing is foreseen: a viewer reacts in twice that time
FADED_S = 0.1  # of silence: what moved is not expected to go on
HELD_S = 1.0  # of silence: a hand before the tracker is gone by then
RETURN_M_S = 0.5  # then the eye glides back
FOLLOW_M_S = 5.0  # the eye moves no faster, so that a tracker that comes back makes no cut; heads do not reach it
JUMP_M_S, JUMP_M = 10.0, 0.05  # what goes faster, and this farther, is no head
RETAKEN = 10  # positions beyond a jump that agree with each other: the tracker has another head, or began wrong
STILL_M = 5e-4  # a nearer eye is the one that is shown: at rest trembling makes no new images
NEAREST_M = 0.05  # before the panels

Position = tuple[float, float, float]


class Told(NamedTuple):
    """A position that a tracker told."""

    time: float  # when the eye was there, seconds of the head's clock
    position: Float64  # (3,) metres, wall frame


class Planes(NamedTuple):
    """What an eye has to stay before."""

    normals: Float64  # (n, 3) unit, to the viewer
    nearest: Float64  # (n,) metres along the normals, wall frame


def wall_from_tracker(config: TrackingConfig, told: Position) -> Float64:
    """(3,) metres, wall frame: where the eye is when the tracker tells a position, in its own units and axes."""
    signs = [-1.0 if axis.startswith("-") else 1.0 for axis in config.axes]
    found = [sign * told["xyz".index(axis[-1])] for sign, axis in zip(signs, config.axes, strict=True)]
    position: Float64 = config.metres_per_unit * np.array(found) + np.array(config.origin)
    return position


def tracker_from_wall(config: TrackingConfig, position: Float64) -> Position:
    """What the tracker tells when the eye is at a position (3,), metres, wall frame."""
    told = [0.0, 0.0, 0.0]
    for axis, value in zip(
        config.axes, ((position - np.array(config.origin)) / config.metres_per_unit).tolist(), strict=True
    ):
        told["xyz".index(axis[-1])] = -value if axis.startswith("-") else value
    return (told[0], told[1], told[2])


class TrackedEye:
    """`take` every position that is told, `at` every time that the eye is asked for."""

    def __init__(self, rest: Float64, planes: Planes, *, ahead_s: float | None) -> None:
        """`rest`: (3,) metres, wall frame: the view's own eye.

        `ahead_s`: from when the eye is asked for to the light of its image; None: nothing is predicted.
        """
        self._rest, self._planes, self._ahead_s = rest, planes, ahead_s
        self._told: deque[Told] = deque(maxlen=REMEMBERED)
        self._beyond: list[Told] = []  # a jump
        self._heard = -math.inf
        self._shown, self._last = rest, -math.inf  # where the eye is, when that was asked

    def take(self, position: Float64, arrived: float, delay_s: float) -> str:
        """A position (3,), metres, wall frame, and when it came. Returns why it is left out, "" where it is not."""
        told = Told(arrived - delay_s, position)
        if not np.isfinite(position).all():
            return "tracker_bad_packet"
        if self._told and told.time - self._told[-1].time < HELD_S and _jumps(self._told[-1], told):
            beyond = self._beyond
            self._beyond = [*beyond, told] if not beyond or not _jumps(beyond[-1], told) else [told]
            if len(self._beyond) < RETAKEN:
                return "tracker_jump"
            self._told.clear()
            self._told.extend(self._beyond)
        else:
            self._told.append(told)
        self._beyond, self._heard = [], arrived
        return ""

    def at(self, now: float) -> Position:
        """From the view's own eye to the tracked one, metres, wall frame, when what is made now becomes light."""
        wanted, fastest = self._wanted(now)
        step, self._last = max(now - self._last, 0.0), now
        away = self._before(wanted) - self._shown
        distance = float(np.linalg.norm(away))
        if distance > STILL_M or wanted is self._rest:
            share = min(1.0, fastest * step / distance) if distance > 0.0 else 1.0
            moved = self._shown + share * away if share < 1.0 else self._shown + away
            self._shown = self._rest if wanted is self._rest and share == 1.0 else moved
        x, y, z = (self._shown - self._rest).tolist()
        return (x, y, z)

    def _wanted(self, now: float) -> tuple[Float64, float]:
        """(3,) metres, wall frame, and the speed to go there, m/s."""
        silence = now - self._heard
        if not self._told or silence > HELD_S:
            return self._rest, RETURN_M_S
        newest = self._told[-1]
        if self._ahead_s is None or silence > FADED_S:
            return newest.position, FOLLOW_M_S
        ahead = min(max(now + self._ahead_s - newest.time, 0.0), LONGEST_S)
        recent = [told for told in self._told if told.time >= newest.time - WINDOW_S]
        if len(recent) < FEWEST or newest.time - recent[0].time < SHORTEST_S:
            return newest.position, FOLLOW_M_S
        times = np.array([told.time - newest.time for told in recent])
        places = np.array([told.position for told in recent])
        middle = times.mean()
        speed = (times - middle) @ places / ((times - middle) @ (times - middle))
        wanted: Float64 = places.mean(axis=0) + (ahead - middle) * speed
        return wanted, FOLLOW_M_S

    def _before(self, position: Float64) -> Float64:
        """A position (3,), moved before all panels where it is not; where none is found near, the one that is shown."""
        normals, nearest = self._planes
        found = position
        for _ in range(4):  # out of a corner of three panels, and once more for panels that do not stand square
            for normal, least in zip(normals, nearest, strict=True):
                found = found + max(0.0, least - float(found @ normal)) * normal
        return found if (normals @ found >= nearest - 1e-9).all() else self._shown


def _jumps(before: Told, after: Told) -> bool:
    away = float(np.linalg.norm(after.position - before.position))
    return away > JUMP_M + JUMP_M_S * max(after.time - before.time, 0.0)
