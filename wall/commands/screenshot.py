"""`wall screenshot`: write the whole wall at any size to a file, strip by strip, with only a few strips in memory."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from wall.commands.offline import (
    Band,
    Image,
    OfflineRenderer,
    Tile,
    bands_of,
    event_at,
    image_size,
    scaled,
    tiles_of,
)
from wall.commands.one_view import layout_of_view, plan_of_view, plans_of_views
from wall.commands.render import Progress
from wall.commands.terminal import print_notes
from wall.commands.whole_image import panels_of_views
from wall.config.loading import Loaded
from wall.core.colour import srgb_decoded
from wall.core.data import Rect
from wall.core.errors import ConfigError
from wall.core.mpi import under_mpi
from wall.display.image_file import display_values
from wall.display.png import BEZEL_RGB, file_names
from wall.display.strip_file import STRIP_ROWS, check_file, is_linear, write_strips
from wall.geometry.panels import NO_VIEW, Panel, Plane
from wall.roles.plan import Layout, Plan, make_layout, make_plan
from wall.tracing.tracer_scene import make_tracer_scene


@dataclass(frozen=True, slots=True, kw_only=True)
class Shot:
    """The options of a screenshot beside its file name."""

    size: tuple[int, int] | None = None  # width and height, pixels; None: the wall's own, times `scale`
    scale: float = 1.0
    spp: int = 16  # samples a pixel
    seed: int = 1
    at: float = 0.0  # scene time, seconds
    panels: bool = False  # a file for each panel instead of one of the wall
    bezels: bool = False  # dark bezels; without, the scene continues behind them
    view: str | None = None  # only this one, as large as its place; None: all, in their places


@dataclass(frozen=True, slots=True, kw_only=True)
class Written:
    """A file that was written, and its size in pixels."""

    path: Path
    width: int
    height: int


@dataclass(frozen=True, slots=True, kw_only=True)
class _File:
    """A file to write, its size in pixels, and the tiles of each view, later ones in front."""

    path: Path
    width: int
    height: int
    views: list[tuple[int, list[Tile]]]


def screenshot(loaded: Loaded, path: Path, shot: Shot, progress: Progress) -> list[Written]:
    """Render the wall, or each panel, and write it. Returns the files written.

    Views are in their places. Pixels of one equal those of `wall render` at the same size, samples and seed.
    `progress` is told the finished rows and the number of all rows. Raises ConfigError, and RunError naming a file
    that cannot be written.
    """
    if under_mpi():
        raise ConfigError("wall screenshot uses the cores of one machine: start it without mpirun")
    layout = whole = make_layout(loaded)
    if shot.view is not None:
        layout = layout_of_view(whole, shot.view)
    files = _files(layout, path, shot)
    for file in files:
        check_file(file.path, file.width, file.height)
    plan = make_plan(whole)
    plan = plan if shot.view is None else plan_of_view(plan, shot.view)
    print_notes(plan)
    renderers = _renderers(plan, shot)
    rows, written = sum(file.height for file in files), list[Written]()
    for file in files:
        parts = [
            rendered_strips(renderers[view], tiles, linear=is_linear(file.path), size=(file.width, file.height))
            for view, tiles in file.views
        ]
        strips = parts[0] if len(parts) == 1 else _together(parts, [tiles for _, tiles in file.views])
        if shot.bezels and not shot.panels:
            strips = _with_bezels(strips, _lit(layout, file), linear=is_linear(file.path))
        before = sum(done.height for done in written)
        write_strips(file.path, _counted(strips, progress, before, rows), width=file.width, height=file.height)
        written.append(Written(path=file.path, width=file.width, height=file.height))
    return written


def _renderers(plan: Plan, shot: Shot) -> list[OfflineRenderer]:
    """One for each view of the plan, under its own camera, exposure and integrator."""
    tracer_scene = make_tracer_scene(plan.scene)
    return [
        OfflineRenderer(own, tracer_scene.under(own.scene), event_at(own, shot.at), spp=shot.spp)
        for own in plans_of_views(plan)
    ]


def _together(parts: list[Iterator[Image]], tiles: list[list[Tile]]) -> Iterator[Image]:
    """Strips of one image from those of its views, each with its own places; later views are in front."""
    y = 0
    for strips in zip(*parts, strict=True):
        whole = strips[0]
        for strip, own in zip(strips[1:], tiles[1:], strict=True):
            for rect in (tile.rect for tile in own):
                rows, columns = slice(max(0, rect.y - y), max(0, rect.bottom - y)), slice(rect.x, rect.right)
                whole[rows, columns] = strip[rows, columns]
        yield whole
        y += len(whole)


def rendered_strips(
    renderer: OfflineRenderer, tiles: list[Tile], *, linear: bool, size: tuple[int, int]
) -> Iterator[Image]:
    """Yield an image's strips of STRIP_ROWS, top to bottom, rendered by all cores; pixels of no tile are black."""
    width, height = size
    starts = range(0, height, STRIP_ROWS)
    work = (band for y in starts for band in _bands(tiles, y))
    bands = renderer.bands(work, (lambda band: band) if linear else partial(display_values, tone=renderer.event.tone))
    for y in starts:
        strip = np.zeros((min(STRIP_ROWS, height - y), width, 3), np.float32 if linear else np.uint8)
        for tile, rect in _bands(tiles, y):
            top, left = tile.rect.y + rect.y - y, tile.rect.x
            strip[top : top + rect.height, left : left + rect.width] = next(bands)
        yield strip


def _bands(tiles: list[Tile], y: int) -> Iterator[Band]:
    """The bands of all tiles in the strip that begins at row y of the image."""
    return (band for tile in tiles for band in bands_of(tile, y - tile.rect.y, y + STRIP_ROWS - tile.rect.y))


def _files(layout: Layout, path: Path, shot: Shot) -> list[_File]:
    """The files to write, and what each shows of which view."""
    if shot.panels and shot.size is not None:
        raise ConfigError("--panels and --size: a size is the whole wall's; wanted --scale")
    if shot.panels:
        names = file_names([panel.id for panel in layout.wall.panels], stem=path.stem, suffix=path.suffix)
        files = zip(names, layout.wall.panels, strict=True)
        return [_file(path.with_name(name), _on_panel(layout, panel, shot.scale), shot) for name, panel in files]
    return [_file(path, panels_of_views(layout, shot.size, scale=shot.scale), shot)]


def _file(path: Path, views: dict[int, list[Panel]], shot: Shot) -> _File:
    width, height = image_size(panel for panels in views.values() for panel in panels)
    tiles = [(view, tiles_of(panels, seed=shot.seed)) for view, panels in views.items()]
    return _File(path=path, width=width, height=height, views=tiles)


def _on_panel(layout: Layout, panel: Panel, scale: float) -> dict[int, list[Panel]]:
    """What a panel shows by views, moved to the top left corner of an image of its own."""
    insets = [inset for inset in layout.wall.insets if inset.inset_of == panel.index]
    shown = [each for each in (panel, *insets) if each.view != NO_VIEW]
    alone = len(layout.config.views) == 1
    return {0 if alone else each.view: [_moved(scaled(each, scale), scaled(panel, scale).screen)] for each in shown}


def _moved(panel: Panel, origin: tuple[int, int]) -> Panel:
    """The panel in an image that begins at `origin`."""
    plane = Plane(origin=panel.plane.point(*origin), per_x=panel.plane.per_x, per_y=panel.plane.per_y)
    return replace(panel, screen=(panel.screen[0] - origin[0], panel.screen[1] - origin[1]), plane=plane)


def _lit(layout: Layout, file: _File) -> list[Rect]:
    """The pixels of the image that panels light, a rectangle a panel."""
    tiles = {tile.panel.index: tile.panel for _, tiles in reversed(file.views) for tile in reversed(tiles)}
    whole = {view: own[0].panel for view, own in file.views}  # a view's panels may be drawn as one
    lit = []
    for panel in layout.wall.panels:
        inset = next((each for each in layout.wall.insets if each.inset_of == panel.index), panel)
        shown = tiles.get(panel.index) or whole.get(panel.view) or whole.get(inset.view) or file.views[0][1][0].panel
        plane = shown.plane
        corners = [(panel.lit - plane.origin) @ per / (per @ per) for per in (plane.per_x, plane.per_y)]
        (x0, x1), (y0, y1) = ((max(0, round(v.min())), round(v.max())) for v in corners)
        x1, y1 = min(file.width, x1), min(file.height, y1)
        lit.append(Rect(x=x0, y=y0, width=max(0, x1 - x0), height=max(0, y1 - y0)))
    return lit


def _with_bezels(strips: Iterator[Image], lit: list[Rect], *, linear: bool) -> Iterator[Image]:
    """Darken each strip outside the lit rectangles."""
    colour = srgb_decoded(np.array(BEZEL_RGB) / 255.0).astype(np.float32) if linear else np.array(BEZEL_RGB, np.uint8)
    y = 0
    for strip in strips:
        dark = np.ones(strip.shape[:2], np.bool_)
        for rect in lit:
            dark[max(0, rect.y - y) : max(0, rect.bottom - y), rect.x : rect.right] = False
        strip[dark] = colour
        yield strip
        y += len(strip)


def _counted(strips: Iterator[Image], progress: Progress, before: int, rows: int) -> Iterator[Image]:
    """Report each strip's rows to `progress`; `before` rows were done by earlier files."""
    done = before
    for strip in strips:
        done += len(strip)
        progress(done, rows)
        yield strip
