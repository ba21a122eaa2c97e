"""Panels in the wall's frame (metres) and in the virtual screen (pixels).

Wall frame: x right, y up, z towards the viewer; a grid has its centre at the origin. Virtual screen: x right,
y down, origin at the top left of all panels, bezel gaps and overlaps included as whole pixels.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wall.config.displays import BlendConfig, ColourConfig, SidesConfig, WarpFileConfig, WindowConfig
from wall.config.screens import GridConfig, PanelConfig, Rotation, Stereo, WallConfig
from wall.core.data import Float64
from wall.geometry.layout import Overlap, Placed, Placement, place
from wall.geometry.shorthand import Eye, eyes, grid_panels, raster
from wall.geometry.shorthand import expanded_config as expanded_config
from wall.operators.warp import Mesh

ON_GRID = 0.01  # pixels: panels that stand so near to whole pixels of another's plane are put there
SHIFTS = {"left": -0.5, "right": 0.5}  # eye separations
NO_SIDES = SidesConfig()


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
    """One display, for one eye. Panels that lie in one plane on one grid of pixels share one Plane object.

    So their rays are those of the whole wall, bit for bit.
    """

    id: str
    index: int  # in Wall.panels
    pixels: tuple[int, int]  # width, height, as the viewer sees it
    corners: Float64  # (3, 3) rows lower left, lower right, upper left of what the pixels span; metres, wall frame
    screen: tuple[int, int]  # where its top left pixel is in the virtual screen
    span: tuple[int, int]  # width and height there: its pixels, or more where others of its face are finer
    host: str | None  # machine it hangs on; None = any
    plane: Plane
    eye: Float64 | None = None  # (3,) metres, wall frame: who looks at it; None = the view's eye
    shift: float = 0.0  # of the eye to the wall frame's right, eye separations: -0.5 left, 0.5 right
    stereo: Stereo = "mono"  # as configured
    of: str = ""  # id of the physical panel; its own unless the physical one holds both eyes in one picture
    at: tuple[int, int] = (0, 0)  # its top left pixel in the physical panel's picture
    rotation: Rotation = 0  # degrees, clockwise, that the display is mounted turned
    bezel: SidesConfig = NO_SIDES  # metres
    overlap: SidesConfig = NO_SIDES  # metres of it that neighbours light too
    skip: bool = False  # its pixels span its bezels too, squeezed into the lit area
    colour: ColourConfig | None = None
    blend: BlendConfig | None = None  # metres; `auto` is worked out
    warp: Mesh | WarpFileConfig | None = None
    display: str | None = None  # X display
    monitor: int | str | None = None  # index or name
    window: WindowConfig | None = None  # part of the monitor; None = all of it
    refresh_hz: float | None = None  # None = the view's

    @property
    def pitch(self) -> tuple[float, float]:
        """Metres a pixel, across and down."""
        return float(np.linalg.norm(self.plane.per_x)), float(np.linalg.norm(self.plane.per_y))

    @property
    def lit(self) -> Float64:
        """(3, 3) float64, as `corners`, of what shines: without bezels where its pixels span them."""
        return _widened(self.corners, self.bezel, -1.0) if self.skip else self.corners


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Wall:
    """All panels, and the size of the virtual screen in pixels."""

    panels: tuple[Panel, ...]
    width: int
    height: int
    faces: tuple[tuple[int, ...], ...] = ()  # indices of panels that lie in the virtual screen as they stand
    overlaps: tuple[Overlap, ...] = ()  # what two panels light for the same eye, declared or not

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

    A panel whose picture holds both eyes becomes two, ID.left and ID.right, with its corners.

    Gaps of a grid are rounded to whole pixels, so two neighbours are at most half a pixel nearer or farther
    than their bezels say; `corners` hold the rounded place, and rays are exact for that place. So are those of panels
    one by one, but that a panel within a hundredth of a pixel of the whole pixels of another's plane is put there.
    """
    skip = config.bezel == "skip"
    configs = config.panels if config.grid is None else grid_panels(config.grid, skip=skip)
    assert configs is not None  # the model has exactly one of grid and panels
    single = [eye for panel in configs for eye in eyes(panel)]
    placements = [_placement(eye.panel, skip=skip) for eye in single]
    placed = place(placements, regular=config.grid is not None)
    planes = _planes(placements, placed, config.grid, skip=skip)
    panels = [
        _panel(k, eye, screen, span, plane, skip=skip)
        for k, (eye, screen, span, plane) in enumerate(zip(single, placed.screens, placed.spans, planes, strict=True))
    ]
    return Wall(
        panels=tuple(panels),
        width=placed.width,
        height=placed.height,
        faces=tuple(map(tuple, placed.faces)),
        overlaps=tuple(placed.overlaps),
    )


def _placement(config: PanelConfig, *, skip: bool) -> Placement:
    """A panel's configuration as layout.place takes it."""
    corners = np.array([config.corners.lower_left, config.corners.lower_right, config.corners.upper_left])
    lower_left, lower_right, upper_left = _widened(corners, config.bezel, 1.0) if skip else corners
    w, h = config.pixels
    return Placement(
        upper_left=upper_left,
        per_x=(lower_right - lower_left) / w,
        per_y=(lower_left - upper_left) / h,
        pixels=config.pixels,
        bezel=NO_SIDES if skip else config.bezel,
        overlap=config.overlap,
        sight=(SHIFTS.get(config.stereo, 0.0), config.eye),
    )


def _widened(corners: Float64, frame: SidesConfig, times: float) -> Float64:
    """(3, 3) corners (rows as Panel.corners) of a rectangle made larger by a frame; -1 times the frame: smaller."""
    right, up = corners[1] - corners[0], corners[2] - corners[0]
    right, up = times * right / np.linalg.norm(right), times * up / np.linalg.norm(up)
    outwards = [(-frame.left, -frame.bottom), (frame.right, -frame.bottom), (-frame.left, frame.top)]
    wider: Float64 = corners + np.array([x * right + y * up for x, y in outwards])
    return wider


def _planes(placements: list[Placement], placed: Placed, grid: GridConfig | None, *, skip: bool) -> list[Plane]:
    """Each panel's plane; panels of a face that stand on one grid of pixels share one."""
    planes: dict[int, Plane] = {}
    for face in placed.faces:
        left = np.array(face)
        while len(left):
            k = int(left[0])
            own, screen = placements[k], placed.screens[k]
            plane = _grid_plane(grid, own, screen, skip=skip) if grid else _own_plane(own, screen)
            there = _on_grid(plane, [placements[j] for j in left], [placed.screens[j] for j in left])
            there[0] = True
            planes.update(dict.fromkeys((int(j) for j in left[there]), plane))
            left = left[~there]
    return [planes[k] for k in range(len(placements))]


def _grid_plane(grid: GridConfig, panel: Placement, screen: tuple[int, int], *, skip: bool) -> Plane:
    """The plane of a grid; its top left is not the virtual screen's where the other eye's grid lies before it."""
    drawn = raster(grid, skip=skip)
    own = np.rint((panel.upper_left - drawn.point(0, 0))[:2] / drawn.pitch * (1, -1))
    return _plane(
        drawn.point(own[0] - screen[0], own[1] - screen[1]),
        np.array([drawn.pitch[0], 0.0, 0.0]),
        np.array([0.0, -drawn.pitch[1], 0.0]),
    )


def _own_plane(panel: Placement, screen: tuple[int, int]) -> Plane:
    return _plane(panel.upper_left - screen[0] * panel.per_x - screen[1] * panel.per_y, panel.per_x, panel.per_y)


def _on_grid(plane: Plane, panels: list[Placement], screens: list[tuple[int, int]]) -> NDArray[np.bool_]:
    """(n,) whether all corners of a panel are where its pixels have them in a plane, to ON_GRID pixels."""
    upper_left, screen = np.array([p.upper_left for p in panels]), np.array(screens, np.float64)
    pixels = np.array([p.pixels for p in panels], np.float64)
    across = np.array([p.per_x for p in panels]) * pixels[:, :1]
    down = np.array([p.per_y for p in panels]) * pixels[:, 1:]
    most = ON_GRID * min(np.linalg.norm(plane.per_x), np.linalg.norm(plane.per_y))
    near = np.ones(len(panels), np.bool_)
    for x, y in ((0, 0), (1, 0), (0, 1), (1, 1)):
        place = screen + pixels * (x, y)
        away = upper_left + x * across + y * down - plane.origin - place @ np.array([plane.per_x, plane.per_y])
        near &= np.linalg.norm(away, axis=1) <= most
    return near


def _panel(index: int, eye: Eye, screen: tuple[int, int], span: tuple[int, int], plane: Plane, *, skip: bool) -> Panel:
    config = eye.panel
    (x, y), (w, h) = screen, config.pixels
    corners = np.array([plane.point(x, y + h), plane.point(x + w, y + h), plane.point(x, y)])
    own_eye = None if config.eye is None else np.array(config.eye)
    for vector in (corners, own_eye):
        if vector is not None:
            vector.setflags(write=False)
    return Panel(
        id=config.id, index=index, pixels=config.pixels, corners=corners, screen=screen, span=span,
        host=config.host, plane=plane,
        eye=own_eye, shift=SHIFTS.get(config.stereo, 0.0), stereo=config.stereo, of=eye.of, at=eye.at,
        rotation=config.rotation, bezel=config.bezel, overlap=config.overlap, skip=skip, colour=config.colour,
        blend=_blend(config), warp=config.warp, display=config.display, monitor=config.monitor, window=config.window,
        refresh_hz=config.refresh_hz,
    )  # fmt: skip


def _blend(config: PanelConfig) -> BlendConfig | None:
    """The panel's blend, `auto` resolved to its overlap."""
    if config.blend == "auto":
        return BlendConfig(**config.overlap.model_dump())
    return config.blend if isinstance(config.blend, BlendConfig) else None


def _plane(origin: Float64, per_x: Float64, per_y: Float64) -> Plane:
    """A Plane of arrays that are made read-only."""
    for vector in (origin, per_x, per_y):
        vector.setflags(write=False)
    return Plane(origin=origin, per_x=per_x, per_y=per_y)
