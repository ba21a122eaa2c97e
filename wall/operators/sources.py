"""`image` and `constant`: framelets that are not rendered, for tests, test patterns and backgrounds."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

from annotated_types import Gt, Le
from pydantic import Field

from wall.core.data import Channels, Framelet, Rect
from wall.core.errors import ConfigError
from wall.core.fields import FARTHEST, Color, Number, Order, Share, Text
from wall.operators.base import AreaOperator, area_rect
from wall.operators.image_file import ImageFile, read_image
from wall.operators.regions import blank, pixels_of

Distance = Annotated[Number, Gt(0.0), Le(FARTHEST)]


class Source(AreaOperator):
    """A framelet without inputs, of a fixed area of the frame."""

    order: Order | None = Field(default=None, description="for `over`: the smaller is the nearer")

    TAKES: ClassVar[Literal["nothing", "samples", "framelet"]] = "nothing"
    NEEDS: ClassVar[Channels] = frozenset()

    def rect(self, inputs: Sequence[Rect]) -> Rect:
        """Its area. ValueError as long as a panel's id has not been replaced by one."""
        if self.area is None:
            raise ValueError(f"{self.id}: the area of panel {self.panel} is not known yet")
        return area_rect(self.area)

    def gives(self, inputs: Sequence[Channels]) -> Channels:
        """Colour and alpha, and depth where the node has one."""
        return frozenset({"colour", "alpha"} | ({"depth"} if getattr(self, "depth", None) is not None else set()))

    def _fill(self, out: Framelet, region: Rect, colour: Any, alpha: Any, depth: Any) -> None:
        """Write values, or arrays of them, to the channels that the output has; depth may be None."""
        blank(out, region)
        for name, values in (("colour", colour), ("alpha", alpha), ("depth", depth)):
            if name in out.channels and values is not None:
                pixels_of(out, name, region)[...] = values


class Constant(Source):
    """One colour."""

    op: Literal["constant"] = Field(description="one colour")
    colour: Color = Field(description="linear RGB, not yet times alpha")
    alpha: Share = Field(default=1.0, description="0..1")
    depth: Distance | None = Field(default=None, description="distance from the eye, world units; absent: no depth")

    def apply(self, inputs: Sequence[Framelet], out: Framelet, region: Rect, prepared: Any) -> None:
        """Write the pixels of a region."""
        self._fill(out, region, [self.alpha * c for c in self.colour], self.alpha, self.depth)


class ImageSource(Source):
    """A PNG or EXR file, as large as its area."""

    op: Literal["image"] = Field(description="a PNG or EXR file")
    file: Text = Field(description="PNG, or EXR with R, G, B or Y, and A, Z")
    depth: Distance | Literal["file"] | None = Field(
        default=None, description="distance from the eye, world units, of all pixels; file: the EXR's channel Z"
    )

    def prepare(self, folder: Path, inputs: Sequence[Rect]) -> ImageFile:
        """Raises ConfigError: the file cannot be read, has another size than the area, or lacks Z."""
        image, rect = read_image(folder / self.file), self.rect([])
        if image.size != (rect.width, rect.height):
            came = f"{image.size[0]} x {image.size[1]} pixels"
            wanted = f"{rect.width} x {rect.height}, the area of '{self.id}'"
            raise ConfigError(f"{folder / self.file}: is {came}, wanted {wanted}; a `scale` behind it can change that")
        if self.depth == "file" and image.depth is None:
            raise ConfigError(f"{folder / self.file}: has no channel Z, wanted one for depth: file of '{self.id}'")
        return image

    def apply(self, inputs: Sequence[Framelet], out: Framelet, region: Rect, prepared: ImageFile) -> None:
        """Write the pixels of a region."""
        there = region.inside(out.rect)
        distance = prepared.depth[there] if self.depth == "file" and prepared.depth is not None else self.depth
        self._fill(out, region, prepared.colour[there], prepared.alpha[there], distance)
