"""Grid: one-pixel lines, the outermost pixels, and figures over the whole wall show wrong geometry."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wall.display.patterns.draw import (
    AMBER,
    BRIGHT,
    CYAN,
    FAINT,
    GREEN,
    PLAIN,
    blank,
    blend,
    draw_label,
    fitting_size,
    line_coverage,
)
from wall.display.patterns.unfolding import Field, UnfoldedPanel
from wall.geometry.panels import Panel

HEAVY = 5  # every so many lines one is brighter
FIGURE_PX = 1.6  # width of circles and diagonals
TIE_PX = 1e-6  # a line between two pixels belongs to the same one on both panels, however positions were rounded


def grid(panel: Panel, unfolded: UnfoldedPanel) -> NDArray[np.uint8]:
    """See wall.display.patterns.pattern."""
    image, (right, down) = blank(panel.pixels), unfolded.positions()
    for every, colour in ((1, FAINT), (HEAVY, PLAIN)):
        for k, along in enumerate((right, down)):
            pitch = max(abs(unfolded.per_x[k]), abs(unfolded.per_y[k]))  # of the rows or columns that a line passes
            blend(image, _lines(along, every * unfolded.step, pitch), colour)
    width, height = unfolded.size
    length = float(np.hypot(width, height))
    for side in (1, -1):  # a corner of the wall to the opposite one
        distance = (right * height - side * down * width) / (length * unfolded.pitch)
        blend(image, line_coverage(distance, FIGURE_PX), CYAN)
    radius = min(width, height) / 2 - 2 * unfolded.pitch
    for centre in sorted({0.0, (width - min(width, height)) / 2, (min(width, height) - width) / 2}):
        middle = (centre, 0.0) if width >= height else (0.0, centre * height / max(width, 1e-9))
        blend(image, _circle(right, down, middle, radius, unfolded.pitch), AMBER)
    _own(image, panel, unfolded, right, down)
    return image


def _own(image: NDArray[np.uint8], panel: Panel, unfolded: UnfoldedPanel, right: Field, down: Field) -> None:
    """The panel's own circle, its name, and its outermost pixels, to see whether they are all there."""
    width, height = panel.pixels
    side = min(width * float(np.linalg.norm(unfolded.per_x)), height * float(np.linalg.norm(unfolded.per_y)))
    middle = unfolded.at(width / 2, height / 2)
    blend(image, _circle(right, down, (middle[0], middle[1]), 0.35 * side, unfolded.pitch), BRIGHT)
    draw_label(image, panel.id, (width / 2, height / 2), fitting_size(panel.id, (width * 0.2, height * 0.06)), BRIGHT)
    image[0], image[-1], image[:, 0], image[:, -1] = (GREEN,) * 4


def _lines(along: Field, step: float, pitch: float) -> NDArray[np.bool_]:
    """Exactly one pixel wherever a multiple of `step` metres passes a row or column of pixels."""
    off = (along - np.rint(along / step) * step) / pitch + TIE_PX
    found: NDArray[np.bool_] = (off >= -0.5) & (off < 0.5)
    return found


def _circle(right: Field, down: Field, middle: tuple[float, float], radius: float, pitch: float) -> Field:
    return line_coverage((np.hypot(right - middle[0], down - middle[1]) - radius) / pitch, FIGURE_PX)
