"""Check that X displays can be reached before a run starts. Connects to the socket only; no X protocol."""

from __future__ import annotations

import os
import re
import socket
from collections.abc import Sequence

from wall.core.errors import RunError
from wall.geometry.panels import Panel

TIMEOUT_S = 3.0  # for a display of another machine
_NAME = re.compile(r"(?:(?P<host>[^:/]*)/?)?:(?P<number>\d{1,5})(?:\.\d+)?")


def check_displays(panels: Sequence[Panel]) -> None:
    """Raise RunError naming the first panel whose display nobody serves, and what was tried."""
    first: dict[str, Panel] = {}
    for panel in panels:
        first.setdefault(display_of(panel), panel)
    for display, panel in first.items():
        match = _NAME.fullmatch(display)
        if match is None:
            raise RunError(f"panel {panel.id}: display {display!r} is no X display; wanted one such as ':0' or ':0.1'")
        tried = _tried(match["host"] or "", int(match["number"]))
        if tried:
            raise RunError(
                f"panel {panel.id}: display {display} cannot be reached (tried {', '.join(tried)}); wanted an X server "
                "that is running, or --headless"
            )


def display_of(panel: Panel) -> str:
    """The X display that shows a panel: its own, or that of DISPLAY. Raises RunError where there is none."""
    display = panel.config.display or os.environ.get("DISPLAY", "")
    if not display:
        raise RunError(
            f"panel {panel.id}: no X display to show it on: the configuration names none and DISPLAY is not set; "
            "wanted `display` at the panel, such as ':0', or DISPLAY, or --headless"
        )
    return display


def _tried(host: str, number: int) -> list[str]:
    """Sockets that nobody answered at; [] as soon as one did."""
    path, tried = f"/tmp/.X11-unix/X{number}", []
    if host in ("", "unix"):
        for name, address in ((path, path), (f"abstract {path}", "\0" + path)):
            with socket.socket(socket.AF_UNIX) as here:
                here.settimeout(TIMEOUT_S)
                if here.connect_ex(address) == 0:
                    return []
            tried.append(name)
        return tried
    try:
        socket.create_connection((host, 6000 + number), TIMEOUT_S).close()
    except OSError as error:
        return [f"{host}:{6000 + number}: {error.strerror or error}"]
    return []
