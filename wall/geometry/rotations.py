"""Rotations of many things at once, as turns, unit quaternions and matrices.

A turn is (..., 3) float64: axis times radians, counterclockwise seen from the axis' tip. A quaternion is (..., 4)
float64: (w, x, y, z). Ways between two are great arcs (Shoemake, "Animating Rotation with Quaternion Curves", 1985).
NumPy alone: scipy.spatial.transform does the same and takes 0.2 s to import, at every start of a wall.
"""

from __future__ import annotations

import numpy as np

from wall.core.data import Float64


def quaternions_of(turns: Float64) -> Float64:
    """(..., 4) unit quaternions of turns (..., 3); the sine over the angle is exact down to no turn at all."""
    half = np.sqrt((turns**2).sum(axis=-1, keepdims=True)) / 2.0
    return np.concatenate([np.cos(half), turns * (np.sinc(half / np.pi) / 2.0)], axis=-1)


def matrices_of(quaternions: Float64) -> Float64:
    """(..., 3, 3) rotations of unit quaternions (..., 4)."""
    q = quaternions
    products = 2.0 * q[..., :, None] * q[..., None, :]
    w, x, y, z = (products[..., k, :] for k in range(4))
    found = np.empty((*q.shape[:-1], 3, 3))
    found[..., 0, 0], found[..., 0, 1], found[..., 0, 2] = (
        1.0 - y[..., 2] - z[..., 3],
        x[..., 2] - w[..., 3],
        x[..., 3] + w[..., 2],
    )
    found[..., 1, 0], found[..., 1, 1], found[..., 1, 2] = (
        x[..., 2] + w[..., 3],
        1.0 - x[..., 1] - z[..., 3],
        y[..., 3] - w[..., 1],
    )
    found[..., 2, 0], found[..., 2, 1], found[..., 2, 2] = (
        x[..., 3] - w[..., 2],
        y[..., 3] + w[..., 1],
        1.0 - x[..., 1] - y[..., 2],
    )
    return found


def on_the_way(begin: Float64, end: Float64, share: Float64) -> Float64:
    """(..., 4) unit quaternions at shares (..., 1) of the shorter way from unit quaternions `begin` to `end`."""
    between = _product(begin * (1.0, -1.0, -1.0, -1.0), end)
    between = np.where(between[..., :1] < 0.0, -between, between)
    sine = np.sqrt((between[..., 1:] ** 2).sum(axis=-1, keepdims=True))
    axis = between[..., 1:] / np.where(sine > 0.0, sine, 1.0)
    return _product(begin, quaternions_of(axis * (2.0 * share * np.arctan2(sine, between[..., :1]))))


def _product(first: Float64, second: Float64) -> Float64:
    """(..., 4) quaternions of `second`'s rotations followed by `first`'s."""
    a, b, c, d = np.moveaxis(first, -1, 0)
    w, x, y, z = np.moveaxis(second, -1, 0)
    return np.stack(
        [
            a * w - b * x - c * y - d * z,
            a * x + b * w + c * z - d * y,
            a * y - b * z + c * w + d * x,
            a * z + b * y - c * x + d * w,
        ],
        axis=-1,
    )
