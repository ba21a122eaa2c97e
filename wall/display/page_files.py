"""Files of the page, and the tables of colours that panels' displays need."""

from __future__ import annotations

import os
from pathlib import Path

from aiohttp import web

from wall.core.errors import ConfigError
from wall.display.stream import table_bytes
from wall.geometry.panels import Wall
from wall.operators.lut import read_lut

PAGE = Path(__file__).resolve().parent / "page"
TYPES = {".html": "text/html", ".js": "text/javascript", ".css": "text/css"}


async def page_file(request: web.Request) -> web.Response:
    """The file that a request names. Raises HTTPNotFound."""
    name = request.match_info.get("name", "index.html")
    path = PAGE / name
    if name not in os.listdir(PAGE) or path.suffix not in TYPES:  # whatever is asked for, nothing else is looked at
        raise web.HTTPNotFound(text="no such page\n")
    text = path.read_text(encoding="utf-8")
    return web.Response(text=text, content_type=TYPES[path.suffix], charset="utf-8")


def table_of(panel_id: str, wall: Wall, folder: Path) -> bytes:
    """The table of a panel's `colour`, whose file lies in the folder, as table_bytes. Raises HTTPNotFound."""
    colour = next((panel.config.colour for panel in wall.panels if panel.id == panel_id), None)
    if colour is None or colour.lut is None:
        raise web.HTTPNotFound(text="no such table\n")
    try:
        return table_bytes(read_lut(folder / colour.lut))
    except ConfigError:  # it was there when the run began
        raise web.HTTPNotFound(text="the table cannot be read\n") from None
