"""Convert destinations to the values of `wall:` and `views:`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from pydantic import ValidationError

from wall.config.screens import PanelConfig
from wall.core.data import Float64
from wall.core.errors import ConfigError
from wall.importers.equalizer.destinations import Destination
from wall.importers.equalizer.frusta import in_a_row
from wall.importers.equalizer.grammar import Statement
from wall.importers.panels import FARTHEST_PIXEL

EYE_BASE_M = 0.05  # Equalizer's default distance of both eyes
BEHIND = 0.002  # of the distance to the eye: how far a panel moves behind one that it overlaps
SAME_PLANE = 0.1  # pixels between planes that count as one
PARALLEL = 1e-5  # difference of unit vectors that count as parallel
LEAST_OVERLAP = 0.4  # pixels; panels that share less only touch
NEAREST = 1e-3  # metres from the eye to a panel's plane


@dataclass(frozen=True, slots=True)
class PanelPart:
    """A panel of the graph: the part of a destination that one eye sees."""

    id: str
    eye: str  # CYCLOP, LEFT or RIGHT
    pixels: tuple[int, int]
    destination: Destination


@dataclass(slots=True)
class WallValues:
    """The YAML's values of the wall and its viewer."""

    panels: list[dict[str, Any]]
    parts: list[PanelPart]
    eye: list[float]
    separation: float
    assumed: list[str]


def wall_values(destinations: list[Destination], eye_base: float | None, name: str) -> WallValues:
    """The wall's panels and its viewer. Invalid panels are reported as not carried; raises ConfigError if all are."""
    assumed: list[str] = []
    _assume_corners(destinations, assumed)
    eyes = [_eye(one.observer) for one in destinations]
    _turn_to(destinations, eyes, assumed)
    separation = next((_separation(one.observer) for one in destinations if one.observer is not None), None)
    _step_back(destinations, eyes, assumed)
    panels, parts, refusals = [], list[PanelPart](), list[ConfigError]()
    for one, eye in zip(destinations, eyes, strict=True):
        values, ours = _panel(one, assumed)
        if eye != eyes[0]:
            values["eye"] = eye
        try:
            _check(one, values, eye, name)
        except ConfigError as error:
            refusals.append(error)
            one.statement.drop(str(error).removeprefix(f"{name}:"))
            continue
        panels.append(values)
        parts.extend(ours)
    if not panels and refusals:
        raise refusals[0]
    views = {id(one.view) for one in destinations if one.view is not None}
    if len(views) > 1:
        assumed.append(f"one camera for all {len(views)} views that the canvases show")
    if any(one.channel.assumed for one in destinations):
        assumed.append("displays whose size the file does not say have 1920 x 1080 pixels")
    return WallValues(panels, parts, eyes[0], separation or eye_base or EYE_BASE_M, assumed)


def _assume_corners(destinations: list[Destination], assumed: list[str]) -> None:
    """Give corners to the panels that have none in the file."""
    unplaced = [one for one in destinations if one.corners is None]
    for one, corners in zip(unplaced, in_a_row([one.pixels for one in unplaced]), strict=True):
        one.corners = corners
    if unplaced:
        names = ", ".join(one.id for one in unplaced)
        assumed.append(f"the file says no place of {names}: side by side, 1 m high, 1 m before the viewer")


def _turn_to(destinations: list[Destination], eyes: list[list[float]], assumed: list[str]) -> None:
    """Exchange left and right of walls that face away from their viewer."""
    for one, eye in zip(destinations, eyes, strict=True):
        corners = one.corners
        assert corners is not None
        if float((np.array(eye) - corners[0]) @ _normal(corners)) < -NEAREST:
            one.corners = np.array([corners[1], corners[0], corners[1] + corners[2] - corners[0]])
            assumed.append(f"the wall of panel {one.id} faces away from the viewer: its left and right are exchanged")


def _eye(observer: Statement | None) -> list[float]:
    """The eye of an observer, metres; the origin by default."""
    found = observer.numbers("eye_cyclop") if observer is not None else None
    if observer is not None:
        observer.carry("who looks")
        observer.text("name")
    return found or [0.0, 0.0, 0.0]


def _separation(observer: Statement | None) -> float | None:
    """Metres between an observer's eyes; None where the file does not say."""
    if observer is None:
        return None
    left, right, base = (observer.numbers(word) for word in ("eye_left", "eye_right", "eye_base"))
    if left is not None and right is not None:
        return float(np.linalg.norm(np.subtract(right, left)))
    return base[0] if base is not None else None


def _check(one: Destination, values: dict[str, Any], eye: list[float], name: str) -> None:
    """Raise ConfigError for a panel that a configuration refuses, or whose plane holds the viewer's eye."""
    corners, at = one.corners, one.statement
    try:
        PanelConfig.model_validate(values)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        raise ConfigError(
            f"{name}:{at.line}:{at.column}: panel {one.id}: {'.'.join(map(str, first['loc']))}: {first['msg']}; "
            "wanted: a panel of 0.0001 m or more each way"
        ) from None
    assert corners is not None
    away = float((np.array(eye) - corners[0]) @ _normal(corners))
    if away < NEAREST:
        raise ConfigError(
            f"{name}:{at.line}:{at.column}: the viewer at {eye} is in the plane of panel {one.id}; "
            "wanted: a wall that faces the viewer"
        )


def _normal(corners: Float64) -> Float64:
    """(3,) unit normal of a rectangle's front."""
    normal = np.cross(corners[1] - corners[0], corners[2] - corners[0])
    found: Float64 = normal / np.linalg.norm(normal)
    return found


def _step_back(destinations: list[Destination], eyes: list[list[float]], assumed: list[str]) -> None:
    """Move overlapping panels behind each other, along the directions from the eye, so that they look the same."""
    for i, one in enumerate(destinations):
        first, steps, hidden = one.corners, 0, ""
        assert first is not None
        while (other := _covers(destinations, eyes, i)) is not None and steps < len(destinations):
            steps += 1
            eye = np.array(eyes[i])
            one.corners = eye + (first - eye) * (1 + steps * BEHIND)
            hidden = hidden or other.id
        if steps:
            assumed.append(
                f"panel {one.id} shows the place of panel {hidden}: it stands {steps * BEHIND * 100:g} % "
                "farther from the viewer, and is seen under the same angles"
            )


def _covers(destinations: list[Destination], eyes: list[list[float]], i: int) -> Destination | None:
    """An earlier panel of the same plane and eye that overlaps panel i."""
    for j, other in enumerate(destinations[:i]):
        one = destinations[i]
        if eyes[i] == eyes[j] and (one.eyes & other.eyes) and _overlap(one, other):
            return other
    return None


def _overlap(one: Destination, other: Destination) -> bool:
    """Whether two panels lie in one plane and overlap."""
    a, b = one.corners, other.corners
    assert a is not None
    assert b is not None
    size_a, size_b = (np.linalg.norm(c[1:] - c[0], axis=1) for c in (a, b))
    pitch = np.minimum(size_a / one.pixels, size_b / other.pixels)
    across_a, across_b = (a[1:] - a[0]) / size_a[:, None], (b[1:] - b[0]) / size_b[:, None]
    if np.abs(across_a - across_b).max() > PARALLEL or abs((b[0] - a[0]) @ _normal(a)) > SAME_PLANE * pitch.min():
        return False
    low = across_a @ (b[0] - a[0])
    shared = np.minimum(size_a, low + size_b) - np.maximum(0.0, low)
    return bool((shared > LEAST_OVERLAP * pitch).all())


def _panel(one: Destination, assumed: list[str]) -> tuple[dict[str, Any], list[PanelPart]]:
    """A panel's values for YAML, and its part for each eye."""
    corners, (w, h) = one.corners, one.pixels
    assert corners is not None
    sides = sorted(one.eyes & {"LEFT", "RIGHT"})
    values: dict[str, Any] = {"id": one.id}
    parts = [PanelPart(one.id, sides[0] if sides else "CYCLOP", (w, h), one)]
    if len(sides) == 2:
        w, h = _even(w, h)
        halves = (w // 2, h) if w % 2 == 0 else (w, h // 2)
        parts = [PanelPart(f"{one.id}.{side.lower()}", side, halves, one) for side in sides]
        values["stereo"] = "side_by_side" if w % 2 == 0 else "top_bottom"
        assumed.append(f"panel {one.id} shows both eyes in one picture ({values['stereo']})")
    elif sides:
        values["stereo"] = sides[0].lower()
    values["pixels"] = [w, h]
    rows = [[round(float(x), 9) + 0.0 for x in row] for row in corners]
    values["corners"] = dict(zip(("lower_left", "lower_right", "upper_left"), rows, strict=True))
    if one.channel.host:
        values["host"] = one.channel.host
    if one.channel.display:
        values["display"] = one.channel.display
    if (window := _window(one, (w, h))) is not None:
        values["window"] = window
    return values, parts


def _even(w: int, h: int) -> tuple[int, int]:
    """A size that can be halved: one column less where both are odd."""
    return (w - 1, h) if w % 2 and h % 2 and w > 1 else (w, h)


def _window(one: Destination, pixels: tuple[int, int]) -> dict[str, int] | None:
    """A panel's window on its display, pixels from the top left; None if it fills the display."""
    x, y, _, h = one.part
    area, whole = one.channel.window, one.part == (0.0, 0.0, 1.0, 1.0)
    if area is None and whole:
        return None
    left, top, width, height = area or (0, 0, *one.channel.pixels)
    left, top = left + round(x * width), top + height - round((y + h) * height)
    if max(abs(left), abs(top)) > FARTHEST_PIXEL:
        for viewport in (at.last("viewport") for at in (one.channel.statement, one.channel.statement.parent) if at):
            if viewport is not None:
                viewport.drop(f"its window at {left}, {top} is on no display: it fills its display")
        return None
    return {"x": left, "y": top, "width": pixels[0], "height": pixels[1]}
