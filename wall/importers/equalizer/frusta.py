"""Convert `wall` and `projection` blocks to corners of rectangles, and cut parts out of them.

Equalizer's frame is the wall's: metres, x right, y up, z towards the viewer, who begins at the origin.
Corners are (3, 3) float64 rows lower left, lower right, upper left. Defaults as in eq/fabric of Equalizer 2.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wall.core.data import Float64
from wall.core.errors import ConfigError
from wall.importers.equalizer.grammar import Statement
from wall.importers.panels import SMALLEST_M, rotation

DEFAULT_WALL = ((-0.8, -0.5, -1.0), (0.8, -0.5, -1.0), (-0.8, 0.5, -1.0))
DEFAULT_FOV, DEFAULT_DISTANCE = (77.3196, 53.1301), 1.0  # degrees, metres
ASSUMED_HEIGHT, ASSUMED_DISTANCE = 1.0, 1.0  # metres, of panels whose position the file does not give
SMALLEST_SHARE = 1e-4  # of a whole; parts that share less only touch
LARGEST_COSINE = 0.01  # between the sides of a rectangle
WHOLE = (0.0, 0.0, 1.0, 1.0)

View = tuple[float, float, float, float]  # x, y, width, height: part of a whole, from its lower left


@dataclass(frozen=True, slots=True)
class Frustum:
    """Corners of a rectangle, and the statement that gave them."""

    corners: Float64
    statement: Statement

    def part(self, view: View) -> Float64:
        """(3, 3) corners of a part."""
        return part(self.corners, view)


def frustum_of(block: Statement, name: str) -> Frustum | None:
    """The last wall or projection of a block. Raises ConfigError where its corners span no rectangle."""
    found = block.all("wall", "projection")
    for overruled in found[:-1]:
        overruled.drop(f"line {found[-1].line} says it again")
    if not found:
        return None
    last = found[-1]
    corners = _of_wall(last) if last.word == "wall" else _of_projection(last)
    _check(corners, last, name)
    last.carry("corners of panels" if last.body else "corners of panels: Equalizer's default wall, 1.6 m x 1 m")
    return Frustum(corners, last)


def viewport_of(block: Statement) -> View:
    """A block's viewport, the whole where it has none."""
    found = block.numbers("viewport")
    return (found[0], found[1], found[2], found[3]) if found else WHOLE


def part(corners: Float64, view: View) -> Float64:
    """(3, 3) corners of a part of a rectangle."""
    across, up = corners[1] - corners[0], corners[2] - corners[0]
    lower_left = corners[0] + view[0] * across + view[1] * up
    found: Float64 = np.array([lower_left, lower_left + view[2] * across, lower_left + view[3] * up])
    return found


def within(outer: View, inner: View) -> View:
    """A part of a part, as a part of the whole."""
    return (
        outer[0] + inner[0] * outer[2], outer[1] + inner[1] * outer[3], outer[2] * inner[2], outer[3] * inner[3]
    )  # fmt: skip


def common(a: View, b: View) -> View | None:
    """The intersection of two parts; None if they only touch."""
    x, y = max(a[0], b[0]), max(a[1], b[1])
    w, h = min(a[0] + a[2], b[0] + b[2]) - x, min(a[1] + a[3], b[1] + b[3]) - y
    return (x, y, w, h) if min(w, h) > SMALLEST_SHARE else None


def relative(view: View, to: View) -> View:
    """A part of the whole as a part of one of its parts."""
    return ((view[0] - to[0]) / to[2], (view[1] - to[1]) / to[3], view[2] / to[2], view[3] / to[3])


def in_a_row(sizes: list[tuple[int, int]]) -> list[Float64]:
    """Corners for panels that have none: side by side before the viewer, each 1 m high, with square pixels."""
    widths = [ASSUMED_HEIGHT * w / h for w, h in sizes]
    left, found = -sum(widths) / 2, []
    for width in widths:
        low = -ASSUMED_HEIGHT / 2
        found.append(
            np.array([(left, low, -ASSUMED_DISTANCE), (left + width, low, -ASSUMED_DISTANCE),
                      (left, -low, -ASSUMED_DISTANCE)])
        )  # fmt: skip
        left += width
    return found


def _of_wall(wall: Statement) -> Float64:
    """(3, 3) corners of a wall block."""
    found = [wall.numbers(word) for word in ("bottom_left", "bottom_right", "top_left")]
    corners = [given or default for given, default in zip(found, DEFAULT_WALL, strict=True)]
    kind = wall.last("type")
    if kind is not None and kind.values[0] == "HMD":
        kind.drop("a head-mounted display: its wall moves with the head there, and stands still here")
    elif kind is not None:
        kind.carry()
    return np.array(corners, np.float64)


def _of_projection(projection: Statement) -> Float64:
    """(3, 3) corners of a projection block, as Equalizer 2 converts a projector to a wall.

    Heading turns to the left, pitch down, roll clockwise; degrees.
    """
    origin = np.array(projection.numbers("origin") or (0.0, 0.0, 0.0))
    distance = abs((projection.numbers("distance") or [DEFAULT_DISTANCE])[0])
    half = distance * np.tan(np.radians(projection.numbers("fov") or DEFAULT_FOV) / 2)
    heading, pitch, roll = np.radians(projection.numbers("hpr") or (0.0, 0.0, 0.0))
    turned = rotation(2, -roll) @ rotation(1, heading) @ rotation(0, -pitch)
    flat = [(-half[0], -half[1], -distance), (half[0], -half[1], -distance), (-half[0], half[1], -distance)]
    found: Float64 = np.array(flat) @ turned.T + origin
    return found


def _check(corners: Float64, block: Statement, name: str) -> None:
    """Raise ConfigError for corners that span no rectangle."""
    across, up = corners[1] - corners[0], corners[2] - corners[0]
    sizes = float(np.linalg.norm(across)), float(np.linalg.norm(up))
    if min(sizes) < SMALLEST_M or not np.isfinite(corners).all():
        raise ConfigError(
            f"{name}:{block.line}:{block.column}: {block.word} of {sizes[0]:g} x {sizes[1]:g} m came; "
            "wanted: at least 0.0001 m each way"
        )
    if abs(float(across @ up)) > LARGEST_COSINE * sizes[0] * sizes[1]:
        raise ConfigError(
            f"{name}:{block.line}:{block.column}: the corners of this {block.word} meet at no right angle; "
            "wanted: a rectangle"
        )
