"""Import DisplayCluster's configuration.xml, and Tide's earlier XML: `dimensions`, `process`, `screen`.

Tide renamed screenWidth to displayWidth, mullionWidth to bezelWidth, numTilesWidth to numScreensX.
"""

from __future__ import annotations

from wall.importers import xml_source
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

ROOT = "configuration"
AT_THE_HEAD = "the head runs, and serves its page, where the run is started"
CONTENT = "what is shown is the scene; documents and services of a desktop are not"
REASONS = {
    "masterProcess": AT_THE_HEAD,
    "webservice": AT_THE_HEAD,
    "background": "where no panel is, nothing is drawn",
    "bezelsPerScreenX": "frames inside a screen are part of its picture",
    "bezelsPerScreenY": "frames inside a screen are part of its picture",
} | dict.fromkeys(
    ("dock", "sessions", "launcher", "webbrowser", "whiteboard", "applauncher", "content", "planar"), CONTENT
)


def convert(text: str, name: str) -> Conversion:
    """The configuration of a DisplayCluster XML file. Raises NotThisFormat with name:line:column."""
    source = Source(name, xml_source.parse(text, name), REASONS)
    if source.root.key != ROOT:
        raise source.refuse(source.root, f"the first element is <{source.root.key}>", f"<{ROOT}>")
    dimensions = next(iter(source.root.children("dimensions")), None)
    if dimensions is None:
        raise source.refuse(source.root, "has no <dimensions>", "<dimensions screenWidth=... numTilesWidth=.../>")
    surface = _surface(source, dimensions)
    fullscreen = source.flag(dimensions.get("fullscreen")) or False
    source.carry(dimensions.get("fullscreen"), "windows")
    screens = _screens(source, fullscreen=fullscreen)
    return grid_conversion(source, [surface], screens, processes=len(source.root.children("process")))


def _surface(source: Source, node: Node) -> Surface:
    """The one surface of <dimensions>, whose keys have the names of either program."""
    tide = node.get("displayWidth") is not None
    surface = read_surface(
        source,
        node,
        display=("displayWidth", "displayHeight") if tide else ("screenWidth", "screenHeight"),
        gap=(_either(node, "bezelWidth", "mullionWidth"), _either(node, "bezelHeight", "mullionHeight")),
        count=(_either(node, "numScreensX", "numTilesWidth"), _either(node, "numScreensY", "numTilesHeight")),
    )
    width, height = (source.number(node.get(key)) for key in ("physicalWidth", "physicalHeight"))
    if width is not None and height is not None and width > 0 and height > 0:
        surface.metres = (width, height)
        source.carry(node.get("physicalWidth"), "metres")
        source.carry(node.get("physicalHeight"), "metres")
    return surface


def _either(node: Node, first: str, second: str) -> Node | None:
    """The member of the first name, else of the second."""
    found = node.get(first)
    return found if found is not None else node.get(second)


def _screens(source: Source, *, fullscreen: bool) -> list[Screen]:
    """The screens of all processes."""
    found = []
    for process in source.root.children("process"):
        host, display = source.text(process.get("host")), source.text(process.get("display"))
        for key in ("host", "display"):
            source.carry(process.get(key), key)
        stereo = read_stereo(source, process.get("stereo"))
        for screen in process.children("screen"):
            column, row = (source.whole(screen.get(key)) or 0 for key in ("i", "j"))
            found.append(
                Screen(
                    node=screen,
                    surface=0,
                    column=max(0, column),
                    row=max(0, row),
                    host=host,
                    display=source.text(screen.get("display")) or display,
                    window_position=read_window_position(source, screen, fullscreen=fullscreen),
                    stereo=stereo,
                )
            )
            for key in ("i", "j", "display"):
                source.carry(screen.get(key), "where the panel is")
    return found
