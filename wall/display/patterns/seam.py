"""Seam: hairlines across every edge of a panel, which continue on its neighbour where the alignment is right."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wall.display.patterns import draw
from wall.display.patterns.unfolding import Field, UnfoldedPanel
from wall.geometry.panels import Panel

COLOURS = (draw.BRIGHT, draw.AMBER, draw.CYAN, draw.ROSE, draw.GREEN, draw.VIOLET)  # in turn: tells neighbours apart
HAIR_PX = 1.2
SLANT = 0.25  # a slanted line shows a shift across the seam as one along it, a quarter as large
SLANTED = (4, 0.6)  # one for four straight ones, and fainter: they must not drown those
REACH = 0.3  # of the panel's shorter side, that lines come in from an edge


def seam(panel: Panel, unfolded: UnfoldedPanel) -> NDArray[np.uint8]:
    """See wall.display.patterns.pattern."""
    image, (right, down) = draw.blank(panel.pixels), unfolded.positions()
    width, height = panel.pixels
    x, y = np.arange(width), np.arange(height)[:, None]
    reach = REACH * min(width, height)
    at_sides = _near(np.minimum(x, width - 1 - x), reach) * np.ones_like(y)
    at_ends = _near(np.minimum(y, height - 1 - y), reach) * np.ones_like(x)
    for slant in (SLANT, -SLANT, 0.0):
        _hairs(image, down + slant * right, at_sides, unfolded, slant)
        _hairs(image, right + slant * down, at_ends, unfolded, slant)
    image[0], image[-1], image[:, 0], image[:, -1] = (draw.FAINT,) * 4
    size = draw.fitting_size(panel.id, (0.3 * width, 0.1 * height))
    draw.draw_text(image, panel.id, (width / 2, height / 2), size, draw.BRIGHT, anchor="mm")
    return image


def _hairs(image: NDArray[np.uint8], along: Field, near: Field, unfolded: UnfoldedPanel, slant: float) -> None:
    """Lines where `along` (metres) is a whole number of steps, coloured by that number."""
    every, strength = SLANTED if slant else (1, 1.0)
    step = every * unfolded.step
    number = np.rint(along / step)
    pitch = unfolded.pitch * float(np.hypot(1.0, slant))
    coverage = draw.line_coverage((along - number * step) / pitch, HAIR_PX) * near
    draw.blend(image, strength * coverage, COLOURS, number % len(COLOURS))


def _near(distance: Field, reach: float) -> Field:
    """1 at the edge, fading out at `reach` pixels from it."""
    near: Field = np.clip(2.0 * (1.0 - distance / reach), 0.0, 1.0)
    return near
