"""`wall screenshot`: the whole wall, at any size, to a file, strip by strip: never more of it in memory than a few."""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from wall.commands.offline import Drawing, Piece, pieces, scaled, whole
from wall.commands.render import Progress
from wall.config.loading import Loaded
from wall.core.colour import srgb_decoded
from wall.core.data import Rect
from wall.core.errors import ConfigError
from wall.display.image_file import display_values
from wall.display.png import BEZEL_RGB, file_names
from wall.display.strip_file import STRIP_ROWS, check_file, is_linear, write_strips
from wall.geometry.panels import Panel, Plane
from wall.roles.plan import Layout, make_layout, make_plan
from wall.run.bootstrap import under_mpi
from wall.tracing.tracer_scene import make_tracer_scene

BAND_ROWS = 16  # rows of one piece of work
AHEAD = 2  # pieces of work for each thread that are begun before their turn

Strip: TypeAlias = NDArray[Any]  # (rows, width, 3): uint8 sRGB, or float32 linear


@dataclass(frozen=True, slots=True, kw_only=True)
class Shot:
    """What is asked for beside the file's name."""

    size: tuple[int, int] | None = None  # width and height, pixels; None: the wall's own, times `scale`
    scale: float = 1.0
    spp: int = 16
    seed: int = 1
    at: float = 0.0  # scene time, seconds
    panels: bool = False  # a file for each panel instead of one of the wall
    bezels: bool = False  # dark bezels; without, the scene goes on behind them


@dataclass(frozen=True, slots=True, kw_only=True)
class Written:
    path: Path
    width: int
    height: int


def screenshot(loaded: Loaded, path: Path, shot: Shot, progress: Progress) -> list[Written]:
    """Draw the wall, or each panel, and write it. Says what was written.

    Pixels are those of `wall render` at the same size, samples and seed. `progress` is told the rows that are done, and
    how many there are. Raises ConfigError, and RunError naming a file that cannot be written.
    """
    if under_mpi():
        raise ConfigError("wall screenshot uses the cores of one machine: start it without mpirun")
    layout = make_layout(loaded)
    pictures = _pictures(layout, path, shot)
    for name, panels in pictures:
        check_file(name, *_size(panels))
    plan = make_plan(layout)
    drawing = Drawing(plan, make_tracer_scene(plan.scene), spp=shot.spp, at=shot.at)
    rows, written = sum(_size(panels)[1] for _, panels in pictures), list[Written]()
    for name, panels in pictures:
        width, height = _size(panels)
        strips = drawn_strips(drawing, pieces(panels, seed=shot.seed), linear=is_linear(name))
        if shot.bezels and not shot.panels:
            strips = _with_bezels(strips, _lit(layout, panels, (width, height)), linear=is_linear(name))
        before = sum(done.height for done in written)
        write_strips(name, _counted(strips, progress, before, rows), width=width, height=height)
        written.append(Written(path=name, width=width, height=height))
    return written


def drawn_strips(drawing: Drawing, parts: list[Piece], *, linear: bool) -> Iterator[Strip]:
    """A picture's strips of STRIP_ROWS, top to bottom, black where no piece is; drawn by all cores, a little ahead."""
    width, height = max(p.rect.right for p in parts), max(p.rect.bottom for p in parts)
    starts = range(0, height, STRIP_ROWS)

    def draw(piece: Piece, rect: Rect) -> Strip:
        band = drawing.band(piece, rect)
        return band if linear else display_values(band)

    threads = len(os.sched_getaffinity(0))
    work = (band for y in starts for band in _bands(parts, y))
    with ThreadPoolExecutor(threads) as pool:
        drawn = _in_order(pool, draw, work, ahead=AHEAD * threads)
        for y in starts:
            strip = np.zeros((min(STRIP_ROWS, height - y), width, 3), np.float32 if linear else np.uint8)
            for piece, rect in _bands(parts, y):
                top, left = piece.rect.y + rect.y - y, piece.rect.x
                strip[top : top + rect.height, left : left + rect.width] = next(drawn)
            yield strip


def _bands(parts: list[Piece], y: int) -> Iterator[tuple[Piece, Rect]]:
    """What of each piece is in the strip that begins at row y, in bands of BAND_ROWS."""
    for piece in parts:
        first, end = max(0, y - piece.rect.y), min(piece.rect.height, y + STRIP_ROWS - piece.rect.y)
        for top in range(first, end, BAND_ROWS):
            yield piece, Rect(x=0, y=top, width=piece.rect.width, height=min(BAND_ROWS, end - top))


def _in_order(
    pool: ThreadPoolExecutor,
    draw: Callable[[Piece, Rect], Strip],
    work: Iterator[tuple[Piece, Rect]],
    *,
    ahead: int,
) -> Iterator[Strip]:
    """What comes of each piece of work in turn, at most `ahead` of them begun before they are asked for."""
    begun: deque[Future[Strip]] = deque(pool.submit(draw, *band) for band in islice(work, ahead))
    try:
        while begun:
            yield begun.popleft().result()
            begun.extend(pool.submit(draw, *band) for band in islice(work, 1))
    finally:
        for future in begun:
            future.cancel()


def _pictures(layout: Layout, path: Path, shot: Shot) -> list[tuple[Path, list[Panel]]]:
    """The files, and what is drawn in each."""
    if not shot.panels:
        return [(path, whole(layout, shot.size, scale=shot.scale))]
    if shot.size is not None:
        raise ConfigError("--panels and --size: a size is the whole wall's; wanted --scale")
    panels = [_alone(scaled(panel, shot.scale)) for panel in layout.wall.panels]
    names = file_names([panel.id for panel in panels], stem=path.stem, suffix=path.suffix)
    return [(path.with_name(name), [panel]) for name, panel in zip(names, panels, strict=True)]


def _alone(panel: Panel) -> Panel:
    """The panel at the top left corner of a screen of its own."""
    plane = Plane(origin=panel.plane.point(*panel.screen), per_x=panel.plane.per_x, per_y=panel.plane.per_y)
    return replace(panel, screen=(0, 0), plane=plane)


def _size(panels: list[Panel]) -> tuple[int, int]:
    return max(p.screen[0] + p.pixels[0] for p in panels), max(p.screen[1] + p.pixels[1] for p in panels)


def _lit(layout: Layout, panels: list[Panel], size: tuple[int, int]) -> list[Rect]:
    """Which pixels of the picture panels light: of one plane, or of the panels themselves."""
    lit = []
    for k, panel in enumerate(layout.wall.panels):
        plane = panels[k if len(panels) > 1 else 0].plane
        places = [(panel.lit - plane.origin) @ per / (per @ per) for per in (plane.per_x, plane.per_y)]
        (x0, x1), (y0, y1) = ((max(0, round(v.min())), round(v.max())) for v in places)
        lit.append(Rect(x=x0, y=y0, width=max(0, min(size[0], x1) - x0), height=max(0, min(size[1], y1) - y0)))
    return lit


def _with_bezels(strips: Iterator[Strip], lit: list[Rect], *, linear: bool) -> Iterator[Strip]:
    """The strips, dark outside of what is lit."""
    colour = srgb_decoded(np.array(BEZEL_RGB) / 255.0).astype(np.float32) if linear else np.array(BEZEL_RGB, np.uint8)
    y = 0
    for strip in strips:
        dark = np.ones(strip.shape[:2], np.bool_)
        for rect in lit:
            dark[max(0, rect.y - y) : max(0, rect.bottom - y), rect.x : rect.right] = False
        strip[dark] = colour
        yield strip
        y += len(strip)


def _counted(strips: Iterator[Strip], progress: Progress, before: int, rows: int) -> Iterator[Strip]:
    done = before
    for strip in strips:
        done += len(strip)
        progress(done, rows)
        yield strip
