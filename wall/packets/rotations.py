"""Rotations as unit quaternions: four numbers on the wire instead of nine."""

from __future__ import annotations

import math
from functools import lru_cache

LARGEST_ERROR = 1e-6  # of a matrix element or a quaternion's length: what is further off is no rotation

Quaternion = tuple[float, float, float, float]


@lru_cache(maxsize=64)
def quaternion_of(matrix: tuple[float, ...]) -> Quaternion:
    """The unit quaternion (w, x, y, z) of a rotation, 9 numbers row major; any angle, 180 degrees too.

    Its largest component is computed first and is positive (Shepperd 1978). Raises ValueError if the matrix is further
    than 1e-6 from a rotation in any element, or is not finite.
    """
    if len(matrix) != 9 or not all(map(math.isfinite, matrix)):
        raise ValueError(f"{matrix} is not 9 finite numbers")
    a, b, c, d, e, f, g, h, i = matrix
    rows = (
        (1.0 + a + e + i, h - f, c - g, d - b),
        (h - f, 1.0 + a - e - i, b + d, c + g),
        (c - g, b + d, 1.0 - a + e - i, f + h),
        (d - b, c + g, f + h, 1.0 - a - e + i),
    )  # each is the quaternion times four times one of its components
    row = max(enumerate(rows), key=lambda found: found[1][found[0]])[1]
    length = math.hypot(*row)
    w, x, y, z = (value / length for value in row) if length else (1.0, 0.0, 0.0, 0.0)
    error = max(abs(p - q) for p, q in zip(rotation_of((w, x, y, z)), matrix, strict=True))
    if error > LARGEST_ERROR:
        raise ValueError(f"{matrix} is off by {error:.2g} from a rotation; wanted at most {LARGEST_ERROR:g}")
    return w, x, y, z


@lru_cache(maxsize=64)
def rotation_of(quaternion: Quaternion) -> tuple[float, ...]:
    """The rotation, 9 numbers row major, of a quaternion (w, x, y, z) of any length but 0."""
    w, x, y, z = quaternion
    s = 2.0 / (w * w + x * x + y * y + z * z)
    return (
        1.0 - s * (y * y + z * z), s * (x * y - w * z), s * (x * z + w * y),
        s * (x * y + w * z), 1.0 - s * (x * x + z * z), s * (y * z - w * x),
        s * (x * z - w * y), s * (y * z + w * x), 1.0 - s * (x * x + y * y),
    )  # fmt: skip


def is_unit(quaternion: Quaternion) -> bool:
    """Whether it is finite and as long as a rotation's is."""
    return abs(math.hypot(*quaternion) - 1.0) <= LARGEST_ERROR
