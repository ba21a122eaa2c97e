"""Smooth motion through given points at given times."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from wall.core.data import Float64


def wrapped(times: Sequence[float], time: float, *, loop: bool) -> float:
    """The time within [times[0], times[-1]]: repeated if it loops, else held at the ends."""
    first, last = times[0], times[-1]
    if loop and last > first:
        return first + math.fmod(math.fmod(time - first, last - first) + (last - first), last - first)
    return min(max(time, first), last)


def catmull_rom(times: Sequence[float], points: ArrayLike, time: float, *, loop: bool) -> Float64:
    """The point at a time, by a non-uniform Catmull-Rom spline (Hermite, central-difference tangents).

    Passes through every point at its time with a continuous velocity. At the ends the tangent is one-sided; a
    loop whose last point equals its first is smooth there as well, another jumps back.

    Parameters
    ----------
    times : (n,) seconds, growing
    points : (n, d) float64
    time : seconds, any

    Returns
    -------
    point : (d,) float64

    Source: Catmull and Rom 1974; Hermite form as in Kochanek and Bartels 1984 without their three parameters.
    """
    positions = np.asarray(points, dtype=np.float64)
    if len(times) == 1:
        only: Float64 = positions[0].copy()
        return only
    now = wrapped(times, time, loop=loop)
    i = min(int(np.searchsorted(times, now, side="right")) - 1, len(times) - 2)
    span = times[i + 1] - times[i]
    s = (now - times[i]) / span
    leave = span * _tangent(times, positions, i, loop=loop)
    arrive = span * _tangent(times, positions, i + 1, loop=loop)
    step = positions[i + 1] - positions[i]
    # written about positions[i], so that points far from the origin lose nothing
    found: Float64 = positions[i] + s * (leave + s * (3 * step - 2 * leave - arrive + s * (leave + arrive - 2 * step)))
    return found


def _tangent(times: Sequence[float], positions: Float64, i: int, *, loop: bool) -> Float64:
    """(d,) velocity at point i: the slope between its neighbours."""
    last = len(times) - 1
    closed = loop and bool(np.all(positions[0] == positions[last]))
    if i in (0, last) and closed:
        before, after = positions[last] - positions[last - 1], positions[1] - positions[0]
        span = times[last] - times[last - 1] + times[1] - times[0]
        found: Float64 = (before + after) / span
        return found
    low, high = max(i - 1, 0), min(i + 1, last)
    slope: Float64 = (positions[high] - positions[low]) / (times[high] - times[low])
    return slope
