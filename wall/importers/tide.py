"""Import Tide's configuration.json: `surfaces` of equal screens, `processes` with the screens they draw.

Keys and defaults after tide/core/json/serialization.cpp and SurfaceConfig: a count that is absent is 1; a
screen is displaysPerScreen displays with the bezels between them; `dimensions` are the surface's metres.
"""

from __future__ import annotations

from wall.importers import json_source
from wall.importers.displaycluster import AT_THE_HEAD, CONTENT
from wall.importers.report import Conversion
from wall.importers.screen_grids import (
    Screen,
    Surface,
    grid_conversion,
    read_stereo,
    read_surface,
    read_window_position,
)
from wall.importers.source import Node, Source

REASONS = {
    "master": AT_THE_HEAD,
    "background": "where no panel is, nothing is drawn",
    "global": "swap locks of the graphics driver: nothing waits for a frame here",
} | dict.fromkeys(("folders", "launcher", "settings", "webbrowser", "whiteboard"), CONTENT)


def convert(text: str, name: str) -> Conversion:
    """The configuration of a Tide JSON file. Raises NotThisFormat with name:line:column."""
    source = Source(name, json_source.parse(text, name), REASONS)
    given = source.root.get("surfaces")
    if given is None or not given.items:
        raise source.refuse(given or source.root, "has no surfaces", 'surfaces: [{"displayWidth": ..., ...}]')
    surfaces = [_surface(source, node) for node in given.items]
    processes = source.root.get("processes")
    count = 0 if processes is None else len(processes.items)
    return grid_conversion(source, surfaces, _screens(source), processes=count)


def _surface(source: Source, node: Node) -> Surface:
    """One entry of `surfaces`. Raises NotThisFormat where its pixels are missing."""
    if node.kind != "object":
        raise source.refuse(node, "is not an object", '{"displayWidth": ..., "displayHeight": ...}')
    surface = read_surface(
        source,
        node,
        display=("displayWidth", "displayHeight"),
        gap=(node.get("bezelWidth"), node.get("bezelHeight")),
        count=(
            node.get("screenCountX") or node.get("numScreensX"),
            node.get("screenCountY") or node.get("numScreensY"),
        ),
    )
    surface.metres = _metres(source, node.get("dimensions"))
    return surface


def _metres(source: Source, node: Node | None) -> tuple[float, float] | None:
    """The surface's size: [width, height] or {width, height}; 0 x 0 is Tide's way to say that it is not known."""
    if node is None:
        return None
    parts = node.items if node.kind == "list" else [node.fields[k] for k in ("width", "height") if k in node.fields]
    sizes = [source.number(part) for part in parts]
    if len(sizes) != 2 or sizes[0] is None or sizes[1] is None or min(sizes[0], sizes[1]) <= 0:
        source.drop(node, "is not the surface's width and height in metres")
        return None
    source.carry(node, "metres")
    return sizes[0], sizes[1]


def _screens(source: Source) -> list[Screen]:
    """The screens of all processes."""
    found = []
    processes = source.root.get("processes")
    for process in processes.items if processes is not None else []:
        host = source.text(process.get("host"))
        source.carry(process.get("host"), "host")
        screens = process.get("screens")
        for node in screens.items if screens is not None else []:
            found.append(_screen(source, node, host))
    return found


def _screen(source: Source, node: Node, host: str | None) -> Screen:
    """One screen of a process that runs on `host`."""
    surface, column, row = (source.whole(node.get(key)) or 0 for key in ("surface", "i", "j"))
    fullscreen = source.flag(node.get("fullscreen")) or False
    screen = Screen(
        node=node,
        surface=surface,
        column=max(0, column),
        row=max(0, row),
        host=host,
        display=source.text(node.get("display")),
        window_position=read_window_position(source, node, fullscreen=fullscreen),
        stereo=read_stereo(source, node.get("stereo")),
    )
    for key in ("surface", "i", "j", "display", "fullscreen"):
        source.carry(node.get(key), "where the panel is" if key in "surface ij" else key)
    return screen
