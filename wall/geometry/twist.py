"""Twists: the rigid motion that takes one camera to another, and any multiple of it.

A twist is (6,) float64: a turn (axis times radians) and a shift (world units), both in the camera's own frame. An
orbit, a turn on the spot and a straight flight are each one twist at constant speed. Exponential and logarithm of
SE(3) as in Murray, Li and Sastry, "A Mathematical Introduction to Robotic Manipulation", 1994, ch. 2.

Vectors of three and matrices of nine numbers, row major, are tuples here: every rank predicts at every refresh, and
NumPy takes five to ten times as long for arrays so small.
"""

from __future__ import annotations

import math
from typing import TypeAlias

import numpy as np

from wall.core.data import Camera, Float64

Vector: TypeAlias = tuple[float, float, float]
Matrix: TypeAlias = tuple[float, ...]

NEARLY_STRAIGHT = 1e-4  # radians; below it the series' next term is under 1e-13 of the first


def between(start: Camera, end: Camera) -> Float64:
    """(6,) the twist that takes `start` to `end`, its turn at most half a circle."""
    old = _transposed(start.world_from_wall)
    (ax, ay, az), (bx, by, bz) = start.position, end.position
    turn = _log(_product(old, end.world_from_wall))
    square = _dot(turn, turn)
    if square < NEARLY_STRAIGHT**2:
        second = 1.0 / 12.0
    else:  # of the inverse of the mean turn
        half = math.sqrt(square) / 2.0
        second = (1.0 - half * math.cos(half) / math.sin(half)) / square
    shift = _turned(turn, _apply(old, (bx - ax, by - ay, bz - az)), -0.5, second)
    return np.array(turn + shift)


def moved(camera: Camera, twist: Float64) -> Camera:
    """The camera after a twist (6,) of its own frame; by all zeros the same bits."""
    a, b, c, x, y, z = twist.tolist()
    if not (a or b or c or x or y or z):
        return camera
    turn, old = (a, b, c), camera.world_from_wall
    square = _dot(turn, turn)
    if square < NEARLY_STRAIGHT**2:
        first, second = 0.5, 1.0 / 6.0
    else:  # of the mean of the rotations from none to the turn: what a shift in a turning frame comes to
        angle = math.sqrt(square)
        first, second = (1.0 - math.cos(angle)) / square, (angle - math.sin(angle)) / (angle * square)
    (px, py, pz), (dx, dy, dz) = camera.position, _apply(old, _turned(turn, (x, y, z), first, second))
    return Camera(position=(px + dx, py + dy, pz + dz), world_from_wall=_product(old, _rotation(turn)), eye=camera.eye)


def rotation_by(turn: Float64) -> Float64:
    """(3, 3) rotation by a turn (3,), axis times radians: counterclockwise seen from the axis' tip."""
    x, y, z = turn.tolist()
    return np.array(_rotation((x, y, z))).reshape(3, 3)


def _rotation(turn: Vector) -> Matrix:
    """By way of a unit quaternion; the sine over the angle is exact down to no turn at all."""
    angle = math.sqrt(_dot(turn, turn))
    scale = math.sin(angle / 2.0) / angle if angle > 0.0 else 0.5
    w, x, y, z = math.cos(angle / 2.0), scale * turn[0], scale * turn[1], scale * turn[2]
    return (
        1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y),
        2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x),
        2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y),
    )  # fmt: skip


def _log(rotation: Matrix) -> Vector:
    """Axis times radians, 0 to pi. Of half a circle, whose axis has no sign, some finite turn."""
    a, b, c, d, e, f, g, h, i = rotation
    x, y, z = (h - f) / 2.0, (c - g) / 2.0, (d - b) / 2.0
    sine = math.sqrt(x * x + y * y + z * z)
    scale = math.atan2(sine, (a + e + i - 1.0) / 2.0) / sine if sine > 0.0 else 1.0
    return (scale * x, scale * y, scale * z)


def _turned(turn: Vector, v: Vector, first: float, second: float) -> Vector:
    """v + first (turn x v) + second (turn x (turn x v))."""
    once = _cross(turn, v)
    twice = _cross(turn, once)
    return (
        v[0] + first * once[0] + second * twice[0],
        v[1] + first * once[1] + second * twice[1],
        v[2] + first * once[2] + second * twice[2],
    )


def _dot(a: Vector, b: Vector) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _cross(a: Vector, b: Vector) -> Vector:
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def _transposed(m: Matrix) -> Matrix:
    return (m[0], m[3], m[6], m[1], m[4], m[7], m[2], m[5], m[8])


def _apply(m: Matrix, v: Vector) -> Vector:
    a, b, c, d, e, f, g, h, i = m
    x, y, z = v
    return (a * x + b * y + c * z, d * x + e * y + f * z, g * x + h * y + i * z)


def _product(m: Matrix, n: Matrix) -> Matrix:
    a, b, c, d, e, f, g, h, i = m
    p, q, r, s, t, u, v, w, x = n
    return (
        a * p + b * s + c * v, a * q + b * t + c * w, a * r + b * u + c * x,
        d * p + e * s + f * v, d * q + e * t + f * w, d * r + e * u + f * x,
        g * p + h * s + i * v, g * q + h * t + i * w, g * r + h * u + i * x,
    )  # fmt: skip
