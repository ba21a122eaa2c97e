"""Models of `surface:` of a panel: the part of a cylinder or of a dome that it lights, instead of corners."""

from __future__ import annotations

import math
from typing import Annotated, Literal

from annotated_types import Ge, Le
from pydantic import Field, model_validator

from wall.core.fields import Direction, Model, Number, Point, refusal

WIDEST = 150.0  # degrees: no eye sees more of it through a flat image
LEAST = 0.01  # degrees

Radius = Annotated[Number, Ge(0.01), Le(1e4)]
Angle = Annotated[Number, Ge(-360.0), Le(360.0)]
Latitude = Annotated[Number, Ge(-90.0), Le(90.0)]
Height = Annotated[Number, Ge(-1e4), Le(1e4)]
Side = Literal["inside", "outside"]
SIDE = "the side that shines: inside, to a viewer whom it surrounds, or outside, as around a column"


def _check_angles(name: str, angles: tuple[float, float]) -> None:
    if not LEAST <= angles[1] - angles[0] <= WIDEST:
        came = f"span {angles[1] - angles[0]:g} degrees"
        raise refusal(came, accepted=f"two angles that grow by at most {WIDEST:g}, or narrower panels", at=(name,))


class CylinderConfig(Model):
    """A part of a cylinder. Its pixels are equally wide along the arc, and equally high."""

    type: Literal["cylinder"] = Field(description="a part of a cylinder")
    centre: Point = Field(default=(0.0, 0.0, 0.0), description="a point of the axis, metres in the wall's frame")
    axis: Direction = Field(default=(0.0, 1.0, 0.0), description="direction of the axis, up as the viewer sees it")
    radius: Radius = Field(description="metres")
    angles: tuple[Angle, Angle] = Field(
        description="degrees about the axis of its left edge and of its right one, growing to the viewer's right; 0 is "
        "straight ahead (-z), seen from outside straight before the viewer (z)"
    )
    heights: tuple[Height, Height] = Field(description="of its lower edge and of its upper one, metres from the centre")
    side: Side = Field(default="inside", description=SIDE)

    @model_validator(mode="after")
    def _has_an_area(self) -> CylinderConfig:
        _check_angles("angles", self.angles)
        if not self.heights[1] - self.heights[0] >= 1e-4:
            raise refusal("do not grow", accepted="the lower edge, then the upper one", at=("heights",))
        return self

    @property
    def whole(self) -> tuple[object, ...]:
        """What the panels of one cylinder have in common."""
        return self.type, self.centre, self.axis, self.radius, self.side

    @property
    def size(self) -> tuple[float, float]:
        """Width along the arc and height, metres."""
        return math.radians(self.angles[1] - self.angles[0]) * self.radius, self.heights[1] - self.heights[0]

    @property
    def place(self) -> tuple[float, float]:
        """Metres along the surface to the left edge, from straight ahead, and down to the upper one."""
        return math.radians(self.angles[0]) * self.radius, -self.heights[1]


class DomeConfig(Model):
    """A part of a sphere, between two azimuths and two elevations. Its pixels have equal angles both ways."""

    type: Literal["dome"] = Field(description="a part of a dome")
    centre: Point = Field(default=(0.0, 0.0, 0.0), description="of the sphere, metres in the wall's frame")
    radius: Radius = Field(description="metres")
    tilt: Angle = Field(
        default=0.0, description="degrees by which the zenith leans forward (to -z) from the wall's up (y)"
    )
    azimuths: tuple[Angle, Angle] = Field(
        description="degrees about the zenith of its left edge and of its right one, growing to the right; 0 is ahead"
    )
    elevations: tuple[Latitude, Latitude] = Field(
        description="degrees above the equator of its lower edge and of its upper one; 90 is the zenith"
    )
    side: Side = Field(default="inside", description=SIDE)

    @model_validator(mode="after")
    def _has_an_area(self) -> DomeConfig:
        _check_angles("azimuths", self.azimuths)
        _check_angles("elevations", self.elevations)
        return self

    @property
    def whole(self) -> tuple[object, ...]:
        """What the panels of one dome have in common."""
        return self.type, self.centre, self.tilt, self.radius, self.side

    @property
    def size(self) -> tuple[float, float]:
        """Width along the equator, wherever it is, and height, metres."""
        across, up = self.azimuths[1] - self.azimuths[0], self.elevations[1] - self.elevations[0]
        return math.radians(across) * self.radius, math.radians(up) * self.radius

    @property
    def place(self) -> tuple[float, float]:
        """Metres along the equator to the left edge, from straight ahead, and down to the upper one."""
        return math.radians(self.azimuths[0]) * self.radius, -math.radians(self.elevations[1]) * self.radius


SurfaceConfig = Annotated[CylinderConfig | DomeConfig, Field(discriminator="type")]
