"""Native windows: each panel's picture on the X display and monitor that the configuration names.

All windows of one X display live in a process of their own (window_process.py), which gets pictures through anonymous
shared memory (glass.py). `show` only remembers what is newest; a thread a display copies it when there is room, so a
slow display gets fewer pictures, never older ones, and never holds anybody up.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Any

from wall.core.data import Counters
from wall.display.base import PanelPicture, Status, WallPicture
from wall.display.window_host import Glass
from wall.display.x_server import display_of
from wall.geometry.panels import Panel

ALL_CLOSED = "every window is closed"


class WindowSink:
    """A window a panel. A sink as wall.display.base wants it; also gives steering commands, as the page does.

    Escape in any window sets `finished`, and so does the end of the last window; closing a window closes only that one.
    """

    def __init__(self, panels: Sequence[Panel], *, refresh_hz: float) -> None:
        """Open all windows, black, and wait until they are there.

        panels : those that this machine shows, of one wall. Their `display`, `monitor`, `window` and `rotation` say
            where and how; display None is that of DISPLAY
        refresh_hz : pictures that come a second; a panel whose own `refresh_hz` is lower lets vertical blanks pass

        To be called by a thread that lives as long as the sink, for the windows die with it. Raises RunError naming
        the panel, the display and what was tried.
        """
        by_display: dict[str, list[Panel]] = {}
        for panel in panels:
            by_display.setdefault(display_of(panel), []).append(panel)
        height = max(panel.screen[1] + panel.pixels[1] for panel in panels)
        self._glasses: list[Glass] = []
        try:
            for display, own in by_display.items():
                self._glasses.append(Glass(display, own, height=height, refresh_hz=refresh_hz))
            for glass in self._glasses:
                glass.begin()
        except BaseException:
            self.close()
            raise
        self.notes = tuple(note for glass in self._glasses for note in glass.notes)  # to be said once

    def show(self, picture: WallPicture, status: Status) -> None:
        self.put(picture.panels)

    def put(self, pictures: Sequence[PanelPicture]) -> None:
        """Show these as soon as their displays can; those of panels that have no window here are left alone.

        Raises LocalProtocolError for a picture that has not its panel's size.
        """
        for glass in self._glasses:
            glass.put([picture for picture in pictures if picture.id in glass.parts])

    def settled(self, timeout_s: float) -> bool:
        """Wait until everything that was put is on the glass, or overtaken, or its window gone."""
        limit = time.monotonic() + timeout_s
        return all(glass.settled(max(0.0, limit - time.monotonic())) for glass in self._glasses)

    def commands(self) -> list[dict[str, Any]]:
        """What hands asked for in any window since the last call, as wall.display.steering.parse_message gives it."""
        return [command for glass in self._glasses for command in glass.commands()]

    @property
    def escape(self) -> str:
        """In which window Escape was pressed, in words; "" in none."""
        return next((glass.escape for glass in self._glasses if glass.escape), "")

    @property
    def gone(self) -> bool:
        """Whether no window is left."""
        return all(glass.gone for glass in self._glasses)

    @property
    def finished(self) -> str:
        """Why the run should end: Escape, or no window is left; "" as long as it should not."""
        return self.escape or (ALL_CLOSED if self.gone else "")

    def dropped(self) -> dict[str, int]:
        total = Counters()
        for glass in self._glasses:
            total.merge(glass.counters.counts)
        return dict(total.counts)

    def close(self) -> None:
        """Close the windows and end their processes, within two seconds."""
        for glass in self._glasses:
            glass.end()
        for glass in self._glasses:
            glass.join()
