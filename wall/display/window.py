"""Native windows: each panel's image on the X display and monitor that the configuration names.

All windows of one X display live in a process of their own (window_process.py), which gets images through anonymous
shared memory (window_host.py). `show` only keeps the newest images; a thread for each display copies them when
a buffer is free, so a slow display gets fewer images, never older ones, and delays nobody.
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from wall.display.base import PanelImage, Status, WallImage, ZoomedPlace
from wall.display.window_host import WindowHost
from wall.display.window_layout import Place
from wall.display.x_server import display_of
from wall.geometry.panels import NO_VIEW, Panel, Wall
from wall.geometry.rects import panel_rect

ALL_CLOSED = "every window is closed"


class WindowSink:
    """A window a panel. A sink as wall.display.base wants it; also gives steering commands, as the page does.

    Escape in any window sets `finished`, and so does the end of the last window; closing a window closes only that one.
    """

    def __init__(self, panels: Sequence[Panel], *, refresh_hz: float) -> None:
        """Open all windows, black, and wait until they are there.

        panels : those that this machine shows, of one wall. Their `display`, `monitor`, `window` and `rotation` say
            where and how; display None is that of DISPLAY
        refresh_hz : images that come a second; a panel whose own `refresh_hz` is lower lets vertical blanks pass

        To be called by a thread that lives as long as the sink, for the windows die with it. Raises RunError naming
        the panel, the display and what was tried.
        """
        by_display: dict[str, list[Panel]] = {}
        for panel in panels:
            by_display.setdefault(display_of(panel), []).append(panel)
        height = max(panel.screen[1] + panel.pixels[1] for panel in panels)
        self.hosts: list[WindowHost] = []
        try:
            for display, own in by_display.items():
                self.hosts.append(WindowHost(display, own, height=height, refresh_hz=refresh_hz))
            for host in self.hosts:
                host.begin()
        except BaseException:
            self.close()
            raise
        self.notes = tuple(note for host in self.hosts for note in host.notes)  # to be said once

    def show(self, image: WallImage, status: Status) -> None:
        """Show each panel's image in its window, and frame what gets nothing new."""
        self.put(image.panels, status.stale)

    def put(self, images: Sequence[PanelImage], stale: Sequence[tuple[float, float, float, float]] = ()) -> None:
        """Show these as soon as their displays can; those of panels that have no window here are left alone.

        stale : places to frame, as Status has them.

        Raises LocalProtocolError for an image that has not its panel's size.
        """
        for host in self.hosts:
            host.put([image for image in images if image.id in host.areas], stale)

    def lay_out(
        self, wall: Wall, views: Sequence[str], why_images: Sequence[str], images: Sequence[ZoomedPlace], folder: Path
    ) -> None:
        """Know where which views are from now on: that beneath the pointer is steered."""
        places: dict[str, list[Place]] = {panel.id: [] for panel in wall.panels}
        for viewport in wall.viewports:
            panel = wall.panels[viewport.on_panel]
            if viewport.view != NO_VIEW:
                places[panel.id].append(_place(viewport, panel))
        for host in self.hosts:
            host.lay_out(places, len(views))

    def settled(self, timeout_s: float) -> bool:
        """Wait until every image that was put is displayed or superseded, or its window is closed."""
        limit = time.monotonic() + timeout_s
        return all(host.settled(max(0.0, limit - time.monotonic())) for host in self.hosts)

    def commands(self) -> list[dict[str, Any]]:
        """Commands from the input of any window since the last call, checked as page messages are."""
        return [command for host in self.hosts for command in host.commands()]

    @property
    def escape(self) -> str:
        """In which window Escape was pressed, in words; "" in none."""
        return next((host.escape for host in self.hosts if host.escape), "")

    @property
    def gone(self) -> bool:
        """Whether no window is left."""
        return all(host.gone for host in self.hosts)

    @property
    def finished(self) -> str:
        """Why the run should end: Escape, or no window is left; "" as long as it should not."""
        return self.escape or (ALL_CLOSED if self.gone else "")

    def dropped(self) -> dict[str, int]:
        """Images and commands that were dropped so far, by name."""
        return dict(sum((host.counters for host in self.hosts), Counter[str]()))

    def close(self) -> None:
        """Close the windows and end their processes, within two seconds."""
        for host in self.hosts:
            host.end()
        for host in self.hosts:
            host.join()


def _place(viewport: Panel, panel: Panel) -> Place:
    """Where a panel shows a viewport of it."""
    own, rect = panel_rect(panel), panel_rect(viewport)
    return Place(
        view=viewport.view,
        left=(rect.x - own.x) / own.width,
        top=(rect.y - own.y) / own.height,
        right=(rect.right - own.x) / own.width,
        bottom=(rect.bottom - own.y) / own.height,
    )
