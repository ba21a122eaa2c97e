"""`wall identify`: show test patterns in every panel's window, or write them to files, to check a wall's setup."""

from __future__ import annotations

import socket
import time
from collections.abc import Callable
from pathlib import Path

from wall.config.loading import Loaded
from wall.core.errors import ConfigError
from wall.display.base import PanelImage, WallImage
from wall.display.patterns import KINDS, Kind, pattern
from wall.display.png import make_folder, write_images
from wall.display.window import WindowSink
from wall.geometry.panels import Panel
from wall.roles.plan import Layout, make_layout

POLL_S = 0.1  # seconds between looks whether Escape was pressed
SHOWN_S = 20.0  # seconds that all windows have to show their pattern


def kind_of(name: str) -> Kind:
    """The pattern of that name. Raises ConfigError that lists the patterns."""
    for kind in KINDS:
        if kind == name:
            return kind
    raise ConfigError(f"--pattern {name}: no such pattern; accepted: {', '.join(KINDS)}")


def write_patterns(loaded: Loaded, kind: Kind, folder: Path) -> list[Path]:
    """Write panel-ID.png for every panel, and wall.png, the whole wall with its bezels. Returns their paths."""
    layout = make_layout(loaded)
    make_folder(folder)
    panels = tuple(_image(layout, kind, panel) for panel in layout.wall.panels)
    width, height = layout.wall.width, layout.wall.height
    image = WallImage(width=width, height=height, panels=panels, time=0.0, camera_event=0, scene_event=0)
    return write_images(folder, image)


def show_patterns(loaded: Loaded, kind: Kind, *, seconds: float | None, say: Callable[[str], None]) -> str:
    """Show the pattern in a window on each panel of this machine, until time is up or Escape is pressed.

    Returns the reason for the end; Ctrl-C ends it as Escape does. Raises ConfigError if no panel belongs to this
    machine, RunError if a window cannot be opened.
    """
    layout = make_layout(loaded)
    mine = [panel for panel in layout.wall.panels if _is_here(panel.config.host)]
    elsewhere = sorted({panel.config.host for panel in layout.wall.panels if panel.config.host and panel not in mine})
    if not mine:
        hosts = ", ".join(elsewhere)
        raise ConfigError(f"{loaded.path}: no panel hangs on {socket.gethostname()}; run this on {hosts}, or give -o")
    sink = WindowSink(mine, refresh_hz=layout.config.views[0].refresh_hz)
    try:
        sink.put([_image(layout, kind, panel) for panel in mine])
        sink.settled(SHOWN_S)
        for note in (*sink.notes, *(f"panels of {host} are shown by the same command there" for host in elsewhere)):
            say(note)
        say(f"showing '{kind}' on {len(mine)} panel{'s' * (len(mine) > 1)}; Escape in a window, or Ctrl-C, ends it")
        limit = None if seconds is None else time.monotonic() + seconds
        while not sink.finished:
            if limit is not None and time.monotonic() >= limit:
                return "time is up"
            time.sleep(POLL_S)
        return sink.finished
    except KeyboardInterrupt:
        return "interrupted"
    finally:
        sink.close()


def _image(layout: Layout, kind: Kind, panel: Panel) -> PanelImage:
    """A panel's test pattern with what the configuration says of it."""
    rgb = pattern(kind, panel, layout.wall, about(layout, panel))
    return PanelImage(id=panel.id, rgb=rgb, screen=panel.screen, version=1, span=panel.span)


def about(layout: Layout, panel: Panel) -> list[tuple[str, str]]:
    """A panel's host, ranks and display in the configuration, as rows of a name and a text."""
    on_panel = {v.index for v in layout.wall.viewports if v.on_panel == panel.index}
    ranks = [rank for rank in layout.renderers() if layout.region(rank).panel in on_panel]
    compositors = sorted({layer.compositor for layer in layout.graph.layers if layer.panel == panel.index})
    where = [panel.config.display or "DISPLAY"]
    if panel.config.monitor is not None:
        where.append(f"monitor {panel.config.monitor}")
    if (window := panel.config.window) is not None:
        where.append(f"{window.width} x {window.height} at {window.x}, {window.y}")
    return [
        ("host", panel.config.host or "any"),
        ("rendered by", f"rank{'s' * (len(ranks) > 1)} {_listed(ranks)}" if ranks else "no rank"),
        ("put together by", f"rank{'s' * (len(compositors) > 1)} {_listed(compositors)}" if compositors else "nobody"),
        ("display", ", ".join(where)),
    ]


def _listed(numbers: list[int]) -> str:
    """Numbers in order with runs shortened: 4-7, 9."""
    runs: list[list[int]] = []
    for number in numbers:
        if runs and number == runs[-1][-1] + 1:
            runs[-1].append(number)
        else:
            runs.append([number])
    return ", ".join(f"{run[0]}-{run[-1]}" if len(run) > 1 else str(run[0]) for run in runs)


def _is_here(host: str | None) -> bool:
    """Whether a panel's host is this machine, or none is given."""
    own = socket.gethostname()
    return host is None or host in ("localhost", own, own.partition(".")[0])
