"""`wall identify`: test patterns in every panel's window, or in files: which panel is which, is all as configured?"""

from __future__ import annotations

import socket
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from wall.config.loading import Loaded
from wall.core.errors import ConfigError
from wall.display.base import PanelPicture
from wall.display.patterns import KINDS, Kind, pattern
from wall.display.png import BEZEL_RGB, file_names, make_folder, write_png
from wall.display.strip_file import STRIP_ROWS, write_strips
from wall.display.window import WindowSink
from wall.geometry.panels import Panel, Wall
from wall.roles.plan import Layout, make_layout

GLANCE_S = 0.1  # how often it is seen that Escape was pressed
SHOWN_S = 20.0  # for all windows to show their pattern


def kind_of(name: str) -> Kind:
    """The pattern of that name. Raises ConfigError with those that there are."""
    for kind in KINDS:
        if kind == name:
            return kind
    raise ConfigError(f"--pattern {name}: no such pattern; accepted: {', '.join(KINDS)}")


def write_patterns(loaded: Loaded, kind: Kind, folder: Path) -> list[Path]:
    """Write panel-ID.png for every panel, and wall.png, the whole wall with its bezels. Returns their paths."""
    layout = make_layout(loaded)
    make_folder(folder)
    wall, names = layout.wall, file_names([panel.id for panel in layout.wall.panels])

    def written(panel: Panel) -> NDArray[np.uint8]:
        picture = _picture(layout, kind, panel)
        write_png(folder / names[panel.index], picture)
        return picture

    write_strips(folder / "wall.png", whole_wall_strips(wall, written), width=wall.width, height=wall.height)
    return [folder / name for name in (*names, "wall.png")]


def show_patterns(loaded: Loaded, kind: Kind, *, seconds: float | None, say: Callable[[str], None]) -> str:
    """Show the pattern in a window on each panel of this machine, until time is up or Escape is pressed.

    Returns why it ended; Ctrl-C is as good as Escape.

    Raises ConfigError if no panel hangs here, RunError if a window cannot be opened.
    """
    layout = make_layout(loaded)
    mine = [panel for panel in layout.wall.panels if _is_here(panel.host)]
    elsewhere = sorted({panel.host for panel in layout.wall.panels if panel.host and panel not in mine})
    if not mine:
        hosts = ", ".join(elsewhere)
        raise ConfigError(f"{loaded.path}: no panel hangs on {socket.gethostname()}; run this on {hosts}, or give -o")
    sink = WindowSink(mine, refresh_hz=layout.config.views[0].refresh_hz)
    try:
        sink.put([PanelPicture(id=p.id, rgb=_picture(layout, kind, p), screen=p.screen, version=1) for p in mine])
        sink.settled(SHOWN_S)
        for note in (*sink.notes, *(f"panels of {host} are shown by the same command there" for host in elsewhere)):
            say(note)
        say(f"showing '{kind}' on {len(mine)} panel{'s' * (len(mine) > 1)}; Escape in a window, or Ctrl-C, ends it")
        limit = None if seconds is None else time.monotonic() + seconds
        while not sink.finished:
            if limit is not None and time.monotonic() >= limit:
                return "time is up"
            time.sleep(GLANCE_S)
        return sink.finished
    except KeyboardInterrupt:
        return "interrupted"
    finally:
        sink.close()


def whole_wall_strips(wall: Wall, picture_of: Callable[[Panel], NDArray[np.uint8]]) -> Iterator[NDArray[np.uint8]]:
    """The whole wall in strips of STRIP_ROWS; a panel's picture is made at its first strip, forgotten at its last."""
    made: dict[int, NDArray[np.uint8]] = {}
    for y in range(0, wall.height, STRIP_ROWS):
        strip = np.empty((min(STRIP_ROWS, wall.height - y), wall.width, 3), np.uint8)
        strip[:] = BEZEL_RGB
        for panel in wall.panels:
            (left, above), (width, height) = panel.screen, panel.pixels
            top, end = max(y, above), min(y + len(strip), above + height)
            if top >= end:
                continue
            if panel.index not in made:
                made[panel.index] = picture_of(panel)
            strip[top - y : end - y, left : left + width] = made[panel.index][top - above : end - above]
            if end == above + height:
                del made[panel.index]
        yield strip


def _picture(layout: Layout, kind: Kind, panel: Panel) -> NDArray[np.uint8]:
    return pattern(kind, panel, layout.wall, about(layout, panel))


def about(layout: Layout, panel: Panel) -> list[tuple[str, str]]:
    """What the configuration says of a panel beside its geometry, as rows of a name and a text."""
    ranks = [rank for rank in layout.renderers() if layout.layer(rank).panel == panel.index]
    compositors = sorted({layer.compositor for layer in layout.graph.layers if layer.panel == panel.index})
    where = [panel.display or "DISPLAY"]
    if panel.monitor is not None:
        where.append(f"monitor {panel.monitor}")
    if panel.window is not None:
        where.append(f"{panel.window.width} x {panel.window.height} at {panel.window.x}, {panel.window.y}")
    return [
        ("host", panel.host or "any"),
        ("rendered by", f"rank{'s' * (len(ranks) > 1)} {_listed(ranks)}" if ranks else "no rank"),
        ("put together by", f"rank{'s' * (len(compositors) > 1)} {_listed(compositors)}" if compositors else "nobody"),
        ("display", ", ".join(where)),
    ]


def _listed(numbers: list[int]) -> str:
    """4-7, 9"""
    runs: list[list[int]] = []
    for number in numbers:
        if runs and number == runs[-1][-1] + 1:
            runs[-1].append(number)
        else:
            runs.append([number])
    return ", ".join(f"{run[0]}-{run[-1]}" if len(run) > 1 else str(run[0]) for run in runs)


def _is_here(host: str | None) -> bool:
    own = socket.gethostname()
    return host is None or host in ("localhost", own, own.partition(".")[0])
