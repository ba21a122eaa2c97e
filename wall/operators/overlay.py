"""`overlay`: lines of text over an image, with current statistics."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from annotated_types import Ge, Le
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont
from pydantic import AfterValidator, Field

from wall.core.data import Float32, Framelet, Rect
from wall.core.fields import Text, Whole, refusal
from wall.operators.base import Input, Operator
from wall.operators.regions import copy, pixels_of

PLACEHOLDERS = ("fps", "samples_per_s", "latency_ms", "ranks")
WIDEST = "0000000"  # a number as wide as any that is shown
MARGIN = 4  # pixels around the text
SHADE = 0.4  # share of the image that is left behind the text
_NAMED = re.compile(r"\{([^{}]*)\}")


def _known(text: str) -> str:
    for name in _NAMED.findall(text):
        if name not in PLACEHOLDERS:
            known = ", ".join(f"{{{known}}}" for known in PLACEHOLDERS)
            raise refusal(f"has no number for {{{name}}}", accepted=f"text with {known}")
    return text


@dataclass(slots=True)
class Statistics:
    """The numbers that an overlay shows: `prepare` makes it, the executor fills it in.

    When they change, the box (`Overlay.box`) must be applied again.
    """

    numbers: Mapping[str, float] = field(default_factory=dict)  # by placeholder


class Overlay(Operator):
    """White text on a darkened box in a corner. {fps} {samples_per_s} {latency_ms} {ranks} stand for numbers."""

    op: Literal["overlay"] = Field(description="text and numbers in a corner")
    input: Input
    text: Annotated[Text, AfterValidator(_known)] = Field(
        default="{fps} fps  {samples_per_s} samples/s  {latency_ms} ms", description="lines, with placeholders"
    )
    at: Literal["top_left", "top_right", "bottom_left", "bottom_right"] = Field(
        default="top_left", description="which corner"
    )
    size: Annotated[Whole, Ge(6), Le(512)] = Field(default=16, description="height of a line, pixels")

    MOVES: ClassVar[bool] = True  # it draws into linear and encoded colour alike

    def prepare(self, folder: Path, inputs: Sequence[Rect]) -> Statistics:
        """Numbers, none of them known yet."""
        return Statistics()

    def box(self, whole: Rect) -> Rect:
        """The rectangle of the text in an image, large enough for any numbers."""
        cover = _drawn(_NAMED.sub(WIDEST, self.text), self.size)
        width, height = min(cover.shape[1], whole.width), min(cover.shape[0], whole.height)
        x = whole.x if self.at.endswith("left") else whole.right - width
        y = whole.y if self.at.startswith("top") else whole.bottom - height
        return Rect(x=x, y=y, width=width, height=height)

    def apply(self, inputs: Sequence[Framelet], out: Framelet, region: Rect, prepared: Statistics) -> None:
        """Copy a region, with the text over it."""
        copy(inputs[0], out, region)
        box = self.box(out.rect)
        overlap = box.intersection(region)
        if overlap is None:
            return
        text = np.zeros((box.height, box.width), np.float32)
        drawn = _drawn(self.filled(prepared.numbers), self.size)[: box.height, : box.width]
        text[: drawn.shape[0], : drawn.shape[1]] = drawn
        _draw(out, overlap, text[overlap.inside(box)])

    def filled(self, numbers: Mapping[str, float]) -> str:
        """The text with its numbers; - for those that are not known."""
        return _NAMED.sub(lambda found: _number(numbers.get(found[1])), self.text)


def _number(value: float | None) -> str:
    """At most seven characters: 59.9, 1.25M."""
    if value is None or not np.isfinite(value):
        return "-"
    if value == int(value) and abs(value) < 10_000:
        return str(int(value))
    for unit, letter in ((1e9, "G"), (1e6, "M"), (1e3, "k")):
        if abs(value) >= unit:
            return f"{value / unit:.4g}{letter}"[: len(WIDEST)]
    return f"{value:.3g}"


def _drawn(text: str, size: int) -> Float32:
    """(h, w) float32, how much of each pixel the text covers."""
    font = ImageFont.load_default(size)
    pen = ImageDraw.Draw(Image.new("L", (1, 1)))
    _, _, right, bottom = pen.multiline_textbbox((MARGIN, MARGIN), text, font=font)
    image = Image.new("L", (int(right) + MARGIN, int(bottom) + MARGIN))
    ImageDraw.Draw(image).multiline_text((MARGIN, MARGIN), text, fill=255, font=font)
    return np.asarray(image, np.float32) / np.float32(255.0)


def _draw(out: Framelet, rect: Rect, cover: NDArray[np.float32]) -> None:
    colour = pixels_of(out, "colour", rect)
    white: Any = 255.0 if out.encoded else 1.0
    mixed = colour * (np.float32(SHADE) * (1.0 - cover))[..., None] + (np.float32(white) * cover)[..., None]
    colour[...] = np.round(mixed) if out.encoded else mixed
    if out.alpha is not None:
        alpha = pixels_of(out, "alpha", rect)
        alpha[...] = 1.0 - (1.0 - alpha) * np.float32(SHADE) * (1.0 - cover)
