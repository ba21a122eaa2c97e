"""`legend`: a colour map's colours with their numbers and a title, drawn over an image in its own pixels."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, ClassVar, Literal

import numpy as np
from annotated_types import Ge, Le
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont
from pydantic import Field, model_validator

from wall.core.color_maps import ColorMap
from wall.core.colour import srgb_decoded
from wall.core.data import Float32, Framelet, Rect
from wall.core.fields import Text, Whole, refusal
from wall.operators.base import Area, Input, Operator, area_rect
from wall.operators.regions import copy, pixels_of

SHADE = 0.6  # share of the image that the box takes away
WHITE = (255, 255, 255, 255)
NICE = (1.0, 2.0, 2.5, 5.0, 10.0)  # steps between numbers, times a power of ten


@dataclass(frozen=True, slots=True)
class Drawn:
    """The legend's pixels; colour is sRGB, 0..1, and covers a share of what is below."""

    rect: Rect
    color: Float32  # (h, w, 3)
    cover: Float32  # (h, w) 0..1


class Legend(Operator):
    """A bar of colours with numbers and a title on a darkened box, upright where the area is higher than wide."""

    op: Literal["legend"] = Field(description="a colour map's colours with their numbers")
    input: Input
    color_map: ColorMap = Field(description="as in the scene; it must have a range")
    title: Text | None = Field(default=None, description="above the colours: what the numbers are, and their unit")
    area: Area = Field(description="x, y, width, height in the frame, pixels")
    size: Annotated[Whole, Ge(6), Le(512)] = Field(default=16, description="height of a line of text, pixels")

    MOVES: ClassVar[bool] = True  # it draws into linear and encoded colour alike

    @model_validator(mode="after")
    def _has_numbers(self) -> Legend:
        if self.color_map.range is None:
            raise refusal("has no range, and a legend knows no data", accepted="[lower, upper]", at=("color_map",))
        _, _, width, height = self.area
        least = 4 * self.size
        if min(width, height) < least:
            raise refusal(
                f"is {width} x {height} pixels, too little for text of {self.size}",
                accepted=f"{least} x {least} pixels or more, or a smaller size", at=("area",),
            )  # fmt: skip
        across, down = self._title_size()
        if across > width:
            raise refusal(
                f"is {width} pixels wide, and the title takes {across} at size {self.size}",
                accepted="a wider area, a smaller size, or a title on several lines", at=("area",),
            )  # fmt: skip
        if height - down - 2 * self.size < self.size // 2:
            raise refusal(
                f"is {height} pixels high, of which the title takes {down} and the numbers {2 * self.size}",
                accepted=f"{down + 2 * self.size + self.size // 2} pixels or more, or a smaller size", at=("area",),
            )  # fmt: skip
        return self

    def _title_size(self) -> tuple[int, int]:
        """Pixels across and down that the title takes, with margins left, right and above; without one a margin."""
        margin = self.size // 2
        if self.title is None:
            return 0, margin
        pen, font = ImageDraw.Draw(Image.new("L", (1, 1))), ImageFont.load_default(self.size)
        _, _, right, bottom = pen.multiline_textbbox((margin, margin), self.title, font=font)
        return math.ceil(right) + margin, int(bottom) + margin

    def prepare(self, folder: Path, inputs: Sequence[Rect]) -> Drawn:
        """The legend as pixels."""
        rect = area_rect(self.area)
        image = Image.new("RGBA", (rect.width, rect.height), (0, 0, 0, round(255 * SHADE)))
        self._paint(image)
        values = np.asarray(image, np.float32) / np.float32(255.0)
        return Drawn(rect, values[..., :3], values[..., 3])

    def apply(self, inputs: Sequence[Framelet], out: Framelet, region: Rect, prepared: Drawn) -> None:
        """Copy a region, with the legend over it."""
        copy(inputs[0], out, region)
        overlap = prepared.rect.intersection(region)
        if overlap is None:
            return
        where = overlap.inside(prepared.rect)
        cover, color = prepared.cover[where][..., None], prepared.color[where]
        below = pixels_of(out, "colour", overlap)
        if out.encoded:
            below[...] = np.round(below * (1.0 - cover) + 255.0 * cover * color)
        else:
            below[...] = below * (1.0 - cover) + cover * srgb_decoded(color)
        if out.alpha is not None:
            alpha = pixels_of(out, "alpha", overlap)
            alpha[...] = 1.0 - (1.0 - alpha) * (1.0 - cover[..., 0])

    def _paint(self, image: Image.Image) -> None:
        pen, font, margin = ImageDraw.Draw(image), ImageFont.load_default(self.size), self.size // 2
        upright = image.height > image.width
        if self.title is not None:
            pen.multiline_text((margin, margin), self.title, fill=WHITE, font=font)
        bar = self._bar(image.size, self._title_size()[1], upright=upright)
        image.paste(Image.fromarray(self._colors(bar, upright=upright)), (bar.x, bar.y))
        for number in self._numbers(bar.height // (2 * self.size) if upright else bar.width // (4 * self.size)):
            share = float(self.color_map.places(np.array([number]))[0])
            text = f"{number:.6g}"
            if upright:
                y = bar.bottom - 1 - round(share * (bar.height - 1))
                pen.line((bar.right, y, bar.right + margin // 2, y), fill=WHITE)
                pen.text((bar.right + margin, y), text, fill=WHITE, font=font, anchor="lm")
            else:
                x = bar.x + round(share * (bar.width - 1))
                pen.line((x, bar.bottom, x, bar.bottom + margin // 2), fill=WHITE)
                pen.text((x, bar.bottom + margin), text, fill=WHITE, font=font, anchor="mt")

    def _bar(self, size: tuple[int, int], top: int, *, upright: bool) -> Rect:
        """Where the colours are in an image of this size, below `top`; half a number's height is left at its ends."""
        width, height = size
        if upright:
            return Rect(x=self.size // 2, y=top + self.size // 2, width=self.size, height=height - top - 2 * self.size)
        aside = 2 * self.size
        return Rect(x=aside, y=top, width=max(1, width - 2 * aside), height=height - top - 2 * self.size)

    def _colors(self, bar: Rect, *, upright: bool) -> NDArray[np.uint8]:
        """(h, w, 4) bytes of the bar."""
        table = self.color_map.table()
        steps = np.linspace(0.0, len(table) - 1.0, bar.height if upright else bar.width)
        rows = np.stack([np.interp(steps, np.arange(len(table)), table[:, k]) for k in range(3)], axis=1)
        codes = np.full((*steps.shape, 4), 255, np.uint8)
        codes[:, :3] = np.round(255.0 * rows)
        whole = codes[::-1, None] if upright else codes[None]
        return np.ascontiguousarray(np.broadcast_to(whole, (bar.height, bar.width, 4)))

    def _numbers(self, most: int) -> list[float]:
        """Round numbers in the range, as many as there is room for: on a log scale powers of ten."""
        low, high = self.color_map.range or (0.0, 1.0)
        if self.color_map.scale == "log":
            first, last = math.ceil(math.log10(low) - 1e-9), math.floor(math.log10(high) + 1e-9)
            apart = max(1, math.ceil((last - first + 1) / max(most, 1)))
            return [10.0**k for k in range(first, last + 1, apart)] or [low, high]
        wanted = (high - low) / max(most, 1)
        power = 10.0 ** math.floor(math.log10(wanted))
        step = next(nice * power for nice in NICE if nice * power >= wanted * (1.0 - 1e-9))
        return [k * step for k in range(math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9) + 1)]
