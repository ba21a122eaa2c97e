"""Lay all panels of a wall into one plane: metres to the right and down from the top left corner of all.

Panels of a flat wall keep their positions. Others lie as in the virtual screen, with pixels of their true size, so that
a line over the fold between two panels that meet has no step.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from wall.core.data import Float64
from wall.geometry.panels import Panel, Wall

Field = NDArray[np.floating[Any]]  # (h, w), a number for each pixel
NICE = (1.0, 2.0, 5.0, 10.0)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class UnfoldedPanel:
    """Where a panel lies in the plane, and how large the whole unfolded wall is."""

    origin: Float64  # (2,) metres, of the panel's top left corner
    per_x: Float64  # (2,) metres, a pixel to the right
    per_y: Float64  # (2,) metres, a pixel down
    pixels: tuple[int, int]
    size: tuple[float, float]  # width and height of the unfolded wall, metres
    step: float  # a round number of metres, about a tenth of a panel

    @property
    def pitch(self) -> float:
        """Metres of one pixel."""
        return float(np.sqrt(np.linalg.norm(self.per_x) * np.linalg.norm(self.per_y)))

    def positions(self) -> tuple[Field, Field]:
        """Metres to the right and down of every pixel's centre, from the middle of the unfolded wall."""
        width, height = self.pixels
        x, y = np.arange(width) + 0.5, (np.arange(height) + 0.5)[:, None]
        right, down = (self.origin[k] - self.size[k] / 2 + x * self.per_x[k] + y * self.per_y[k] for k in (0, 1))
        return right, down

    def at(self, x: float, y: float) -> Float64:
        """(2,) metres from the middle of the unfolded wall, of a position in panel pixels."""
        found: Float64 = self.origin - np.array(self.size) / 2 + x * self.per_x + y * self.per_y
        return found


def unfold(panel: Panel, wall: Wall) -> UnfoldedPanel:
    """Lay a wall into a plane; returns where one of its panels lies."""
    boxes, first, size, step = _laid(wall)
    origin, per_x, per_y = boxes[panel.index]
    return UnfoldedPanel(origin=origin - first, per_x=per_x, per_y=per_y, pixels=panel.pixels, size=size, step=step)


_Box: TypeAlias = tuple[Float64, Float64, Float64]  # (2,) metres: top left corner, steps of a pixel right and down


@lru_cache(maxsize=2)
def _laid(wall: Wall) -> tuple[list[_Box], Float64, tuple[float, float], float]:
    """Every panel's box; top left corner, size and step of the unfolded wall."""
    boxes = _flat_boxes(wall) if wall.flat else _unfolded_boxes(wall)
    corners, sides = [], []
    for panel, (corner, per_x, per_y) in zip(wall.panels, boxes, strict=True):
        across, along = panel.pixels[0] * per_x, panel.pixels[1] * per_y
        corners += [corner, corner + across, corner + along, corner + across + along]
        sides.append(min(np.linalg.norm(across), np.linalg.norm(along)))
    first, last = np.min(corners, axis=0), np.max(corners, axis=0)
    size = (float(last[0] - first[0]), float(last[1] - first[1]))
    return boxes, first, size, round_number(float(np.median(sides)) / 10)


def _flat_boxes(wall: Wall) -> list[_Box]:
    plane = wall.panels[0].plane
    right = plane.per_x / np.linalg.norm(plane.per_x)
    axes = np.array([right, np.cross(right, plane.normal)])  # to the right and down
    return [(axes @ p.plane.point(*p.screen), axes @ p.plane.per_x, axes @ p.plane.per_y) for p in wall.panels]


def _unfolded_boxes(wall: Wall) -> list[_Box]:
    common, pitches = np.array(wall.panels[0].lit_pitch), [p.lit_pitch for p in wall.panels]
    return [
        (np.array(p.screen) * common, np.array([across, 0.0]), np.array([0.0, down]))
        for p, (across, down) in zip(wall.panels, pitches, strict=True)
    ]


def round_number(about: float) -> float:
    """The 1, 2 or 5 times a power of ten that is nearest, by their ratio."""
    power = 10.0 ** np.floor(np.log10(about))
    return float(power * min(NICE, key=lambda nice: abs(np.log(nice * power / about))))
