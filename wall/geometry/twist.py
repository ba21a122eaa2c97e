"""Twists: the rigid motion that takes one camera to another, and any multiple of it.

A twist is (6,) float64: a turn (axis times radians) and a shift (world units), both in the camera's own frame. An
orbit, a turn on the spot and a straight flight are each one twist at constant speed. Exponential and logarithm of
SE(3) as in Murray, Li and Sastry, "A Mathematical Introduction to Robotic Manipulation", 1994, ch. 2.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from wall.core.data import Camera, Float64
from wall.geometry.rotations import matrices_of, quaternions_of

NEARLY_STRAIGHT = 1e-4  # radians; below it the series' next term is under 1e-13 of the first


def between(start: Camera, end: Camera) -> Float64:
    """(6,) the twist that takes `start` to `end`, its turn at most half a circle."""
    old = start.rotation()
    turn = _log(old.T @ end.rotation())
    shift = np.linalg.solve(_mean_turn(turn), old.T @ (end.origin() - start.origin()))
    return np.concatenate([turn, shift])


def moved(camera: Camera, twist: Float64) -> Camera:
    """The camera after a twist (6,) of its own frame; by all zeros the same bits."""
    if not twist.any():
        return camera
    turn, old = twist[:3], camera.rotation()
    there = Camera.of(camera.origin() + old @ (_mean_turn(turn) @ twist[3:]), old @ rotation_by(turn))
    return replace(there, eye=camera.eye)


def rotation_by(turn: Float64) -> Float64:
    """(3, 3) rotation by a turn (3,), axis times radians: counterclockwise seen from the axis' tip."""
    return matrices_of(quaternions_of(turn))


def _mean_turn(turn: Float64) -> Float64:
    """(3, 3) mean of the rotations from none to a turn (3,): what a shift in a turning frame comes to."""
    angle, skew = float(np.linalg.norm(turn)), _skew(turn)
    if angle < NEARLY_STRAIGHT:
        return np.asarray(np.eye(3) + skew / 2.0 + skew @ skew / 6.0)
    first, second = (1.0 - math.cos(angle)) / angle**2, (angle - math.sin(angle)) / angle**3
    return np.asarray(np.eye(3) + first * skew + second * (skew @ skew))


def _log(rotation: Float64) -> Float64:
    """(3,) axis times radians, 0 to pi. Of half a circle, whose axis has no sign, some finite turn."""
    r = rotation
    axis = np.array([r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]]) / 2.0
    sine = float(np.linalg.norm(axis))
    angle = math.atan2(sine, (float(np.trace(r)) - 1.0) / 2.0)
    return axis * (angle / sine) if sine > 0.0 else axis


def _skew(v: Float64) -> Float64:
    """(3, 3) cross-product matrix of v (3,)."""
    return np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])
