"""What scenes say of cameras: those that a model brings, and the lens before an eye."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wall.core.data import Float32, Float64


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class NamedCamera:
    """A camera that a scene's source brings."""

    name: str
    world_from_camera: Float64  # (4, 4) rigid; it looks along its -z, its y is up
    fov: float  # vertical, degrees


@dataclass(frozen=True, slots=True, kw_only=True)
class Lens:
    """A thin lens before the eye, parallel to the wall's x and y."""

    radius: float  # world units
    focus: float  # world units from the eye to the plane in focus

    @property
    def aperture(self) -> float:
        """Its diameter, world units."""
        return 2 * self.radius

    def rows(self, rotation: Float64) -> Float32:
        """(3, 3) float32, what tracing.kernels.lens wants, for a camera's rotation (3, 3)."""
        right, up, back = rotation.T
        return np.array([self.radius * right, self.radius * up, -back / self.focus], np.float32)
