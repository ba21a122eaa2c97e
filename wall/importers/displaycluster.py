"""DisplayCluster's configuration.xml, and the XML that Tide had before its JSON: `dimensions`, `process`, `screen`.

Tide renamed screenWidth to displayWidth, mullionWidth to bezelWidth, numTilesWidth to numScreensX.
"""

from __future__ import annotations

from wall.importers import xml_source
from wall.importers.panels import configuration, settle
from wall.importers.report import Conversion
from wall.importers.source import Node, Source
from wall.importers.tiles import Screen, Surface, drafts, every_screen, read_count, read_gap, read_screen

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
    screens = _screens(source, fullscreen=fullscreen) or every_screen(source, [surface])
    panels = drafts(source, [surface], screens)
    if len(panels) > len(source.root.children("process")) > 0:
        source.assume("A process draws all screens inside it; here every panel has a rank of its own.")
    settled, _ = settle(source, panels, None)
    return source.close(configuration(settled), panels=len(panels), ranks=len(panels))


def _surface(source: Source, node: Node) -> Surface:
    tide = node.get("displayWidth") is not None
    one = read_screen(source, node, ("displayWidth", "displayHeight") if tide else ("screenWidth", "screenHeight"))
    gap = tuple(
        read_gap(source, _either(node, f"bezel{side}", f"mullion{side}"), size)
        for side, size in zip(("Width", "Height"), one, strict=True)
    )
    count = (
        read_count(source, _either(node, "numScreensX", "numTilesWidth"), 1),
        read_count(source, _either(node, "numScreensY", "numTilesHeight"), 1),
    )
    each = (
        read_count(source, node.get("displaysPerScreenX"), 1),
        read_count(source, node.get("displaysPerScreenY"), 1),
    )
    screen = tuple(round(n * size + (n - 1) * between) for n, size, between in zip(each, one, gap, strict=True))
    surface = Surface(node=node, screen=(screen[0], screen[1]), count=count, gap=(gap[0], gap[1]))
    width, height = (source.number(node.get(key)) for key in ("physicalWidth", "physicalHeight"))
    if width is not None and height is not None and width > 0 and height > 0:
        surface.metres = (width, height)
        source.carry(node.get("physicalWidth"), "metres")
        source.carry(node.get("physicalHeight"), "metres")
    return surface


def _either(node: Node, first: str, second: str) -> Node | None:
    found = node.get(first)
    return found if found is not None else node.get(second)


def _screens(source: Source, *, fullscreen: bool) -> list[Screen]:
    found = []
    for process in source.root.children("process"):
        host, display = source.text(process.get("host")), source.text(process.get("display"))
        for key in ("host", "display"):
            source.carry(process.get(key), key)
        stereo = _stereo(source, process.get("stereo"))
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
                    place=read_place(source, screen, fullscreen=fullscreen),
                    stereo=stereo,
                )
            )
            for key in ("i", "j", "display"):
                source.carry(screen.get(key), "where the panel is")
    return found


def read_place(source: Source, screen: Node, *, fullscreen: bool) -> tuple[int, int] | None:
    """Where a screen's window is on its display, pixels; None where it is the whole display."""
    x, y = (source.whole(screen.get(key)) for key in ("x", "y"))
    for key in ("x", "y"):
        source.carry(screen.get(key), "window")
    if fullscreen and not x and not y:
        return None
    return x or 0, y or 0


def _stereo(source: Source, node: Node | None) -> str:
    if node is None:
        return "mono"
    kind = str(node.value).strip().lower()
    if kind not in ("mono", "left", "right", "side_by_side"):
        source.drop(node, "is not one of mono, left, right, side_by_side")
        return "mono"
    source.carry(node, "stereo")
    return kind
