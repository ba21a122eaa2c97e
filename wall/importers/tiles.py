"""Surfaces of equal screens in rows and columns, in pixels with mullions: what DisplayCluster and Tide describe.

A screen's place follows from its indices i, j (from the left, from the top): i * (width + mullion), as both
programs lay them out. The surface's centre is the origin of the wall's frame.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from wall.config.screens import MAX_PANELS
from wall.importers.panels import FARTHEST_PIXEL, METRES_A_PIXEL, MOST_PIXELS, SMALLEST_M, Draft, upright
from wall.importers.source import Node, Source

BETWEEN_SURFACES_M = 0.1


@dataclass(slots=True, kw_only=True)
class Surface:
    """Equal screens in one plane; lengths in pixels, `metres` is the whole surface's size if the file has it."""

    node: Node
    screen: tuple[int, int]
    count: tuple[int, int]
    gap: tuple[float, float]  # between neighbours; negative: they light the same place
    metres: tuple[float, float] | None = None

    @property
    def pixels(self) -> tuple[float, float]:
        """Width and height with the gaps."""
        (w, h), (nx, ny), (gx, gy) = self.screen, self.count, self.gap
        return nx * w + (nx - 1) * gx, ny * h + (ny - 1) * gy

    @property
    def pitch(self) -> tuple[float, float]:
        """Metres a pixel, across and down."""
        if self.metres is None:
            return METRES_A_PIXEL, METRES_A_PIXEL
        return self.metres[0] / self.pixels[0], self.metres[1] / self.pixels[1]


@dataclass(slots=True, kw_only=True)
class Screen:
    """One screen of a surface, and the machine that draws it."""

    node: Node
    surface: int
    column: int
    row: int
    host: str | None = None
    display: str | None = None
    place: tuple[int, int] | None = None  # of its window on the display, pixels
    stereo: str = "mono"


def read_count(source: Source, node: Node | None, otherwise: int) -> int:
    """A count of screens, carried; `otherwise` where the file says nothing usable."""
    found = source.whole(node)
    if node is None or found is None:
        return otherwise
    if not 1 <= found <= 1024:
        raise source.refuse(node, f"is {found}", "a whole number from 1 to 1024")
    source.carry(node, "where the panels stand")
    return found


def read_gap(source: Source, node: Node | None, screen: int) -> float:
    """A mullion in pixels, 0 if none; one that leaves no screen of its own is not carried."""
    found = source.number(node)
    if found is None:
        return 0.0
    if found <= -screen:
        source.drop(node, f"neighbours would light more than a screen's {screen} pixels together")
        return 0.0
    source.carry(node, "bezel" if found >= 0 else "overlap")
    return found


def read_screen(source: Source, parent: Node, keys: tuple[str, str]) -> tuple[int, int]:
    """Width and height of a screen, pixels, carried. Raises NotThisFormat where they are missing."""
    sizes = source.positive(parent, keys[0]), source.positive(parent, keys[1])
    for key in keys:
        source.carry(parent.get(key), "pixels")
    return sizes


def every_screen(source: Source, surfaces: Sequence[Surface]) -> list[Screen]:
    """All screens of surfaces for which the file names no machines. Raises NotThisFormat for too many."""
    if (count := sum(surface.count[0] * surface.count[1] for surface in surfaces)) > MAX_PANELS:
        raise source.refuse(surfaces[0].node, f"has {count} screens", f"1 to {MAX_PANELS}")
    return [
        Screen(node=surface.node, surface=k, column=i, row=j)
        for k, surface in enumerate(surfaces)
        for j in range(surface.count[1])
        for i in range(surface.count[0])
    ]


def drafts(source: Source, surfaces: Sequence[Surface], screens: Sequence[Screen]) -> list[Draft]:
    """The panels; surfaces stand side by side from the left, all with their middles at one height."""
    lefts, x = [], 0.0
    for surface in surfaces:
        lefts.append(x)
        x += surface.pixels[0] * surface.pitch[0] + BETWEEN_SURFACES_M
    middle = (x - BETWEEN_SURFACES_M) / 2
    _assume(source, surfaces)
    found = []
    for screen in screens:
        if not (0 <= screen.surface < len(surfaces)):
            source.drop(screen.node, f"is on surface {screen.surface} of {len(surfaces)}")
            continue
        found.append(_draft(source, surfaces[screen.surface], screen, lefts[screen.surface] - middle, len(surfaces)))
    return found


def _assume(source: Source, surfaces: Sequence[Surface]) -> None:
    if any(surface.metres is None for surface in surfaces):
        source.assume("The file gives pixels and no metres: 0.25 mm a pixel is assumed.")
    if len(surfaces) > 1:
        source.assume(
            f"Where the {len(surfaces)} surfaces stand is not in the file: they stand side by side, "
            f"{BETWEEN_SURFACES_M:g} m apart."
        )


def _draft(source: Source, surface: Surface, screen: Screen, left: float, surfaces: int) -> Draft:
    (w, h), (px, py), (gx, gy) = surface.screen, surface.pitch, surface.gap
    top = surface.pixels[1] * py / 2
    width, height = max(w * px, SMALLEST_M), max(h * py, SMALLEST_M)
    x, y = left + screen.column * (w + gx) * px, top - screen.row * (h + gy) * py
    if not (screen.column < surface.count[0] and screen.row < surface.count[1]):
        source.remark(screen.node, f"stands outside the surface of {surface.count[0]} x {surface.count[1]} screens")
    across, down = max(0.0, gx) * px / 2, max(0.0, gy) * py / 2
    prefix = f"s{screen.surface}-" if surfaces > 1 else ""
    eye = f"-{screen.stereo}" if screen.stereo in ("left", "right") else ""
    return Draft(
        node=screen.node,
        name=f"{prefix}r{screen.row}c{screen.column}{eye}",
        pixels=surface.screen,
        corners=upright(x, y - height, width, height),
        bezel={"left": across, "right": across, "top": down, "bottom": down},
        stereo=screen.stereo,
        others=_display(source, surface, screen),
    )


def _display(source: Source, surface: Surface, screen: Screen) -> dict[str, Any]:
    """host, display, window: only what the file says."""
    others: dict[str, Any] = {}
    if screen.host is not None:
        others["host"] = screen.host
    if screen.display is not None:
        others["display"] = screen.display
    if screen.place is not None and max(surface.screen) <= MOST_PIXELS:
        x, y = screen.place
        if max(abs(x), abs(y)) <= FARTHEST_PIXEL:
            others["window"] = {"x": x, "y": y, "width": surface.screen[0], "height": surface.screen[1]}
        else:
            source.remark(screen.node, f"its window at {x}, {y} is on no display: it fills its display")
    return others
