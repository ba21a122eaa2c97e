"""Panels in the wall's frame (metres) and in the virtual screen (pixels).

Wall frame: x right, y up, z towards the viewer; a grid has its centre at the origin. Virtual screen: x right,
y down, origin at the top left of all panels, bezel gaps included as whole pixels.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wall.config.schema import GridConfig, PanelConfig, WallConfig
from wall.data import Float64
from wall.geometry.layout import Placement, place


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Plane:
    """Virtual-screen pixels to metres: the point of (X, Y) is origin + X * per_x + Y * per_y, wall frame."""

    origin: Float64  # (3,) metres, the virtual screen's top left corner
    per_x: Float64  # (3,) metres a pixel to the right
    per_y: Float64  # (3,) metres a pixel down

    def point(self, x: float, y: float) -> Float64:
        """(3,) float64, metres, wall frame, of virtual-screen pixel coordinates."""
        found: Float64 = self.origin + x * self.per_x + y * self.per_y
        return found

    @property
    def normal(self) -> Float64:
        """(3,) float64, unit, towards the viewer."""
        across = np.cross(self.per_y, self.per_x)
        found: Float64 = across / np.linalg.norm(across)
        return found


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Panel:
    """One display. Panels of a grid share one Plane object, so their rays are those of the whole wall."""

    id: str
    index: int  # in Wall.panels
    pixels: tuple[int, int]  # width, height
    corners: Float64  # (3, 3) rows lower left, lower right, upper left of the lit area; metres, wall frame
    screen: tuple[int, int]  # where its top left pixel is in the virtual screen
    host: str | None  # machine it hangs on; None = any
    plane: Plane


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Wall:
    """All panels, and the size of the virtual screen in pixels."""

    panels: tuple[Panel, ...]
    width: int
    height: int

    @property
    def flat(self) -> bool:
        """Whether all panels lie in one plane (to a millionth of the wall's size) and face the same way."""
        normal = self.panels[0].plane.normal
        corners = np.concatenate([panel.corners for panel in self.panels]) - self.panels[0].corners[0]
        size = float(np.abs(corners).max())
        same_way = all(panel.plane.normal @ normal > 1 - 1e-6 for panel in self.panels)
        return same_way and float(np.abs(corners @ normal).max()) <= 1e-6 * size

    def panel(self, panel_id: str) -> Panel:
        """The panel of that id; KeyError if there is none."""
        for panel in self.panels:
            if panel.id == panel_id:
                return panel
        raise KeyError(panel_id)


def expand(config: WallConfig) -> Wall:
    """All panels with their places, in the order of the file; a grid row by row from the top left.

    Gaps of a grid are rounded to whole pixels, so two neighbours are at most half a pixel nearer or farther
    than their bezels say; `corners` hold the rounded place, and rays are exact for that place.
    """
    if config.grid is not None:
        return _grid(config.grid)
    assert config.panels is not None  # the model has exactly one of both
    return _single(config.panels)


def _grid(grid: GridConfig) -> Wall:
    (w, h), pitch = grid.pixels, np.array(grid.size) / np.array(grid.pixels)
    gap_x = round((grid.bezel.left + grid.bezel.right) / pitch[0])
    gap_y = round((grid.bezel.top + grid.bezel.bottom) / pitch[1])
    width, height = grid.columns * (w + gap_x) - gap_x, grid.rows * (h + gap_y) - gap_y
    plane = _plane(
        np.array([-width / 2 * pitch[0], height / 2 * pitch[1], 0.0]),
        np.array([pitch[0], 0.0, 0.0]),
        np.array([0.0, -pitch[1], 0.0]),
    )
    panels = []
    for index in range(grid.rows * grid.columns):
        row, column = divmod(index, grid.columns)
        screen = (column * (w + gap_x), row * (h + gap_y))
        panels.append(_panel(grid.panel_id(row, column), index, (w, h), screen, None, plane))
    return Wall(panels=tuple(panels), width=width, height=height)


def _single(configs: tuple[PanelConfig, ...]) -> Wall:
    placements = [_placement(panel) for panel in configs]
    screens, width, height = place(placements)
    panels = []
    for index, (config, own, screen) in enumerate(zip(configs, placements, screens, strict=True)):
        plane = _plane(own.upper_left - screen[0] * own.per_x - screen[1] * own.per_y, own.per_x, own.per_y)
        panels.append(_panel(config.id, index, config.pixels, screen, config.host, plane))
    return Wall(panels=tuple(panels), width=width, height=height)


def _placement(config: PanelConfig) -> Placement:
    lower_left = np.array(config.corners.lower_left)
    upper_left = np.array(config.corners.upper_left)
    w, h = config.pixels
    return Placement(
        upper_left=upper_left,
        per_x=(np.array(config.corners.lower_right) - lower_left) / w,
        per_y=(lower_left - upper_left) / h,
        pixels=config.pixels,
        bezel=(config.bezel.left, config.bezel.right),
    )


def _panel(
    name: str, index: int, pixels: tuple[int, int], screen: tuple[int, int], host: str | None, plane: Plane
) -> Panel:
    (x, y), (w, h) = screen, pixels
    corners = np.array([plane.point(x, y + h), plane.point(x + w, y + h), plane.point(x, y)])
    corners.setflags(write=False)
    return Panel(id=name, index=index, pixels=pixels, corners=corners, screen=screen, host=host, plane=plane)


def _plane(origin: Float64, per_x: Float64, per_y: Float64) -> Plane:
    for vector in (origin, per_x, per_y):
        vector.setflags(write=False)
    return Plane(origin=origin, per_x=per_x, per_y=per_y)
