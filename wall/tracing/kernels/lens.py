"""A thin lens: primary rays start on a disc about the eye and meet in the plane that is in focus."""

from __future__ import annotations

import math

from wall.core.jit import inline_kernel
from wall.tracing import embree
from wall.tracing.kernels import rows
from wall.tracing.kernels.ggx import TWO_PI
from wall.tracing.kernels.random_numbers import random_pair
from wall.tracing.kernels.rows import set_xyz, xyz
from wall.tracing.kernels.values import ONE, ZERO

LENS_PAIR = (1 << 16) - 1  # of random numbers, beyond those of all bounces


@inline_kernel
def open_lens(lens, first, count, paths, work):
    """Moves the starts of a packet's primary rays onto the lens and turns them to where they focus; None does nothing.

    lens : (3, 3) float32 | None, see RayFrame; paths : Paths, its keys set
    """
    if lens is not None:
        p = work.packet
        for lane in range(16):
            k = first + min(lane, count - 1)
            u, v = random_pair(paths.key[k], paths.number[k], LENS_PAIR)
            size, turn = math.sqrt(u), TWO_PI * v
            a, b = size * math.cos(turn), size * math.sin(turn)
            ox, oy = a * lens[0, 0] + b * lens[1, 0], a * lens[0, 1] + b * lens[1, 1]
            oz = a * lens[0, 2] + b * lens[1, 2]
            dx, dy, dz = xyz(p, embree.DIRECTION_X, lane)
            reach = ONE / (dx * lens[2, 0] + dy * lens[2, 1] + dz * lens[2, 2])
            dx, dy, dz = reach * dx - ox, reach * dy - oy, reach * dz - oz
            scale = ONE / math.sqrt(dx * dx + dy * dy + dz * dz)
            set_xyz(p, embree.ORIGIN_X, lane, ox, oy, oz)
            set_xyz(p, embree.DIRECTION_X, lane, scale * dx, scale * dy, scale * dz)


@inline_kernel
def keep_distances(lens, samples, first, count, work):
    """Sets samples' depths to the distance of what they hit from the eye, not from the lens; None does nothing."""
    if lens is not None:
        p = work.packet
        for lane in range(count):
            if p[rows.HIT + lane] != ZERO:
                x, y, z = xyz(p, rows.POSITION_X, lane)
                samples[first + lane]["depth"] = math.sqrt(x * x + y * y + z * z)
