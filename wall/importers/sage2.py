"""Import SAGE2's server configuration (JSON5): `resolution` and `dimensions` of a tile, `layout`, `displays`.

Fields after the project's wiki page Configuration. `tile_borders` came in two shapes, [left, right, bottom,
top] and an object; other keys are read in either too. A display is one browser window over width x height
tiles, whose pixels ignore the bezels between them.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from wall.config.screens import MAX_PANELS
from wall.core.data import Float64
from wall.importers import json_source
from wall.importers.panels import METRES_A_PIXEL, SMALLEST_M, WIDEST_BEZEL_M, Draft, configuration, fit_panels, upright
from wall.importers.report import Conversion
from wall.importers.source import Node, Source

BORDERS = ("left", "right", "bottom", "top")
SERVER = "the server of SAGE2; the head runs, and serves its page, where the run is started"
DESKTOP = "what is shown is the scene; SAGE2's desktop, services and applications are not"
REASONS = dict.fromkeys(
    ("host", "port", "index_port", "secure_port", "rproxy_port", "rproxy_secure_port", "url", "alternate_hosts"), SERVER
) | dict.fromkeys(
    ("ui", "audio", "apis", "apps", "remote_sites", "dependencies", "experimental", "voice_commands", "register_site"),
    DESKTOP,
)
REASONS["name"] = "says what the site is called"
REASONS["background"] = "where no panel is, nothing is drawn"


@dataclass(slots=True, kw_only=True)
class Tile:
    """One physical display: pixels, metres, and its bezel."""

    pixels: tuple[int, int]
    metres: tuple[float, float]
    bezel: dict[str, float]

    @property
    def pitch(self) -> tuple[float, float]:
        """Distance from one tile to the next, metres, across and down."""
        return (
            self.metres[0] + self.bezel.get("left", 0.0) + self.bezel.get("right", 0.0),
            self.metres[1] + self.bezel.get("top", 0.0) + self.bezel.get("bottom", 0.0),
        )


def convert(text: str, name: str) -> Conversion:
    """The configuration of a SAGE2 server's file. Raises NotThisFormat with name:line:column."""
    source = Source(name, json_source.parse(text, name), REASONS)
    tile = _tile(source)
    rows, columns = _layout(source)
    displays = _displays(source)
    if not displays:
        if rows * columns > MAX_PANELS:
            raise source.refuse(source.root, f"has {rows} x {columns} tiles", f"at most {MAX_PANELS}")
        cells = [(source.root, row, column, 1, 1) for row in range(rows) for column in range(columns)]
    else:
        cells = [_cell(source, node) for node in displays]
        rows = max(rows, *(row + high for _, row, _, _, high in cells))
        columns = max(columns, *(column + wide for _, _, column, wide, _ in cells))
    drafts = [_draft(source, tile, cell, rows=rows, columns=columns) for cell in cells]
    eye = _eye(source)
    source.assume("Every display is shown by this machine: SAGE2 does not say which one a display hangs on.")
    panels, eye = fit_panels(source, drafts, eye)
    return source.close(configuration(panels, eye=eye), panels=len(drafts), ranks=len(drafts))


def _pair(source: Source, key: str, names: tuple[str, str]) -> tuple[Node | None, Node | None]:
    """Two members of an object, or the two items of a list, under a top-level key."""
    node = source.root.get(key)
    if node is None:
        return None, None
    if node.kind == "list" and len(node.items) == 2:
        return node.items[0], node.items[1]
    return node.get(names[0]), node.get(names[1])


def _tile(source: Source) -> Tile:
    """The tile that all displays consist of. Raises NotThisFormat where its pixels are missing."""
    resolution = source.root.get("resolution")
    if resolution is None:
        raise source.refuse(source.root, "has no resolution", "resolution: {width: ..., height: ...}")
    sizes = _pair(source, "resolution", ("width", "height"))
    found = [source.whole(node) for node in sizes]
    if found[0] is None or found[1] is None or min(found[0], found[1]) < 1:
        raise source.refuse(resolution, "is not a tile's width and height", "{width: 1920, height: 1080}")
    for node in sizes:
        source.carry(node, "pixels")
    pixels = found[0], found[1]
    return Tile(pixels=pixels, metres=_metres(source, pixels), bezel=_bezel(source))


def _metres(source: Source, pixels: tuple[int, int]) -> tuple[float, float]:
    """A tile's width and height, metres; with square pixels where the file gives less than both."""
    dimensions = source.root.get("dimensions")
    nodes = [dimensions.get(key) if dimensions is not None else None for key in ("tile_width", "tile_height")]
    width, height = (source.number(node) for node in nodes)
    usable = [value if value is not None and value >= SMALLEST_M else None for value in (width, height)]
    for node, value in zip(nodes, usable, strict=True):
        if value is not None:
            source.carry(node, "metres")
    if usable[0] is None and usable[1] is None:
        source.assume("The file gives pixels and no metres: 0.25 mm a pixel is assumed.")
        return pixels[0] * METRES_A_PIXEL, pixels[1] * METRES_A_PIXEL
    if usable[0] is None or usable[1] is None:
        source.assume("The file gives one side of a tile in metres: square pixels are assumed.")
    across = usable[0] if usable[0] is not None else (usable[1] or 0.0) * pixels[0] / pixels[1]
    return across, usable[1] if usable[1] is not None else across * pixels[1] / pixels[0]


def _bezel(source: Source) -> dict[str, float]:
    """The bezel of a tile, metres, from either shape of tile_borders."""
    dimensions = source.root.get("dimensions")
    node = dimensions.get("tile_borders") if dimensions is not None else None
    if node is None:
        return {}
    parts = dict(zip(BORDERS, node.items, strict=False)) if node.kind == "list" else node.fields
    found = {}
    for side in BORDERS:
        width = source.number(parts.get(side))
        if width is not None and 0 <= width <= WIDEST_BEZEL_M:
            found[side] = width
            source.carry(parts[side], f"bezel.{side}")
    return found


def _layout(source: Source) -> tuple[int, int]:
    """Rows and columns of tiles; 1 each where the file does not say."""
    counts = []
    for node in _pair(source, "layout", ("rows", "columns")):
        count = source.whole(node)
        if node is not None and count is not None and not 1 <= count <= MAX_PANELS:
            raise source.refuse(node, f"is {count}", f"1 to {MAX_PANELS}")
        source.carry(node, "where the panels stand")
        counts.append(count or 1)
    return counts[0], counts[1]


def _displays(source: Source) -> list[Node]:
    """The displays: items of a list, members of an object, or the object itself."""
    node = source.root.get("displays")
    if node is None:
        return []
    if node.kind == "list":
        return node.items
    if any(key in node.fields for key in ("row", "column", "width", "height")):
        return [node]
    return [inner for inner in node.fields.values() if inner.kind == "object"]


def _cell(source: Source, node: Node) -> tuple[Node, int, int, int, int]:
    """A display with its row, column, width and height in tiles."""
    found = []
    for key, otherwise, least in (("row", 0, 0), ("column", 0, 0), ("width", 1, 1), ("height", 1, 1)):
        inner = node.get(key)
        value = source.whole(inner)
        if inner is not None and value is not None and not least <= value <= MAX_PANELS:
            source.drop(inner, f"is not a place in the layout: {otherwise} instead")
            value = None
        source.carry(inner, "where the panel is")
        found.append(otherwise if value is None else value)
    return node, found[0], found[1], found[2], found[3]


def _draft(source: Source, tile: Tile, cell: tuple[Node, int, int, int, int], *, rows: int, columns: int) -> Draft:
    """The panel of a display; the layout's middle is the origin of the wall's frame."""
    node, row, column, wide, high = cell
    (px, py), bezel = tile.pitch, tile.bezel
    width, height = wide * px - (px - tile.metres[0]), high * py - (py - tile.metres[1])
    x = column * px + bezel.get("left", 0.0) - columns * px / 2
    y = rows * py / 2 - (row + high) * py + bezel.get("bottom", 0.0)
    if (wide > 1 and px > tile.metres[0]) or (high > 1 and py > tile.metres[1]):
        source.note(node, "covers several tiles in one window: the frames between them are part of its picture")
    return Draft(
        node=node,
        name=f"r{row}c{column}",
        pixels=(wide * tile.pixels[0], high * tile.pixels[1]),
        corners=upright(x, y, width, height),
        bezel=dict(bezel),
        others=_host(source, node),
    )


def _host(source: Source, node: Node) -> dict[str, Any]:
    """The machine of a display, which some forks name."""
    if node is source.root:
        return {}
    for key in ("host", "hostname"):
        if (host := source.text(node.get(key))) is not None:
            source.carry(node.get(key), "host")
            return {"host": host}
    return {}


def _eye(source: Source) -> Float64 | None:
    """(3,) metres: the eye at the viewing distance; None where the file gives none."""
    dimensions = source.root.get("dimensions")
    node = dimensions.get("viewing_distance") if dimensions is not None else None
    distance = source.number(node)
    if distance is None or distance < SMALLEST_M:
        return None
    source.carry(node, "views[0].eye")
    return np.array([0.0, 0.0, distance])
