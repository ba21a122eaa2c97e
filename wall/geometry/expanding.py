"""From a configuration to its panels: grids, and the two eyes of a panel that shows both in one image, written out.

What comes out has the same rays: a grid's gaps and overlaps are whole pixels, and its panels' corners say so.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from wall.config.displays import BlendConfig, SidesConfig, WindowConfig
from wall.config.loading import Loaded
from wall.config.screens import CornersConfig, GridConfig, PanelConfig, Stereo, WallConfig
from wall.config.yaml_text import YamlPath
from wall.core.data import Float64
from wall.geometry.layout import place
from wall.geometry.panels import Panel, Plane, Wall, widened
from wall.geometry.scan import scan_of
from wall.geometry.seats import Seat, eyes_before, seats
from wall.geometry.surfaces import SightError, Surface, flat_image

SHIFTS = {"left": -0.5, "right": 0.5}  # eye separations


class Raster(NamedTuple):
    """The virtual screen of a grid for one eye: its pixels, and where they are in the wall's frame."""

    width: int  # pixels
    height: int
    pixels: tuple[int, int]  # of one panel
    pitch: tuple[float, float]  # metres a pixel, across and down
    step: tuple[int, int]  # pixels from one panel to the next

    def point(self, x: float, y: float) -> Float64:
        """(3,) float64, metres, wall frame; its middle is the origin."""
        return np.array([(x - self.width / 2) * self.pitch[0], (self.height / 2 - y) * self.pitch[1], 0.0])

    def plane(self, row: int, column: int) -> Plane:
        """The plane of a panel's pixels."""
        across, down = np.array([self.pitch[0], 0.0, 0.0]), np.array([0.0, -self.pitch[1], 0.0])
        return Plane(origin=self.point(column * self.step[0], row * self.step[1]), per_x=across, per_y=down)


class Eye(NamedTuple):
    """One eye's panel of a physical one."""

    panel: PanelConfig
    of: str  # id of the physical panel
    at: tuple[int, int]  # its top left pixel in the physical panel's image


def raster(grid: GridConfig, *, skip: bool) -> Raster:
    """The pixels of a grid. With `skip` a panel's pixels span its frame too, so that none is hidden."""
    w, h = _halved(grid.pixels, grid.stereo)
    frame = (grid.bezel.across, grid.bezel.down)
    size = (grid.size[0] + frame[0], grid.size[1] + frame[1]) if skip else grid.size
    pitch = (size[0] / w, size[1] / h)
    gap = [0 if skip else round(frame[k] / pitch[k]) for k in range(2)]
    step = (w + gap[0] - round(grid.overlap[0] / pitch[0]), h + gap[1] - round(grid.overlap[1] / pitch[1]))
    width, height = (grid.columns - 1) * step[0] + w, (grid.rows - 1) * step[1] + h
    return Raster(width=width, height=height, pixels=(w, h), pitch=pitch, step=step)


def grid_panels(grid: GridConfig, *, skip: bool) -> tuple[PanelConfig, ...]:
    """The panels of a grid row by row from the top left, their corners where whole pixels put them."""
    drawn, positions = raster(grid, skip=skip), itertools.product(range(grid.rows), range(grid.columns))
    return tuple(_grid_panel(grid, drawn, row, column, skip=skip) for row, column in positions)


def _grid_panel(grid: GridConfig, drawn: Raster, row: int, column: int, *, skip: bool) -> PanelConfig:
    (w, h), (x, y) = drawn.pixels, (column * drawn.step[0], row * drawn.step[1])
    frame = grid.bezel if skip else SidesConfig()
    shared = [
        round((drawn.pixels[k] - drawn.step[k]) * drawn.pitch[k], 9) if grid.overlap[k] else 0.0 for k in range(2)
    ]
    inner = _inner(grid, row, column)
    return PanelConfig(
        id=grid.panel_id(row, column),
        pixels=grid.pixels,
        corners=CornersConfig(
            lower_left=_moved(drawn.point(x, y + h), frame.left, frame.bottom),
            lower_right=_moved(drawn.point(x + w, y + h), -frame.right, frame.bottom),
            upper_left=_moved(drawn.point(x, y), frame.left, -frame.top),
        ),
        bezel=grid.bezel,
        overlap=SidesConfig(**{side: shared[axis] for side, axis in inner.items()}),
        rotation=grid.rotation,
        stereo=grid.stereo,
        colour=grid.colour,
        row_time=grid.row_time,
        blend=_grid_blend(grid, set(inner)),
        **_filled(grid, row, column),
    )


def _inner(grid: GridConfig, row: int, column: int) -> dict[str, int]:
    """The sides of a panel where a neighbour is, and their axis."""
    there = {"left": column > 0, "right": column + 1 < grid.columns, "top": row > 0, "bottom": row + 1 < grid.rows}
    return {side: int(side in ("top", "bottom")) for side, is_there in there.items() if is_there}


def _grid_blend(grid: GridConfig, inner: set[str]) -> Any:
    if not isinstance(grid.blend, BlendConfig):
        return grid.blend
    return grid.blend.model_copy(update=dict.fromkeys(set(SidesConfig.model_fields) - inner, 0.0))


def _filled(grid: GridConfig, row: int, column: int) -> dict[str, Any]:
    """What names a machine and its display, its patterns filled."""
    names = {key: getattr(grid, key) for key in ("host", "display", "monitor", "refresh_hz")}
    return {k: grid.filled(v, row, column) if isinstance(v, str) else v for k, v in names.items() if v is not None}


def _moved(point: Float64, right: float, up: float) -> tuple[float, float, float]:
    """As people would write it: 14 digits, far finer than the hundredth of a pixel within which planes are shared."""
    x, y, z = (float(f"{value:.14g}") for value in point + np.array([right, up, 0.0]))
    return x, y, z


def eyes(panel: PanelConfig) -> tuple[Eye, ...]:
    """The panel itself, or one for each eye where its image holds both. Both keep its window, which shows them both."""
    if not panel.packed:
        return (Eye(panel, panel.id, (0, 0)),)
    axis = 0 if panel.stereo == "side_by_side" else 1
    pixels, found = _halved(panel.pixels, panel.stereo), []
    for k, eye in enumerate(("left", "right")):
        changed = {"id": f"{panel.id}.{eye}", "pixels": pixels, "stereo": eye}
        at = (k * pixels[0], 0) if axis == 0 else (0, k * pixels[1])
        found.append(Eye(panel.model_copy(update=changed), panel.id, at))
    return tuple(found)


def _alone(panel: PanelConfig) -> tuple[PanelConfig, ...]:
    """A panel's eyes as panels of their own, each with its part of the window."""
    if not panel.packed:
        return (panel,)
    axis = 0 if panel.stereo == "side_by_side" else 1
    place, side = "xy"[axis], ("width", "height")[axis]
    whole = panel.window or WindowConfig(width=panel.pixels[0], height=panel.pixels[1])
    half = getattr(whole, side) // 2
    first = whole.model_copy(update={side: half})
    second = whole.model_copy(update={place: getattr(whole, place) + half, side: getattr(whole, side) - half})
    windows = zip(eyes(panel), (first, second), strict=True)
    return tuple(eye.panel.model_copy(update={"window": window}) for eye, window in windows)


def _halved(pixels: tuple[int, int], stereo: Stereo) -> tuple[int, int]:
    """What one eye has of a panel's pixels."""
    return pixels[0] // (1 + (stereo == "side_by_side")), pixels[1] // (1 + (stereo == "top_bottom"))


def expanded_config(config: WallConfig) -> WallConfig:
    """The same wall, its panels one by one, each for one eye. It expands to the same panels with the same rays."""
    single = tuple(part for panel in _physical(config) for part in _alone(panel))
    return WallConfig(bezel=config.bezel, panels=single)


def wall_of(loaded: Loaded) -> Wall:
    """The wall of a configuration, without what its views show. Raises ConfigError for curved panels that no eye sees.

    Its panels are those of `expand`.
    """
    try:
        return expand(loaded.config.wall, seats(loaded.config.views))
    except SightError as error:
        path: YamlPath = ("views", 0) if error.panel is None else ("wall", "panels", error.panel)
        raise loaded.error(path, error.what, error.wanted) from None


def expand(config: WallConfig, seats: Sequence[Seat] = ()) -> Wall:
    """All panels with their positions, in the order of the file; a grid row by row from the top left.

    `seats`: from where curved panels are seen. Raises SightError where they are not.

    A panel whose image holds both eyes becomes two, ID.left and ID.right, with its corners.

    Gaps of a grid are rounded to whole pixels, so two neighbours are at most half a pixel nearer or farther
    than their bezels say; `corners` hold the rounded positions, and rays are exact for those. So are those of panels
    one by one, but that a panel within a hundredth of a pixel of the whole pixels of another's plane is put there.
    """
    skip, grid = config.bezel == "skip", config.grid
    drawn = raster(grid, skip=skip) if grid is not None else None
    panels: list[Panel] = []
    for k, physical in enumerate(_physical(config)):
        for eye in eyes(physical):
            surface = _surface(eye.panel)
            if surface is not None:
                plane = _flat_plane(surface, eye.panel, seats, k)
            else:
                plane = drawn.plane(*divmod(k, grid.columns)) if grid and drawn else _own_plane(eye.panel, skip=skip)
            panels.append(_panel(len(panels), eye, plane, surface, skip=skip))
    return place(panels, regular=grid is not None)


def _surface(config: PanelConfig) -> Surface | None:
    return None if config.surface is None else Surface(config=config.surface, pixels=config.pixels)


def _flat_plane(surface: Surface, config: PanelConfig, seats: Sequence[Seat], index: int) -> Plane:
    """The plane of a curved panel's flat image. Raises SightError."""
    if not seats and config.eye is None:
        raise SightError("the wall is not flat, so the eye's place is needed", "eye: [x, y, z] in metres")
    try:
        return flat_image(surface, eyes_before(config, SHIFTS.get(config.stereo, 0.0), seats))
    except SightError as error:
        raise SightError(error.what, error.wanted, index) from None


def _physical(config: WallConfig) -> tuple[PanelConfig, ...]:
    """The panels of the file, those of a grid written out."""
    return config.panels or () if config.grid is None else grid_panels(config.grid, skip=config.bezel == "skip")


def _own_plane(config: PanelConfig, *, skip: bool) -> Plane:
    """The plane of a panel's corners."""
    assert config.corners is not None
    corners = np.array([config.corners.lower_left, config.corners.lower_right, config.corners.upper_left])
    lower_left, lower_right, upper_left = widened(corners, config.bezel, 1.0) if skip else corners
    w, h = config.pixels
    return Plane(origin=upper_left, per_x=(lower_right - lower_left) / w, per_y=(lower_left - upper_left) / h)


def _panel(index: int, eye: Eye, plane: Plane, surface: Surface | None, *, skip: bool) -> Panel:
    config, blend = eye.panel, eye.panel.blend
    if blend == "auto":
        blend = BlendConfig(**config.overlap.model_dump())
    return Panel(
        config=config,
        id=config.id,
        index=index,
        pixels=config.pixels,
        plane=plane,
        shift=SHIFTS.get(config.stereo, 0.0),
        of=eye.of,
        at=eye.at,
        skip=skip and surface is None,
        surface=surface,
        blend=blend if isinstance(blend, BlendConfig) else None,
        scan=scan_of(config, eye.at),
    )
