"""Lines, discs and letters on a picture: coverage between 0 and 1 mixes a colour in."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from wall.display.patterns.sheet import Field

Rgb = tuple[int, int, int]

PAPER: Rgb = (16, 18, 23)
FAINT: Rgb = (58, 64, 77)
PLAIN: Rgb = (122, 131, 150)
BRIGHT: Rgb = (236, 239, 245)
AMBER: Rgb = (255, 184, 51)
CYAN: Rgb = (63, 200, 255)
GREEN: Rgb = (87, 217, 120)
ROSE: Rgb = (255, 106, 140)
VIOLET: Rgb = (176, 140, 255)

SMALLEST = 9  # size of letters that can be read, pixels
CAPITALS = 0.75  # height of a capital over the size of its letters


def paper(pixels: tuple[int, int]) -> NDArray[np.uint8]:
    """(h, w, 3) uint8 of PAPER."""
    picture = np.empty((pixels[1], pixels[0], 3), np.uint8)
    picture[:] = PAPER
    return picture


def mix(
    picture: NDArray[np.uint8],
    coverage: Field | NDArray[np.bool_],
    colour: Rgb | Sequence[Rgb],
    which: Field | None = None,
) -> None:
    """Lay a colour over a picture, as much of it as `coverage` (h, w) says; of several, the one of `which` (h, w)."""
    touched = np.nonzero(coverage)
    part = coverage[touched].astype(np.float32)[:, None]
    ink = np.array(colour, np.float32) if which is None else np.array(colour, np.float32)[which[touched].astype(int)]
    picture[touched] = np.rint(picture[touched] * (1 - part) + ink * part).astype(np.uint8)


def stroke(distance: Field, width: float) -> Field:
    """Coverage by a line `width` pixels wide, from the distance (pixels) of every pixel's centre from its middle."""
    return np.clip(width / 2 + 0.5 - np.abs(distance), 0.0, 1.0)


@lru_cache(maxsize=64)
def font(size: int) -> ImageFont.FreeTypeFont:
    found = ImageFont.load_default(size)
    assert isinstance(found, ImageFont.FreeTypeFont)  # Pillow is built with FreeType
    return found


def size_of(text: str, size: int) -> tuple[int, int]:
    """Width and height of a text, pixels."""
    left, top, right, bottom = font(size).getbbox(text)
    return int(np.ceil(right - left)), int(np.ceil(bottom - top))


def fitting(text: str, room: tuple[float, float]) -> int:
    """The size of letters, pixels, with which a text stays in a room of (width, height) pixels; SMALLEST at least."""
    width, _ = size_of(text, 100)
    return max(SMALLEST, int(min(97 * room[0] / max(width, 1), room[1] / CAPITALS)))


def write(
    picture: NDArray[np.uint8], text: str, at: tuple[float, float], size: int, colour: Rgb, *, anchor: str = "lt"
) -> None:
    """Write a text of `size` pixels; `at` is where its anchor goes (Pillow's: l, m, r and t, m, b)."""
    height, width = picture.shape[:2]
    mask = Image.new("L", (width, height))
    ImageDraw.Draw(mask).text(at, text, fill=255, font=font(size), anchor=anchor)
    box = mask.getbbox()
    if box is None:
        return
    x0, y0, x1, y1 = box
    coverage = np.asarray(mask.crop(box), np.float32) / 255
    mix(picture[y0:y1, x0:x1], coverage, colour)


def label(picture: NDArray[np.uint8], text: str, at: tuple[float, float], size: int, colour: Rgb) -> None:
    """A text about a place, on a patch of PAPER that keeps it legible."""
    (x, y), (width, height) = at, size_of(text, size)
    pad = max(2, size // 3)
    top, left = max(0, int(y - height / 2 - pad)), max(0, int(x - width / 2 - 1.5 * pad))
    picture[top : int(y + height / 2 + pad), left : int(x + width / 2 + 1.5 * pad)] = PAPER
    write(picture, text, at, size, colour, anchor="mm")
