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
    panels_of,
    scaled,
    tiles_of,
)
from wall.commands.one_view import layout_of_view, plan_of_view
from wall.commands.render import Progress
from wall.commands.terminal import print_notes
from wall.config.loading import Loaded
from wall.core.colour import srgb_decoded
from wall.core.data import Rect
from wall.core.errors import ConfigError
from wall.core.mpi import under_mpi
from wall.display.image_file import display_values
from wall.display.png import BEZEL_RGB, file_names
from wall.display.strip_file import STRIP_ROWS, check_file, is_linear, write_strips
from wall.geometry.panels import Panel, Plane
from wall.roles.plan import Layout, make_layout, make_plan
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
    view: str | None = None  # only this one, as large as its place; None: the first, on all of the wall


@dataclass(frozen=True, slots=True, kw_only=True)
class Written:
    """A file that was written, and its size in pixels."""

    path: Path
    width: int
    height: int


def screenshot(loaded: Loaded, path: Path, shot: Shot, progress: Progress) -> list[Written]:
    """Render the wall, or each panel, and write it. Returns the files written.

    Pixels equal those of `wall render` at the same size, samples and seed. `progress` is told the finished rows and
    the number of all rows. Raises ConfigError, and RunError naming a file that cannot be written.
    """
    if under_mpi():
        raise ConfigError("wall screenshot uses the cores of one machine: start it without mpirun")
    layout = whole = make_layout(loaded)
    if shot.view is not None:
        layout = layout_of_view(whole, shot.view)
    files = _files(layout, path, shot)
    for name, panels in files:
        check_file(name, *image_size(panels))
    plan = make_plan(whole)
    if shot.view is not None:
        plan = plan_of_view(plan, shot.view)
    print_notes(plan)
    renderer = OfflineRenderer(plan, make_tracer_scene(plan.scene), event_at(plan, shot.at), spp=shot.spp)
    rows, written = sum(image_size(panels)[1] for _, panels in files), list[Written]()
    for name, panels in files:
        width, height = image_size(panels)
        strips = rendered_strips(renderer, tiles_of(panels, seed=shot.seed), linear=is_linear(name))
        if shot.bezels and not shot.panels:
            strips = _with_bezels(strips, _lit(layout, panels, (width, height)), linear=is_linear(name))
        before = sum(done.height for done in written)
        write_strips(name, _counted(strips, progress, before, rows), width=width, height=height)
        written.append(Written(path=name, width=width, height=height))
    return written


def rendered_strips(renderer: OfflineRenderer, tiles: list[Tile], *, linear: bool) -> Iterator[Image]:
    """Yield an image's strips of STRIP_ROWS, top to bottom, rendered by all cores; pixels of no tile are black."""
    width, height = image_size(tile.panel for tile in tiles)
    starts = range(0, height, STRIP_ROWS)
    work = (band for y in starts for band in _bands(tiles, y))
    bands = renderer.bands(
        work, (lambda band: band) if linear else partial(display_values, tone=renderer.event.tone)
    )
    for y in starts:
        strip = np.zeros((min(STRIP_ROWS, height - y), width, 3), np.float32 if linear else np.uint8)
        for tile, rect in _bands(tiles, y):
            top, left = tile.rect.y + rect.y - y, tile.rect.x
            strip[top : top + rect.height, left : left + rect.width] = next(bands)
        yield strip


def _bands(tiles: list[Tile], y: int) -> Iterator[Band]:
    """The bands of all tiles in the strip that begins at row y of the image."""
    return (band for tile in tiles for band in bands_of(tile, y - tile.rect.y, y + STRIP_ROWS - tile.rect.y))


def _files(layout: Layout, path: Path, shot: Shot) -> list[tuple[Path, list[Panel]]]:
    """The files to write, and the panels that each shows."""
    if not shot.panels:
        return [(path, panels_of(layout, shot.size, scale=shot.scale))]
    if shot.size is not None:
        raise ConfigError("--panels and --size: a size is the whole wall's; wanted --scale")
    panels = [_alone(scaled(panel, shot.scale)) for panel in layout.wall.panels]
    names = file_names([panel.id for panel in panels], stem=path.stem, suffix=path.suffix)
    return [(path.with_name(name), [panel]) for name, panel in zip(names, panels, strict=True)]


def _alone(panel: Panel) -> Panel:
    """The panel moved to the top left corner of its own image."""
    plane = Plane(origin=panel.plane.point(*panel.screen), per_x=panel.plane.per_x, per_y=panel.plane.per_y)
    return replace(panel, screen=(0, 0), plane=plane)


def _lit(layout: Layout, panels: list[Panel], size: tuple[int, int]) -> list[Rect]:
    """The pixels of the image that panels light, a rectangle a panel."""
    lit = []
    for k, panel in enumerate(layout.wall.panels):
        plane = panels[k if len(panels) > 1 else 0].plane
        corners = [(panel.lit - plane.origin) @ per / (per @ per) for per in (plane.per_x, plane.per_y)]
        (x0, x1), (y0, y1) = ((max(0, round(v.min())), round(v.max())) for v in corners)
        lit.append(Rect(x=x0, y=y0, width=max(0, min(size[0], x1) - x0), height=max(0, min(size[1], y1) - y0)))
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
