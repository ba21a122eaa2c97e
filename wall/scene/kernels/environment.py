"""Looks up the radiance of a lat-long image that surrounds the scene, bilinear, by direction."""

from __future__ import annotations

import math

import numpy as np

from wall.core.jit import inline_kernel, kernel

HALF, ONE = np.float32(0.5), np.float32(1.0)
PER_TURN, PER_HALF_TURN = np.float32(0.5 / math.pi), np.float32(1.0 / math.pi)


@inline_kernel
def image_position(x, y, z, middle):
    """Where a direction of any length lies in the image: (u, v) in 0..1, u to the right, v from the top down.

    middle : float32, u of the direction -z, in turns
    """
    u = np.float32(math.atan2(x, -z)) * PER_TURN + middle
    v = np.float32(math.atan2(math.sqrt(x * x + z * z), y)) * PER_HALF_TURN
    return u - np.float32(math.floor(u)), v


@inline_kernel
def radiance_at(texels, u, v):
    """RGB of texels (h, w, 3) at (u, v) in 0..1: bilinear between texel centres, round the turn, not over the poles."""
    h, w = texels.shape[0], texels.shape[1]
    x, y = u * np.float32(w) - HALF, v * np.float32(h) - HALF
    i, j = math.floor(x), math.floor(y)
    fx, fy = x - np.float32(i), y - np.float32(j)
    left, right = i if i >= 0 else w - 1, i + 1 if i + 1 < w else 0
    top, bottom = max(j, 0), min(j + 1, h - 1)
    a, b, c, d = (ONE - fx) * (ONE - fy), fx * (ONE - fy), (ONE - fx) * fy, fx * fy
    upper_left, upper_right = texels[top, left], texels[top, right]
    lower_left, lower_right = texels[bottom, left], texels[bottom, right]
    return (
        a * upper_left[0] + b * upper_right[0] + c * lower_left[0] + d * lower_right[0],
        a * upper_left[1] + b * upper_right[1] + c * lower_left[1] + d * lower_right[1],
        a * upper_left[2] + b * upper_right[2] + c * lower_left[2] + d * lower_right[2],
    )


@kernel
def look_up(texels, middle, directions, radiance):
    """Writes the radiance (n, 3) float32 from directions (n, 3) float32 of any length; texels, middle : as above."""
    for k in range(directions.shape[0]):
        u, v = image_position(directions[k, 0], directions[k, 1], directions[k, 2], middle)
        radiance[k, 0], radiance[k, 1], radiance[k, 2] = radiance_at(texels, u, v)


@kernel
def environment_of_panel(frame, corner, texels, middle, colour):
    """Writes what a panel's pixel centres see of an environment.

    frame : (3, 3) float64, rows A, B, C: direction A + X B + Y C at virtual-screen position (X, Y)
    corner : (2,) float64, pixels; texels : (h, w, 3) float32; middle : see image_position
    colour : (h, w, 3) float32, written
    """
    for i in range(colour.shape[0]):
        for j in range(colour.shape[1]):
            x, y = corner[0] + j + 0.5, corner[1] + i + 0.5
            dx = np.float32(frame[0, 0] + x * frame[1, 0] + y * frame[2, 0])
            dy = np.float32(frame[0, 1] + x * frame[1, 1] + y * frame[2, 1])
            dz = np.float32(frame[0, 2] + x * frame[1, 2] + y * frame[2, 2])
            u, v = image_position(dx, dy, dz, middle)
            r, g, b = radiance_at(texels, u, v)
            colour[i, j, 0], colour[i, j, 1], colour[i, j, 2] = r, g, b
