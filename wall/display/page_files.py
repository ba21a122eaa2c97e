"""Files of the page, and the tables of colours that panels' displays need."""

from __future__ import annotations

import os
from functools import lru_cache
from pathlib import Path

from aiohttp import web

from wall.core.errors import ConfigError
from wall.display.stream import table_bytes
from wall.geometry.panels import Wall
from wall.operators.lut import read_lut

PAGE = Path(__file__).resolve().parent / "page"
KEPT_TABLES = 8  # of 65^3 nodes: 3.3 MB each
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
    """The table of a panel's `colour`, whose file lies in the folder, as table_bytes. Raises HTTPNotFound.

    A file is read once, until it changes: 0.3 s for 65^3 nodes.
    """
    colour = next((panel.config.colour for panel in wall.panels if panel.id == panel_id), None)
    if colour is None or colour.lut is None:
        raise web.HTTPNotFound(text="no such table\n")
    path = folder / colour.lut
    try:
        return _table(path, path.stat().st_mtime_ns)
    except (OSError, ConfigError):  # it was there when the run began
        raise web.HTTPNotFound(text="the table cannot be read\n") from None


@lru_cache(KEPT_TABLES)
def _table(path: Path, mtime_ns: int) -> bytes:
    return table_bytes(read_lut(path))
