"""Grid: geometry at a glance. One-pixel lines, the outermost pixels, and figures over the whole wall."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wall.display.patterns.ink import AMBER, BRIGHT, CYAN, FAINT, GREEN, PLAIN, fitting, label, mix, paper, stroke
from wall.display.patterns.sheet import Field, Sheet
from wall.geometry.panels import Panel

HEAVY = 5  # every so many lines one is brighter
FIGURE_PX = 1.6  # width of circles and diagonals
TIE_PX = 1e-6  # a line between two pixels is the same one's, whichever way their places were rounded


def grid(panel: Panel, sheet: Sheet) -> NDArray[np.uint8]:
    """See wall.display.patterns.pattern."""
    picture, (right, down) = paper(panel.pixels), sheet.places()
    for every, colour in ((1, FAINT), (HEAVY, PLAIN)):
        for k, along in enumerate((right, down)):
            pitch = max(abs(sheet.per_x[k]), abs(sheet.per_y[k]))  # of the rows or columns that a line passes
            mix(picture, _lines(along, every * sheet.step, pitch), colour)
    width, height = sheet.size
    length = float(np.hypot(width, height))
    for side in (1, -1):  # a corner of the wall to the opposite one
        mix(picture, stroke((right * height - side * down * width) / (length * sheet.pitch), FIGURE_PX), CYAN)
    radius = min(width, height) / 2 - 2 * sheet.pitch
    for centre in sorted({0.0, (width - min(width, height)) / 2, (min(width, height) - width) / 2}):
        middle = (centre, 0.0) if width >= height else (0.0, centre * height / max(width, 1e-9))
        mix(picture, _circle(right, down, middle, radius, sheet.pitch), AMBER)
    _own(picture, panel, sheet, right, down)
    return picture


def _own(picture: NDArray[np.uint8], panel: Panel, sheet: Sheet, right: Field, down: Field) -> None:
    """The panel's own circle, its name, and its outermost pixels, to see whether they are all there."""
    width, height = panel.pixels
    side = min(width * float(np.linalg.norm(sheet.per_x)), height * float(np.linalg.norm(sheet.per_y)))
    middle = sheet.at(width / 2, height / 2)
    mix(picture, _circle(right, down, (middle[0], middle[1]), 0.35 * side, sheet.pitch), BRIGHT)
    label(picture, panel.id, (width / 2, height / 2), fitting(panel.id, (width * 0.2, height * 0.06)), BRIGHT)
    picture[0], picture[-1], picture[:, 0], picture[:, -1] = (GREEN,) * 4


def _lines(along: Field, step: float, pitch: float) -> NDArray[np.bool_]:
    """Exactly one pixel wherever a multiple of `step` metres passes a row or column of pixels."""
    off = (along - np.rint(along / step) * step) / pitch + TIE_PX
    found: NDArray[np.bool_] = (off >= -0.5) & (off < 0.5)
    return found


def _circle(right: Field, down: Field, middle: tuple[float, float], radius: float, pitch: float) -> Field:
    return stroke((np.hypot(right - middle[0], down - middle[1]) - radius) / pitch, FIGURE_PX)
