"""Where panels that stand anywhere in space lie in the flat virtual screen. Rays do not depend on it.

Panels in one plane that one eye sees are a face: they lie as they stand, at the pixel pitch of the finest of them.
Faces stand side by side. Where panels of a face overlap without saying so, or leave most of it empty, each is a face
of its own.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wall.config.displays import SidesConfig
from wall.core.data import Float64

PARALLEL = 1e-6  # sine: a hundredth of a pixel across 16,384 pixels
SAME_PLANE = 0.01  # pixels behind or before it
EMPTIEST = 4  # a picture may be at most so many times as large as its panels
TOUCHING = 0.5  # pixels that rounding may let neighbours share

Sight = tuple[float, tuple[float, float, float] | None]  # shift in eye separations, own eye; who looks


@dataclass(frozen=True, slots=True, kw_only=True)
class Placement:
    """One panel before it has a place in the virtual screen. Its rectangle is what its pixels span."""

    upper_left: Float64  # (3,) metres, wall frame
    per_x: Float64  # (3,) metres a pixel to the right
    per_y: Float64  # (3,) metres a pixel down
    pixels: tuple[int, int]
    bezel: SidesConfig  # that is hidden
    overlap: SidesConfig
    sight: Sight

    @property
    def pitch(self) -> tuple[float, float]:
        """Metres a pixel, across and down."""
        return float(np.linalg.norm(self.per_x)), float(np.linalg.norm(self.per_y))


@dataclass(frozen=True, slots=True, kw_only=True)
class Overlap:
    """A rectangle that two panels of one face light for the same eye."""

    first: int  # index in Wall.panels, the smaller
    second: int
    size: tuple[float, float]  # metres
    declared: tuple[float, float]  # metres side by side and above each other that both panels say, where they meet
    allowed: bool  # it is no larger than declared, side by side or above each other


@dataclass(frozen=True, slots=True, kw_only=True)
class Placed:
    """The virtual screen: where each panel's top left pixel is, and what belongs together."""

    screens: list[tuple[int, int]]
    spans: list[tuple[int, int]]  # width and height there: more than its pixels where others of its face are finer
    faces: list[list[int]]  # indices of panels that lie as they stand
    overlaps: list[Overlap]
    width: int
    height: int


def place(placements: Sequence[Placement], *, regular: bool = False) -> Placed:
    """Lay panels out, faces side by side in the order of their first panels, their bezels between them.

    `regular`: it is a grid, and lies as it stands however wide its gaps.
    """
    faces: list[list[int]] = []
    overlaps: list[Overlap] = []
    screens: list[tuple[int, int]] = [(0, 0)] * len(placements)
    for face in _planes(placements):
        found = _overlaps(placements, face)
        overlaps.extend(found)
        corners = _as_they_stand(placements, face)
        scattered = _crowded(placements, face, corners, found) or _mostly_empty(placements, face, corners)
        if scattered and not regular:
            faces.extend([k] for k in face)
        else:
            faces.append(face)
            for k, corner in zip(face, corners, strict=True):
                screens[k] = corner
    faces.sort(key=lambda face: face[0])
    spans = _spans(placements, faces)
    _side_by_side(placements, faces, screens, spans)
    ends = [(x + w, y + h) for (x, y), (w, h) in zip(screens, spans, strict=True)]
    width, height = max(x for x, _ in ends), max(y for _, y in ends)
    return Placed(screens=screens, spans=spans, faces=faces, overlaps=overlaps, width=width, height=height)


def _spans(placements: Sequence[Placement], faces: list[list[int]]) -> list[tuple[int, int]]:
    """Widths and heights in pixels of the finest panel of each one's face."""
    spans = [(0, 0)] * len(placements)
    for face in faces:
        finest = np.min([placements[k].pitch for k in face], axis=0)
        for k in face:
            p = placements[k]
            w, h = (round(n * mine / least) for n, mine, least in zip(p.pixels, p.pitch, finest, strict=True))
            spans[k] = (w, h)
    return spans


def _planes(placements: Sequence[Placement]) -> list[list[int]]:
    """Indices of panels that share a plane, its directions, and the eye's shift."""
    right, down = _units(placements, "per_x"), _units(placements, "per_y")
    upper_left = np.array([p.upper_left for p in placements])
    pitch = np.array([min(p.pitch) for p in placements])
    shift = np.array([p.sight[0] for p in placements])
    left, faces = np.arange(len(placements)), []
    while len(left):
        first = left[0]
        turned = np.linalg.norm(right[left] - right[first], axis=1) + np.linalg.norm(down[left] - down[first], axis=1)
        behind = np.abs((upper_left[left] - upper_left[first]) @ np.cross(right[first], down[first]))
        same = (turned <= 2 * PARALLEL) & (behind <= SAME_PLANE * pitch[left]) & (shift[left] == shift[first])
        same[0] = True
        faces.append([int(k) for k in left[same]])
        left = left[~same]
    return faces


def _units(placements: Sequence[Placement], name: str) -> Float64:
    vectors = np.array([getattr(p, name) for p in placements])
    return np.asarray(vectors / np.linalg.norm(vectors, axis=1, keepdims=True))


def _rectangles(placements: Sequence[Placement], face: list[int]) -> tuple[Float64, Float64]:
    """Top left and bottom right corners, each (n, 2) metres right and down of the first panel's, in the face."""
    own = [placements[k] for k in face]
    right, down = _units(own[:1], "per_x")[0], _units(own[:1], "per_y")[0]
    away = np.array([p.upper_left - own[0].upper_left for p in own])
    low = np.stack([away @ right, away @ down], axis=1)
    size = np.array([(p.pitch[0] * p.pixels[0], p.pitch[1] * p.pixels[1]) for p in own])
    return low, low + size


def _as_they_stand(placements: Sequence[Placement], face: list[int]) -> list[tuple[int, int]]:
    finest = np.min([placements[k].pitch for k in face], axis=0)
    places = np.rint(_rectangles(placements, face)[0] / finest)
    return [(int(x), int(y)) for x, y in places - places.min(axis=0)]


def _overlaps(placements: Sequence[Placement], face: list[int]) -> list[Overlap]:
    low, high = _rectangles(placements, face)
    shared = np.minimum(high[:, None], high[None]) - np.maximum(low[:, None], low[None])
    pitch = np.array([placements[k].pitch for k in face])
    least = TOUCHING * np.minimum(pitch[:, None], pitch[None])
    found = []
    for i, j in np.argwhere(np.triu((shared > least).all(axis=2), 1)):
        a, b = placements[face[i]], placements[face[j]]
        if a.sight == b.sight:
            declared = _declared(a, b, low[j] - low[i])
            allowed = bool((shared[i, j] <= np.array(declared) + least[i, j]).any())
            size = (float(shared[i, j, 0]), float(shared[i, j, 1]))
            found.append(Overlap(first=face[i], second=face[j], size=size, declared=declared, allowed=allowed))
    return found


def _declared(a: Placement, b: Placement, away: Float64) -> tuple[float, float]:
    """What both panels say of the sides that meet; `away` is from a's corner to b's, right and down."""
    across = (a.overlap.right, b.overlap.left) if away[0] >= 0 else (a.overlap.left, b.overlap.right)
    down = (a.overlap.bottom, b.overlap.top) if away[1] >= 0 else (a.overlap.top, b.overlap.bottom)
    return min(across), min(down)


def _crowded(
    placements: Sequence[Placement], face: list[int], corners: list[tuple[int, int]], known: list[Overlap]
) -> bool:
    """Whether pixels lie on others that they were not said to."""
    low = np.array(corners)
    high = low + np.array([placements[k].pixels for k in face])
    shared = (np.minimum(high[:, None], high[None]) > np.maximum(low[:, None], low[None])).all(axis=2)
    allowed = {(overlap.first, overlap.second) for overlap in known if overlap.allowed}
    return any((face[i], face[j]) not in allowed for i, j in np.argwhere(np.triu(shared, 1)))


def _mostly_empty(placements: Sequence[Placement], face: list[int], corners: list[tuple[int, int]]) -> bool:
    pixels: NDArray[np.int64] = np.array([placements[k].pixels for k in face])
    width, height = (np.array(corners) + pixels).max(axis=0)
    return bool(width * height > EMPTIEST * pixels.prod(axis=1).sum())


def _side_by_side(
    placements: Sequence[Placement],
    faces: list[list[int]],
    screens: list[tuple[int, int]],
    spans: Sequence[tuple[int, int]],
) -> None:
    """Move faces to the right of each other."""
    x, frame = 0, 0.0
    for face in faces:
        first = placements[min(face, key=lambda k: screens[k][0])]
        x += round((frame + first.bezel.left) / first.pitch[0]) if x else 0
        last = max(face, key=lambda k: screens[k][0] + spans[k][0])
        end = x + screens[last][0] + spans[last][0]
        for k in face:
            screens[k] = (screens[k][0] + x, screens[k][1])
        x, frame = end, placements[last].bezel.right
