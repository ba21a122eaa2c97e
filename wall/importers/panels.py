"""Fit panels of source files to what a configuration accepts, and report every change.

All lengths are metres in the wall's frame: x right, y up, z towards the viewer.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from wall.config.screens import MAX_PANELS, SQUARENESS
from wall.core.data import Float64, Rect
from wall.geometry.regions import MAX_EDGE, split
from wall.importers.overlaps import declare_overlaps
from wall.importers.report import Item
from wall.importers.source import Node, Source

DISTANCE_M = 1.0  # from the eye to a panel of which only a field of view is given: any gives the same rays
WIDEST = 85.0  # degrees from straight ahead to an edge: a plane's size diverges at 90
METRES_A_PIXEL = 0.25e-3  # a desktop monitor of about 100 pixels an inch
MOST_PIXELS = 16384  # of a panel, each way, as a configuration accepts them
SMALLEST_M = 1e-4  # metres of a panel, each way, as a configuration accepts them
IN_PLANE_M = 1e-4  # metres; an eye nearer to a panel's plane sees only its edge
LONGEST_NAME = 48  # characters of a panel's id
FARTHEST_PIXEL = 65536  # of a window's position, as a configuration accepts it
MOST_EYE_SEPARATION_M = 10.0  # as a configuration accepts it
WIDEST_BEZEL_M = 100.0  # as a configuration accepts it
EYE_TRIALS = 16  # distances tried to move an eye out of a panel's plane, each half of the one before
PACKED = ("side_by_side", "top_bottom")  # kinds of stereo with both eyes in one panel


@dataclass(slots=True, kw_only=True, eq=False)
class Draft:
    """One panel as the source describes it."""

    node: Node  # what it comes from
    name: str
    pixels: tuple[int, int]
    corners: Float64  # (3, 3) rows lower left, lower right, upper left
    bezel: dict[str, float] = field(default_factory=dict)  # left, right, top, bottom
    eye: Float64 | None = None  # (3,), instead of the view's
    stereo: str = "mono"
    others: dict[str, Any] = field(default_factory=dict)  # host, display, monitor, window, warp, refresh_hz

    @property
    def size(self) -> tuple[float, float]:
        """Width and height, metres."""
        width, height = np.linalg.norm(self.corners[1:] - self.corners[0], axis=1)
        return float(width), float(height)

    @property
    def normal(self) -> Float64:
        """(3,) unit vector towards the panel's front."""
        across: Float64 = np.cross(self.corners[1] - self.corners[0], self.corners[2] - self.corners[0])
        return across / np.linalg.norm(across)


def corners_of(lower_left: ArrayLike, lower_right: ArrayLike, upper_right: ArrayLike) -> Float64 | None:
    """(3, 3) lower left, lower right, upper left, each (3,) metres; None if they span no rectangle."""
    low, right, high = (np.asarray(c, dtype=np.float64) for c in (lower_left, lower_right, upper_right))
    corners = np.array([low, right, low + (high - right)])
    width, height = np.linalg.norm(right - low), np.linalg.norm(high - right)
    area = np.linalg.norm(np.cross(right - low, high - right))
    return corners if min(width, height) >= SMALLEST_M and area >= 0.5 * width * height else None


def rotation(axis: int, angle: float) -> Float64:
    """(3, 3) rotation about x (0), y (1) or z (2) by `angle` radians, counter-clockwise seen from the axis's tip."""
    turn = np.eye(3)
    i, k = (axis + 1) % 3, (axis + 2) % 3
    turn[i, i] = turn[k, k] = math.cos(angle)
    turn[k, i] = math.sin(angle)
    turn[i, k] = -math.sin(angle)
    return turn


def turned(yaw: float, pitch: float, roll: float) -> Float64:
    """(3, 3) rotation of who looks along -z: to the right by yaw, then up by pitch, then the left raised; degrees."""
    y, p, r = (math.radians(angle) for angle in (yaw, pitch, roll))
    found: Float64 = rotation(1, -y) @ rotation(0, p) @ rotation(2, -r)
    return found


def upright(x: float, y: float, width: float, height: float) -> Float64:
    """(3, 3) corners of a panel in the plane z = 0 whose lower left corner is at x, y; metres."""
    return np.array([[x, y, 0.0], [x + width, y, 0.0], [x, y + height, 0.0]])


def fit_panels(
    source: Source, drafts: Sequence[Draft], eye: Float64 | None
) -> tuple[list[dict[str, Any]], Float64 | None]:
    """Make panels fit: their values for YAML, and the view's eye, moved so that it sees the front of all of them.

    `eye` is the file's, (3,) metres, or None if it has none. Raises NotThisFormat for more panels than a
    configuration holds.
    """
    count = sum(2 if draft.stereo in PACKED else 1 for draft in drafts)
    if not drafts or count > MAX_PANELS:
        raise source.refuse(source.root, f"has {count} panels", f"1 to {MAX_PANELS}")
    for draft in drafts:
        draft.node.panel = True
        _limit_pixels(source, draft)
        _square(source, draft)
        _turn_to(source, draft, draft.eye if draft.eye is not None else eye)
        if draft.eye is not None:
            draft.eye = _seeing(source, [draft], draft.eye)
    if eye is not None:
        eye = _seeing(source, drafts, eye)
    names = unique_names(draft.name for draft in drafts)
    overlaps = declare_overlaps([(draft.corners, draft.stereo) for draft in drafts])
    parts = zip(drafts, names, overlaps, strict=True)
    source.origins = [Item(what=draft.node.name, line=draft.node.line) for draft in drafts]
    return [_values(source, draft, name, overlap) for draft, name, overlap in parts], eye


def configuration(
    panels: list[dict[str, Any]],
    *,
    eye: Float64 | None = None,
    eye_separation: float | None = None,
    refresh_hz: float | None = None,
) -> dict[str, Any]:
    """The values of a whole configuration with these panels: the built-in courtyard, one view, enough ranks."""
    view: dict[str, Any] = {"id": "main", "camera": "auto"}
    if eye is not None:
        view["eye"] = numbers(eye)
    if eye_separation is not None:
        view["eye_separation"] = eye_separation
    if refresh_hz is not None:
        view["refresh_hz"] = refresh_hz
    values = {"version": 1, "scene": {"source": "courtyard"}, "wall": {"panels": panels}, "views": [view]}
    return values | enough_ranks(panels)


def enough_ranks(panels: list[dict[str, Any]]) -> dict[str, Any]:
    """The values of a graph with ranks of its own for each panel; empty where one rank a panel is enough."""
    ranks = max(_ranks_for(panel["pixels"]) for panel in panels)
    return {"graph": {"preset": "sort-first", "ranks_per_panel": ranks}} if ranks > 1 else {}


def _ranks_for(pixels: list[int]) -> int:
    """How many ranks a panel needs so that no region is wider or higher than a rank can render."""
    whole, ranks = Rect(x=0, y=0, width=pixels[0], height=pixels[1]), 1
    while any(max(part.width, part.height) > MAX_EDGE for part in split(whole, ranks)):
        ranks += 1
    return ranks


def numbers(values: Iterable[float]) -> list[float]:
    """Floats for YAML: rounded to a nanometre, without -0."""
    return [round(float(value), 9) + 0.0 for value in values]


def unique_names(wanted: Iterable[str]) -> list[str]:
    """Valid panel ids, each once, as near to the wanted names as possible."""
    taken: set[str] = set()
    names = []
    for n, text in enumerate(wanted):
        plain = re.sub(r"[^A-Za-z0-9_.-]+", "-", text).strip("-._")[:LONGEST_NAME] or f"panel{n}"
        name, again = plain, 1
        while not taken.isdisjoint((name, f"{name}.left", f"{name}.right")):
            again += 1
            name = f"{plain}-{again}"
        taken.update((name, f"{name}.left", f"{name}.right"))
        names.append(name)
    return names


def _limit_pixels(source: Source, draft: Draft) -> None:
    """Scale a panel down to MOST_PIXELS, and make the pixels that two eyes share even."""
    width, height = draft.pixels
    if (largest := max(width, height)) > MOST_PIXELS:
        share = MOST_PIXELS / largest
        draft.pixels = (max(1, int(width * share)), max(1, int(height * share)))
        draft.others.pop("window", None)
        source.note(draft.node, f"{width}x{height} pixels; a panel has at most {MOST_PIXELS}, so it is drawn coarser")
    axis = 0 if draft.stereo == "side_by_side" else 1
    if draft.stereo in PACKED and draft.pixels[axis] % 2:
        halved = list(draft.pixels)
        halved[axis] += 1 if draft.pixels[axis] == 1 else -1
        draft.pixels = (halved[0], halved[1])
        source.note(draft.node, "an odd number of pixels cannot be halved for two eyes: one pixel is left out")


def _square(source: Source, draft: Draft) -> None:
    """Make the lower left corner a right angle if it is too far from one."""
    low, right, high = draft.corners
    across, up = right - low, high - low
    width, height = np.linalg.norm(across), np.linalg.norm(up)
    cosine = float(across @ up / (width * height))
    if abs(cosine) <= 0.99 * SQUARENESS:
        return
    straight = up - (up @ across) / (across @ across) * across
    draft.corners = np.array([low, right, low + straight])
    angle = math.degrees(math.acos(max(-1.0, min(1.0, cosine))))
    source.note(draft.node, f"its corners meet at {angle:.1f} degrees; a panel is a rectangle, so they meet at 90 now")


def _turn_to(source: Source, draft: Draft, eye: Float64 | None) -> None:
    """Exchange left and right of a panel that shows its back to the eye."""
    if eye is not None and float((eye - draft.corners[0]) @ draft.normal) < -IN_PLANE_M:
        low, right, high = draft.corners
        draft.corners = np.array([right, low, high + right - low])
        source.note(draft.node, "its corners show its back to the eye: left and right are exchanged")


def _seeing(source: Source, drafts: Sequence[Draft], eye: Float64) -> Float64:
    """(3,) metres: the eye, or a position near it if it lies in a panel's plane.

    It is moved along the normals of such panels, as far as keeps it before all others.
    """
    lower_left, normals = np.array([draft.corners[0] for draft in drafts]), np.array([draft.normal for draft in drafts])
    beside = [k for k, before in enumerate(((eye - lower_left) * normals).sum(axis=1)) if before < IN_PLANE_M]
    if not beside:
        return eye
    way = normals[beside].sum(axis=0)
    for distance in (max(max(draft.size) for draft in drafts) / 2**k for k in range(EYE_TRIALS)):
        moved: Float64 = eye + distance * way / max(float(np.linalg.norm(way)), 1e-9)
        if (((moved - lower_left) * normals).sum(axis=1) >= IN_PLANE_M).all():
            break
    shown = f"[{', '.join(f'{value:g}' for value in moved)}]"
    source.note(drafts[beside[0]].node, f"the eye is in its plane and would see its edge: it is at {shown} now")
    return moved


def _values(source: Source, draft: Draft, name: str, overlap: dict[str, float]) -> dict[str, Any]:
    """A panel's values for YAML."""
    low, right, high = draft.corners
    values: dict[str, Any] = {
        "id": name,
        "pixels": list(draft.pixels),
        "corners": {"lower_left": numbers(low), "lower_right": numbers(right), "upper_left": numbers(high)},
    }
    if bezel := _bezel(source, draft, overlap):
        values["bezel"] = bezel
    if overlap:
        values["overlap"] = overlap
    if draft.eye is not None:
        values["eye"] = numbers(draft.eye)
    if draft.stereo != "mono":
        values["stereo"] = draft.stereo
    return values | draft.others


def _bezel(source: Source, draft: Draft, overlap: dict[str, float]) -> dict[str, float]:
    """The bezel's width at each side, metres: none where panels overlap, none wider than the panel."""
    limits = {"left": draft.size[0], "right": draft.size[0], "top": draft.size[1], "bottom": draft.size[1]}
    found = {}
    for side, width in draft.bezel.items():
        if width <= 0 or side in overlap:
            continue
        if width > limits[side]:
            source.note(draft.node, f"the frame at its {side} is wider than itself: it is as wide as the panel")
        found[side] = round(min(width, limits[side] * (1 - 1e-9), WIDEST_BEZEL_M), 9)
    return found
