"""Where panels that stand anywhere in space lie in the flat virtual screen. Rays do not depend on it.

Panels in one plane that one eye sees are a face: they lie as they stand, at the pixel pitch of the finest of them.
Faces stand side by side. Where panels of a face overlap without saying so, or leave most of it empty, each is a face
of its own. So is each part of a cylinder or dome, as its image is; but parts whose pixels are as large as each other's
lie as they stand on it, unrolled.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from wall.config.displays import SidesConfig
from wall.core.data import Float64
from wall.geometry.panels import Overlap, Panel, Plane, Wall

PARALLEL = 1e-6  # sine: a hundredth of a pixel across 16,384 pixels
SAME_PLANE = 0.01  # pixels behind or before it
EMPTIEST = 4  # an image may be at most so many times as large as its panels
TOUCHING = 0.5  # pixels that rounding may let neighbours share
SAME_PITCH = 0.02  # share by which pixels of one surface may differ and still be drawn as large as each other
ON_GRID = 0.01  # pixels: panels that stand so near to whole pixels of another's plane are put there


def place(panels: Sequence[Panel], *, regular: bool = False) -> Wall:
    """Lay panels out, each with its own plane, faces side by side in the order of their first panels.

    Between faces are their bezels. Panels of a face that stand on one grid of pixels get one plane. `regular`: it is a
    grid, and lies as it stands however wide its gaps.
    """
    faces: list[list[int]] = []
    overlaps: list[Overlap] = []
    screens: list[tuple[int, int]] = [(0, 0)] * len(panels)
    curved = [k for k, panel in enumerate(panels) if panel.surface is not None]
    faces.extend([k] for k in curved)
    unrolled: list[list[int]] = []
    for sheet in _on_one_surface(panels, curved):
        found = _overlaps(panels, sheet)
        overlaps.extend(found)
        if len(sheet) > 1 and not found and (corners := _unrolled(panels, sheet)):
            unrolled.append(sheet)
            for k, corner in zip(sheet, corners, strict=True):
                screens[k] = corner
    for face in _in_one_plane(panels):
        found = _overlaps(panels, face)
        overlaps.extend(found)
        corners = _as_they_stand(panels, face, np.min([panels[k].pitch for k in face], axis=0))
        scattered = _crowded(panels, face, corners, found) or _mostly_empty(panels, face, corners)
        if scattered and not regular:
            faces.extend([k] for k in face)
        else:
            faces.append(face)
            for k, corner in zip(face, corners, strict=True):
                screens[k] = corner
    faces.sort(key=lambda face: face[0])
    spans = _spans(panels, faces)
    together = {k for sheet in unrolled for k in sheet}
    apart = [face for face in faces if face[0] not in together]
    _side_by_side(panels, sorted([*unrolled, *apart], key=min), screens, spans)
    planes = _shared_planes(panels, faces, screens)
    ends = [(x + w, y + h) for (x, y), (w, h) in zip(screens, spans, strict=True)]
    return Wall(
        panels=tuple(replace(p, screen=screens[k], span=spans[k], plane=planes[k]) for k, p in enumerate(panels)),
        width=max(x for x, _ in ends),
        height=max(y for _, y in ends),
        faces=tuple(map(tuple, faces)),
        overlaps=tuple(overlaps),
    )


def _spans(panels: Sequence[Panel], faces: list[list[int]]) -> list[tuple[int, int]]:
    """Widths and heights in pixels of the finest panel of each one's face."""
    spans = [(0, 0)] * len(panels)
    for face in faces:
        finest = np.min([panels[k].pitch for k in face], axis=0)
        for k in face:
            p = panels[k]
            w, h = (round(n * mine / least) for n, mine, least in zip(p.pixels, p.pitch, finest, strict=True))
            spans[k] = (w, h)
    return spans


def _on_one_surface(panels: Sequence[Panel], curved: Sequence[int]) -> list[list[int]]:
    """Indices of curved panels that are parts of one cylinder or dome. Each is a face of its own, as its image is."""
    sheets: dict[tuple[object, ...], list[int]] = {}
    for k in curved:
        surface = panels[k].surface
        assert surface is not None
        sheets.setdefault((surface.config.whole, panels[k].shift), []).append(k)
    return list(sheets.values())


def _in_one_plane(panels: Sequence[Panel]) -> list[list[int]]:
    """Indices of flat panels that share a plane, its directions, and the eye's shift."""
    right, down = _units(panels, "per_x"), _units(panels, "per_y")
    upper_left = np.array([p.plane.origin for p in panels])
    pitch = np.array([min(p.pitch) for p in panels])
    shift = np.array([p.shift for p in panels])
    left, faces = np.array([k for k, panel in enumerate(panels) if panel.surface is None], np.int64), []
    while len(left):
        first = left[0]
        turned = np.linalg.norm(right[left] - right[first], axis=1) + np.linalg.norm(down[left] - down[first], axis=1)
        behind = np.abs((upper_left[left] - upper_left[first]) @ np.cross(right[first], down[first]))
        same = (turned <= 2 * PARALLEL) & (behind <= SAME_PLANE * pitch[left]) & (shift[left] == shift[first])
        same[0] = True
        faces.append([int(k) for k in left[same]])
        left = left[~same]
    return faces


def _units(panels: Sequence[Panel], name: str) -> Float64:
    vectors = np.array([getattr(p.plane, name) for p in panels])
    return np.asarray(vectors / np.linalg.norm(vectors, axis=1, keepdims=True))


def _rectangles(panels: Sequence[Panel], face: list[int]) -> tuple[Float64, Float64]:
    """Top left and bottom right corners, each (n, 2) metres right and down of the first panel's, in the face.

    On a surface that they share: along it, from where it is straight ahead.
    """
    own = [panels[k] for k in face]
    curved = [panel.surface.config for panel in own if panel.surface is not None]
    if curved:
        low = np.array([part.place for part in curved])
        return low, low + np.array([part.size for part in curved])
    right, down = _units(own[:1], "per_x")[0], _units(own[:1], "per_y")[0]
    away = np.array([p.plane.origin - own[0].plane.origin for p in own])
    low = np.stack([away @ right, away @ down], axis=1)
    size = np.array([(p.pitch[0] * p.pixels[0], p.pitch[1] * p.pixels[1]) for p in own])
    return low, low + size


def _as_they_stand(panels: Sequence[Panel], face: list[int], pitch: Float64) -> list[tuple[int, int]]:
    """Their corners in pixels of this pitch, (2,) metres across and down."""
    corners = np.rint(_rectangles(panels, face)[0] / pitch)
    return [(int(x), int(y)) for x, y in corners - corners.min(axis=0)]


def _unrolled(panels: Sequence[Panel], sheet: list[int]) -> list[tuple[int, int]]:
    """Corners of the parts of a surface as they stand on it; none where that would not do."""
    pitch = np.array([panels[k].lit_pitch for k in sheet])
    if np.ptp(pitch, axis=0).max() > SAME_PITCH * pitch.min():
        return []
    corners = _as_they_stand(panels, sheet, pitch[0])
    return [] if _crowded(panels, sheet, corners, []) or _mostly_empty(panels, sheet, corners) else corners


def _overlaps(panels: Sequence[Panel], face: list[int]) -> list[Overlap]:
    low, high = _rectangles(panels, face)
    shared = np.minimum(high[:, None], high[None]) - np.maximum(low[:, None], low[None])
    pitch = np.array([panels[k].lit_pitch for k in face])
    least = TOUCHING * np.minimum(pitch[:, None], pitch[None])
    found = []
    for i, j in np.argwhere(np.triu((shared > least).all(axis=2), 1)):
        a, b = panels[face[i]], panels[face[j]]
        if a.sight == b.sight:
            declared = _declared(a, b, low[j] - low[i])
            allowed = bool((shared[i, j] <= np.array(declared) + least[i, j]).any())
            size = (float(shared[i, j, 0]), float(shared[i, j, 1]))
            found.append(Overlap(first=face[i], second=face[j], size=size, declared=declared, allowed=allowed))
    return found


def _declared(a: Panel, b: Panel, away: Float64) -> tuple[float, float]:
    """What both panels say of the sides that meet; `away` is from a's corner to b's, right and down."""
    one, other = a.config.overlap, b.config.overlap
    across = (one.right, other.left) if away[0] >= 0 else (one.left, other.right)
    down = (one.bottom, other.top) if away[1] >= 0 else (one.top, other.bottom)
    return min(across), min(down)


def _crowded(panels: Sequence[Panel], face: list[int], corners: list[tuple[int, int]], known: list[Overlap]) -> bool:
    """Whether pixels lie on others that they were not said to."""
    low = np.array(corners)
    high = low + np.array([panels[k].pixels for k in face])
    shared = (np.minimum(high[:, None], high[None]) > np.maximum(low[:, None], low[None])).all(axis=2)
    allowed = {(overlap.first, overlap.second) for overlap in known if overlap.allowed}
    return any((face[i], face[j]) not in allowed for i, j in np.argwhere(np.triu(shared, 1)))


def _mostly_empty(panels: Sequence[Panel], face: list[int], corners: list[tuple[int, int]]) -> bool:
    pixels: NDArray[np.int64] = np.array([panels[k].pixels for k in face])
    width, height = (np.array(corners) + pixels).max(axis=0)
    return bool(width * height > EMPTIEST * pixels.prod(axis=1).sum())


def _side_by_side(
    panels: Sequence[Panel],
    faces: list[list[int]],
    screens: list[tuple[int, int]],
    spans: Sequence[tuple[int, int]],
) -> None:
    """Move faces to the right of each other."""
    x, frame = 0, 0.0
    for face in faces:
        first = panels[min(face, key=lambda k: screens[k][0])]
        x += round((frame + _bezel(first).left) / first.pitch[0]) if x else 0
        last = max(face, key=lambda k: screens[k][0] + spans[k][0])
        end = x + screens[last][0] + spans[last][0]
        for k in face:
            screens[k] = (screens[k][0] + x, screens[k][1])
        x, frame = end, _bezel(panels[last]).right


def _bezel(panel: Panel) -> SidesConfig:
    """What its frame hides."""
    return SidesConfig() if panel.skip else panel.config.bezel


def _shared_planes(panels: Sequence[Panel], faces: list[list[int]], screens: list[tuple[int, int]]) -> list[Plane]:
    """Each panel's plane; panels of a face that stand on one grid of pixels share one."""
    planes: dict[int, Plane] = {}
    for face in faces:
        left = np.array(face)
        while len(left):
            first = int(left[0])
            own, (x, y) = panels[first].plane, screens[first]
            plane = Plane(origin=own.point(-x, -y), per_x=own.per_x, per_y=own.per_y)
            there = _on_grid(plane, [panels[j] for j in left], [screens[j] for j in left])
            there[0] = True
            planes.update(dict.fromkeys((int(j) for j in left[there]), plane))
            left = left[~there]
    return [planes[k] for k in range(len(panels))]


def _on_grid(plane: Plane, panels: list[Panel], screens: list[tuple[int, int]]) -> NDArray[np.bool_]:
    """(n,) whether all corners of a panel are where its pixels have them in a plane, to ON_GRID pixels."""
    upper_left, screen = np.array([p.plane.origin for p in panels]), np.array(screens, np.float64)
    pixels = np.array([p.pixels for p in panels], np.float64)
    across = np.array([p.plane.per_x for p in panels]) * pixels[:, :1]
    down = np.array([p.plane.per_y for p in panels]) * pixels[:, 1:]
    most = ON_GRID * min(np.linalg.norm(plane.per_x), np.linalg.norm(plane.per_y))
    near = np.ones(len(panels), np.bool_)
    for x, y in ((0, 0), (1, 0), (0, 1), (1, 1)):
        position = screen + pixels * (x, y)
        away = upper_left + x * across + y * down - plane.origin - position @ np.array([plane.per_x, plane.per_y])
        near &= np.linalg.norm(away, axis=1) <= most
    return near
