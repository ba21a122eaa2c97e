"""Planes of pixels in the wall's frame, metres."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wall.core.data import Float64


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Plane:
    """Virtual-screen pixels to metres: the point of (X, Y) is origin + X * per_x + Y * per_y, wall frame."""

    origin: Float64  # (3,) metres, the virtual screen's top left corner
    per_x: Float64  # (3,) metres a pixel to the right
    per_y: Float64  # (3,) metres a pixel down

    def point(self, x: float | Float64, y: float | Float64) -> Float64:
        """(3,) float64, metres, wall frame, of virtual-screen pixel coordinates; (..., 3) of arrays (..., 1)."""
        found: Float64 = self.origin + x * self.per_x + y * self.per_y
        return found

    @property
    def normal(self) -> Float64:
        """(3,) float64, unit, towards the viewer."""
        across = np.cross(self.per_y, self.per_x)
        found: Float64 = across / np.linalg.norm(across)
        return found
