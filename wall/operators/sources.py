"""`picture` and `constant`: framelets that nobody renders, for tests, test patterns and backgrounds."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

from annotated_types import Ge, Gt, Le
from pydantic import Field, model_validator

from wall.core.data import Channels, Framelet, Rect
from wall.core.errors import ConfigError
from wall.core.fields import FARTHEST, Color, Name, Number, Text, Whole, refusal
from wall.operators import image_file as files
from wall.operators.base import Area, Operator
from wall.operators.parts import blank, part

Distance = Annotated[Number, Gt(0.0), Le(FARTHEST)]
Share = Annotated[Number, Ge(0.0), Le(1.0)]
Order = Annotated[Whole, Ge(-1000), Le(1000)]


class Placed(Operator):
    """A source that lies at a fixed place in the frame."""

    area: Area | None = Field(default=None, description="x, y, width, height in the frame, pixels")
    panel: Name | None = Field(default=None, description="id of the panel that it covers, instead of an area")
    order: Order | None = Field(default=None, description="for `over`: the smaller is the nearer")

    TAKES: ClassVar[Literal["nothing", "samples", "framelet"]] = "nothing"
    NEEDS: ClassVar[Channels] = frozenset()

    @model_validator(mode="after")
    def _one_of_two(self) -> Placed:
        if (self.area is None) == (self.panel is None):
            raise refusal("needs either an area or a panel", accepted="area: [x, y, width, height] or panel: ID")
        return self

    def rect(self, inputs: Sequence[Rect]) -> Rect:
        """Its area. ValueError as long as a panel's id has not been replaced by one."""
        if self.area is None:
            raise ValueError(f"{self.id}: the area of panel {self.panel} is not known yet")
        x, y, width, height = self.area
        return Rect(x=x, y=y, width=width, height=height)


class Constant(Placed):
    """One colour."""

    op: Literal["constant"] = Field(description="one colour")
    colour: Color = Field(description="linear RGB, not yet times alpha")
    alpha: Share = Field(default=1.0, description="0..1")
    depth: Distance | None = Field(default=None, description="distance from the eye, world units; absent: no depth")

    def gives(self, inputs: Sequence[Channels]) -> Channels:
        return frozenset({"colour", "alpha"} | ({"depth"} if self.depth is not None else set()))

    def apply(self, inputs: Sequence[Framelet], out: Framelet, region: Rect, prepared: Any) -> None:
        blank(out, region)
        part(out, "colour", region)[...] = [self.alpha * c for c in self.colour]
        if out.alpha is not None:
            part(out, "alpha", region)[...] = self.alpha
        if out.depth is not None and self.depth is not None:
            part(out, "depth", region)[...] = self.depth


class Picture(Placed):
    """A PNG or EXR file, as large as its area."""

    op: Literal["picture"] = Field(description="a PNG or EXR file")
    file: Text = Field(description="PNG, or EXR with R, G, B or Y, and A, Z")
    depth: Distance | Literal["file"] | None = Field(
        default=None, description="distance from the eye, world units, of all pixels; file: the EXR's channel Z"
    )

    def gives(self, inputs: Sequence[Channels]) -> Channels:
        return frozenset({"colour", "alpha"} | ({"depth"} if self.depth is not None else set()))

    def prepare(self, folder: Path, inputs: Sequence[Rect]) -> files.Picture:
        """Raises ConfigError: the file cannot be read, has another size than the area, or lacks Z."""
        picture, rect = files.read(folder / self.file), self.rect([])
        if picture.size != (rect.width, rect.height):
            came = f"{picture.size[0]} x {picture.size[1]} pixels"
            wanted = f"{rect.width} x {rect.height}, the area of '{self.id}'"
            raise ConfigError(f"{folder / self.file}: is {came}, wanted {wanted}; a `scale` behind it can change that")
        if self.depth == "file" and picture.depth is None:
            raise ConfigError(f"{folder / self.file}: has no channel Z, wanted one for depth: file of '{self.id}'")
        return picture

    def apply(self, inputs: Sequence[Framelet], out: Framelet, region: Rect, prepared: files.Picture) -> None:
        there = region.inside(out.rect)
        blank(out, region)
        part(out, "colour", region)[...] = prepared.colour[there]
        if out.alpha is not None:
            part(out, "alpha", region)[...] = prepared.alpha[there]
        if out.depth is not None and self.depth is not None:
            distance = prepared.depth[there] if self.depth == "file" and prepared.depth is not None else self.depth
            part(out, "depth", region)[...] = distance
