"""Draw lines and text on an image: coverage between 0 and 1 blends a colour in."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from wall.display.patterns.unfolding import Field

Rgb = tuple[int, int, int]

BACKGROUND: Rgb = (16, 18, 23)
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


def blank(pixels: tuple[int, int]) -> NDArray[np.uint8]:
    """(h, w, 3) uint8, all BACKGROUND."""
    image = np.empty((pixels[1], pixels[0], 3), np.uint8)
    image[:] = BACKGROUND
    return image


def blend(
    image: NDArray[np.uint8],
    coverage: Field | NDArray[np.bool_],
    colour: Rgb | Sequence[Rgb],
    which: Field | None = None,
) -> None:
    """Blend a colour into an image by `coverage` (h, w), 0..1; of several, the one of index `which` (h, w)."""
    touched = np.nonzero(coverage)
    part = coverage[touched].astype(np.float32)[:, None]
    colours = np.array(colour, np.float32)
    added = colours if which is None else colours[which[touched].astype(int)]
    image[touched] = np.rint(image[touched] * (1 - part) + added * part).astype(np.uint8)


def line_coverage(distance: Field, width: float) -> Field:
    """Coverage by a line `width` pixels wide, from the distance (pixels) of every pixel's centre from its middle."""
    return np.clip(width / 2 + 0.5 - np.abs(distance), 0.0, 1.0)


@lru_cache(maxsize=64)
def font(size: int) -> ImageFont.FreeTypeFont:
    """Pillow's own font, `size` pixels high."""
    found = ImageFont.load_default(size)
    assert isinstance(found, ImageFont.FreeTypeFont)  # Pillow is built with FreeType
    return found


def size_of(text: str, size: int) -> tuple[int, int]:
    """Width and height of a text, pixels."""
    left, top, right, bottom = font(size).getbbox(text)
    return int(np.ceil(right - left)), int(np.ceil(bottom - top))


def fitting_size(text: str, room: tuple[float, float]) -> int:
    """The largest font size, pixels, with which a text fits (width, height) pixels; SMALLEST at least."""
    width, _ = size_of(text, 100)
    return max(SMALLEST, int(min(97 * room[0] / max(width, 1), room[1] / CAPITALS)))


def draw_text(
    image: NDArray[np.uint8], text: str, at: tuple[float, float], size: int, colour: Rgb, *, anchor: str = "lt"
) -> None:
    """Write a text of `size` pixels; `at` is where its anchor goes (Pillow's: l, m, r and t, m, b)."""
    height, width = image.shape[:2]
    mask = Image.new("L", (width, height))
    ImageDraw.Draw(mask).text(at, text, fill=255, font=font(size), anchor=anchor)
    box = mask.getbbox()
    if box is None:
        return
    x0, y0, x1, y1 = box
    coverage = np.asarray(mask.crop(box), np.float32) / 255
    blend(image[y0:y1, x0:x1], coverage, colour)


def draw_label(image: NDArray[np.uint8], text: str, at: tuple[float, float], size: int, colour: Rgb) -> None:
    """Draw a text centred at a pixel, on a patch of BACKGROUND."""
    (x, y), (width, height) = at, size_of(text, size)
    pad = max(2, size // 3)
    top, left = max(0, int(y - height / 2 - pad)), max(0, int(x - width / 2 - 1.5 * pad))
    image[top : int(y + height / 2 + pad), left : int(x + width / 2 + 1.5 * pad)] = BACKGROUND
    draw_text(image, text, at, size, colour, anchor="mm")
