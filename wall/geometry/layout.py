"""Where panels that stand anywhere in space lie in the flat virtual screen. Rays do not depend on it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from wall.data import Float64

PARALLEL = 1e-6  # sine: a hundredth of a pixel across 16,384 pixels
EMPTIEST = 4  # a picture may be at most so many times as large as its panels


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Placement:
    """One panel before it has a place in the virtual screen."""

    upper_left: Float64  # (3,) metres, wall frame
    per_x: Float64  # (3,) metres a pixel to the right
    per_y: Float64  # (3,) metres a pixel down
    pixels: tuple[int, int]
    bezel: tuple[float, float]  # left, right, metres


def place(placements: Sequence[Placement]) -> tuple[list[tuple[int, int]], int, int]:
    """Top left corners (pixels), width and height of the virtual screen.

    Panels in one plane lie as they stand, at the finest panel's pixel pitch. Others, and those that would
    then overlap or leave most of the picture empty, stand side by side in order, their bezels between them.
    """
    corners = _as_they_stand(placements)
    if corners is None or _overlap(placements, corners) or _mostly_empty(placements, corners):
        corners = _side_by_side(placements)
    width, height = _size(placements, corners)
    return corners, width, height


def _as_they_stand(placements: Sequence[Placement]) -> list[tuple[int, int]] | None:
    pitch_x = min(float(np.linalg.norm(p.per_x)) for p in placements)
    pitch_y = min(float(np.linalg.norm(p.per_y)) for p in placements)
    first = placements[0]
    right, down = first.per_x / np.linalg.norm(first.per_x), first.per_y / np.linalg.norm(first.per_y)
    corners = []
    for p in placements:
        turned = np.linalg.norm(p.per_x / np.linalg.norm(p.per_x) - right)
        turned += np.linalg.norm(p.per_y / np.linalg.norm(p.per_y) - down)
        offset = p.upper_left - first.upper_left
        behind = abs(offset @ np.cross(right, down))
        if turned > 2 * PARALLEL or behind > 0.01 * min(pitch_x, pitch_y):
            return None
        corners.append((round(float(offset @ right) / pitch_x), round(float(offset @ down) / pitch_y)))
    left, top = min(x for x, _ in corners), min(y for _, y in corners)
    return [(x - left, y - top) for x, y in corners]


def _side_by_side(placements: Sequence[Placement]) -> list[tuple[int, int]]:
    corners, x, frame = [], 0, 0.0
    for i, p in enumerate(placements):
        pitch = float(np.linalg.norm(p.per_x))
        x += round((frame + p.bezel[0]) / pitch) if i else 0
        corners.append((x, 0))
        x += p.pixels[0]
        frame = p.bezel[1]
    return corners


def _size(placements: Sequence[Placement], corners: list[tuple[int, int]]) -> tuple[int, int]:
    pairs = list(zip(corners, placements, strict=True))
    return max(x + p.pixels[0] for (x, _), p in pairs), max(y + p.pixels[1] for (_, y), p in pairs)


def _overlap(placements: Sequence[Placement], corners: list[tuple[int, int]]) -> bool:
    x0, y0 = np.array(corners).T
    w, h = np.array([p.pixels for p in placements]).T
    across = (x0[:, None] < (x0 + w)[None, :]) & (x0[None, :] < (x0 + w)[:, None])
    along = (y0[:, None] < (y0 + h)[None, :]) & (y0[None, :] < (y0 + h)[:, None])
    return bool(np.count_nonzero(across & along) > len(placements))


def _mostly_empty(placements: Sequence[Placement], corners: list[tuple[int, int]]) -> bool:
    width, height = _size(placements, corners)
    return width * height > EMPTIEST * sum(p.pixels[0] * p.pixels[1] for p in placements)
