"""Grids of equal screens with mullions in pixels, as DisplayCluster and Tide describe them.

A screen's position follows from its indices i, j (from the left, from the top): i * (width + mullion), as both
programs lay them out. The surface's centre is the origin of the wall's frame.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from wall.config.screens import MAX_PANELS
from wall.importers.panels import (
    FARTHEST_PIXEL,
    METRES_A_PIXEL,
    MOST_PIXELS,
    SMALLEST_M,
    Draft,
    configuration,
    fit_panels,
    upright,
)
from wall.importers.report import Conversion
from wall.importers.source import Node, Source

BETWEEN_SURFACES_M = 0.1  # metres assumed between surfaces, whose distance no file gives
MOST_SCREENS = 1024  # along one side; more is a typing error
STEREO = ("mono", "left", "right", "side_by_side")


@dataclass(slots=True, kw_only=True)
class Surface:
    """Equal screens in one plane; lengths in pixels, `metres` is the whole surface's size if the file has it."""

    node: Node
    screen: tuple[int, int]
    count: tuple[int, int]
    gap: tuple[float, float]  # between neighbours; negative: they overlap
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
    window_position: tuple[int, int] | None = None  # on the display, pixels; None: it fills the display
    stereo: str = "mono"


def read_surface(
    source: Source,
    node: Node,
    *,
    display: tuple[str, str],
    gap: tuple[Node | None, Node | None],
    count: tuple[Node | None, Node | None],
) -> Surface:
    """A surface: `display` names the keys of one display's width and height, the rest are members, x before y.

    Raises NotThisFormat where the pixels are missing or a count is out of range.
    """
    one = source.positive(node, display[0]), source.positive(node, display[1])
    for key in display:
        source.carry(node.get(key), "pixels")
    gaps = _gap(source, gap[0], one[0]), _gap(source, gap[1], one[1])
    counts = _count(source, count[0]), _count(source, count[1])
    each = [_count(source, node.get(f"displaysPerScreen{axis}")) for axis in "XY"]
    width, height = (round(n * size + (n - 1) * between) for n, size, between in zip(each, one, gaps, strict=True))
    return Surface(node=node, screen=(width, height), count=counts, gap=gaps)


def read_window_position(source: Source, screen: Node, *, fullscreen: bool) -> tuple[int, int] | None:
    """The position of a screen's window on its display, pixels; None where it fills the display."""
    x, y = (source.whole(screen.get(key)) for key in ("x", "y"))
    for key in ("x", "y"):
        source.carry(screen.get(key), "window")
    return None if fullscreen and not x and not y else (x or 0, y or 0)


def read_stereo(source: Source, node: Node | None) -> str:
    """The kind of stereo that a screen shows, mono where the file says none that is known."""
    if node is None:
        return "mono"
    kind = str(node.value).strip().lower()
    if kind not in STEREO:
        source.drop(node, f"is not one of {', '.join(STEREO)}")
        return "mono"
    source.carry(node, "stereo")
    return kind


def _count(source: Source, node: Node | None) -> int:
    """A count of screens, carried; 1 where the file says nothing usable. Raises NotThisFormat out of range."""
    found = source.whole(node)
    if node is None or found is None:
        return 1
    if not 1 <= found <= MOST_SCREENS:
        raise source.refuse(node, f"is {found}", f"a whole number from 1 to {MOST_SCREENS}")
    source.carry(node, "where the panels stand")
    return found


def _gap(source: Source, node: Node | None, screen: int) -> float:
    """A mullion in pixels, 0 if none; one that leaves no screen of its own is not carried."""
    found = source.number(node)
    if found is None:
        return 0.0
    if found <= -screen:
        source.drop(node, f"neighbours would light more than a screen's {screen} pixels together")
        return 0.0
    source.carry(node, "bezel" if found >= 0 else "overlap")
    return found


def _every_screen(source: Source, surfaces: Sequence[Surface]) -> list[Screen]:
    """All screens of surfaces for which the file names no machines. Raises NotThisFormat for too many."""
    if (count := sum(surface.count[0] * surface.count[1] for surface in surfaces)) > MAX_PANELS:
        raise source.refuse(surfaces[0].node, f"has {count} screens", f"1 to {MAX_PANELS}")
    return [
        Screen(node=surface.node, surface=k, column=i, row=j)
        for k, surface in enumerate(surfaces)
        for j in range(surface.count[1])
        for i in range(surface.count[0])
    ]


def grid_conversion(
    source: Source, surfaces: Sequence[Surface], screens: Sequence[Screen], *, processes: int
) -> Conversion:
    """The conversion of a file's screens, of all screens where it names none; `processes`: how many it names."""
    panels = _drafts(source, surfaces, screens or _every_screen(source, surfaces))
    if len(panels) > processes > 0:
        source.assume("A process draws all screens inside it; here every panel has a rank of its own.")
    fitted, _ = fit_panels(source, panels, None)
    return source.close(configuration(fitted), panels=len(panels), ranks=len(panels))


def _drafts(source: Source, surfaces: Sequence[Surface], screens: Sequence[Screen]) -> list[Draft]:
    """The panels of all screens; surfaces stand side by side from the left, their middles at one height."""
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
    """Note the sizes and distances that the file leaves open."""
    if any(surface.metres is None for surface in surfaces):
        source.assume("The file gives pixels and no metres: 0.25 mm a pixel is assumed.")
    if len(surfaces) > 1:
        source.assume(
            f"Where the {len(surfaces)} surfaces stand is not in the file: they stand side by side, "
            f"{BETWEEN_SURFACES_M:g} m apart."
        )


def _draft(source: Source, surface: Surface, screen: Screen, left: float, surfaces: int) -> Draft:
    """The panel of a screen; `left` is the surface's left edge, metres, `surfaces` how many there are."""
    (w, h), (px, py), (gx, gy) = surface.screen, surface.pitch, surface.gap
    top = surface.pixels[1] * py / 2
    width, height = max(w * px, SMALLEST_M), max(h * py, SMALLEST_M)
    x, y = left + screen.column * (w + gx) * px, top - screen.row * (h + gy) * py
    if not (screen.column < surface.count[0] and screen.row < surface.count[1]):
        source.note(screen.node, f"stands outside the surface of {surface.count[0]} x {surface.count[1]} screens")
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
    """The values of host, display and window that the file gives."""
    others: dict[str, Any] = {}
    if screen.host is not None:
        others["host"] = screen.host
    if screen.display is not None:
        others["display"] = screen.display
    if screen.window_position is not None and max(surface.screen) <= MOST_PIXELS:
        x, y = screen.window_position
        if max(abs(x), abs(y)) <= FARTHEST_PIXEL:
            others["window"] = {"x": x, "y": y, "width": surface.screen[0], "height": surface.screen[1]}
        else:
            source.note(screen.node, f"its window at {x}, {y} is on no display: it fills its display")
    return others
