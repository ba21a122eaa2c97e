"""The frame around parts of a panel that get nothing new, in stripes, as the page draws it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from wall.core.data import Rect
from wall.geometry.panels import Panel

COLOURS = np.array([(229, 115, 108), (20, 12, 13)], np.uint8)  # sRGB
THINNEST, SHARE = 4, 150  # pixels of a frame, and parts of the shorter edge of a panel, if that is more


def marked(panel: Panel, places: Sequence[tuple[float, float, float, float]]) -> tuple[Rect, ...]:
    """The parts of a panel, in its pixels, at places of the virtual screen: x, y, width, height."""
    spans = [span or own for span, own in zip(panel.span, panel.pixels, strict=True)]
    whole, found = Rect(x=0, y=0, width=panel.pixels[0], height=panel.pixels[1]), list[Rect]()
    for place in places:
        left, right, top, bottom = (
            round((edge - panel.screen[axis]) * panel.pixels[axis] / spans[axis])
            for axis in (0, 1)
            for edge in (place[axis], place[axis] + place[axis + 2])
        )
        part = Rect(x=left, y=top, width=max(0, right - left), height=max(0, bottom - top)).intersection(whole)
        found += [part] if part is not None else []
    return tuple(found)


def draw(pixels: NDArray[np.uint8], at: Rect, parts: Sequence[Rect], panel: tuple[int, int]) -> None:
    """Draw the frames of `parts` into some pixels of a panel.

    pixels : (h, w, 3), those `at` this place, changed; panel : its width and height
    """
    thick = max(THINNEST, min(panel) // SHARE)
    for part in parts:
        for strip in _strips(part, thick):
            if (here := strip.intersection(at)) is not None:
                x, y = np.arange(here.x, here.right), np.arange(here.y, here.bottom)
                stripe = (x + y[:, None]) // thick % len(COLOURS)
                pixels[here.y - at.y : here.bottom - at.y, here.x - at.x : here.right - at.x] = COLOURS[stripe]


def _strips(part: Rect, thick: int) -> Iterator[Rect]:
    for y in (part.y, max(part.y, part.bottom - thick)):
        yield Rect(x=part.x, y=y, width=part.width, height=min(thick, part.height))
    for x in (part.x, max(part.x, part.right - thick)):
        yield Rect(x=x, y=part.y, width=min(thick, part.width), height=part.height)
