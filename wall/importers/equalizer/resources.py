"""Read nodes, pipes, windows and channels: the pixels of each channel, its machine and its display.

Pipes and windows count pixels from the top left; a channel's viewport in its window counts from the bottom left.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field

from wall.importers.equalizer.grammar import Statement
from wall.importers.panels import MOST_PIXELS

ASSUMED_PIPE = (1920, 1080)  # pixels of a display that does not say its size

LONGEST_NAME = 40  # characters of an id
OFF_SCREEN = ("FBO", "pbuffer")

Rect = tuple[int, int, int, int]  # x, y, width, height


@dataclass(slots=True, eq=False)
class Channel:
    """A rectangle of a window, the smallest unit that renders or shows."""

    name: str  # as the file calls it; may be empty
    id: str  # unique, letters, digits, '.', '_' and '-'
    statement: Statement
    host: str | None
    display: str | None
    pixels: tuple[int, int]
    window: Rect | None  # on its display, from the top left; None: all of it
    assumed: bool  # whether the display's size had to be assumed
    off_screen: bool  # its window is a frame buffer that no display shows


@dataclass(slots=True)
class Resources:
    """All channels, in the order of the file."""

    channels: list[Channel] = field(default_factory=list)

    def named(self, name: str) -> Channel | None:
        """The first channel of that name."""
        return next((channel for channel in self.channels if channel.name == name), None)


def read_resources(config: Statement, fullscreen: bool) -> Resources:
    """All channels of a config. `fullscreen`: whether windows are full screen that do not say it."""
    found, ids = Resources(), set[str]()
    for node in config.all("appNode", "node"):
        host = _host(node)
        for pipe in node.all("pipe"):
            display, size = _display(pipe), pipe.numbers("viewport")
            for window in pipe.all("window"):
                for channel in window.all("channel"):
                    area, label = _area(channel, window, size, fullscreen), channel.text("name")
                    name = unique(label or "channel", ids)
                    found.channels.append(Channel(label, name, channel, host, display, *area, _off_screen(window)))
    return found


def unique(name: str, taken: set[str]) -> str:
    """A valid id (letters, digits, '.', '_' and '-', beginning with a letter or digit) that is not taken yet."""
    base = re.sub(r"[^A-Za-z0-9._-]+", "-", name).strip("-._")[:LONGEST_NAME] or "panel"
    found, number = base, 2
    while found in taken:
        found, number = f"{base}-{number}", number + 1
    taken.add(found)
    return found


def _host(node: Statement) -> str | None:
    """A node's own host, else the machine of its first connection."""
    own = node.text("host")
    for connection in node.all("connection"):
        hostname = connection.last("hostname")
        if not own and hostname is not None and hostname.values[0]:
            own = node.text("host") or connection.text("hostname")
            connection.carry()
    return own or None


def _display(pipe: Statement) -> str | None:
    """The X display of port and device; None where the pipe says neither."""
    port, device = pipe.numbers("port"), pipe.numbers("device")
    if port is None and device is None:
        return None
    return f":{int(port[0]) if port else 0}.{int(device[0]) if device else 0}"


def _area(
    channel: Statement, window: Statement, pipe: list[float] | None, fullscreen: bool
) -> tuple[tuple[int, int], Rect | None, bool]:
    """Pixels of the channel, its rectangle on the display, and whether the display's size was assumed."""
    own, part = window.numbers("viewport"), channel.numbers("viewport")
    width, height = (int(pipe[2]), int(pipe[3])) if pipe else ASSUMED_PIPE
    whole = _switch(window, "hint_fullscreen", fullscreen) or own is None
    exact = own is not None and _in_pixels(own)
    if whole and exact and own is not None and pipe is None:
        width, height = int(own[2]), int(own[3])
    area = (0, 0, width, height) if whole or own is None else _pixels(own, (width, height))
    x, y, w, h = (0, 0, area[2], area[3]) if part is None else _pixels(part, area[2:])
    if not (0 < w <= MOST_PIXELS and 0 < h <= MOST_PIXELS):
        for one in channel.all("viewport") or window.all("viewport") or [channel]:
            one.drop(f"a channel of {w} x {h} pixels came; wanted: 1 to {MOST_PIXELS} each way, so it is cut to that")
        w, h = (min(MOST_PIXELS, max(1, size)) for size in (w, h))
    covers = whole and part is None
    rect = None if covers or _off_screen(window) else (area[0] + x, area[1] + area[3] - y - h, w, h)
    return (w, h), rect, pipe is None and not exact and not (part is not None and _in_pixels(part))


def _in_pixels(viewport: list[float]) -> bool:
    """Whether a viewport is given in pixels, not in shares."""
    return viewport[2] > 1 or viewport[3] > 1


def _pixels(viewport: list[float], of: tuple[int, int] | Rect) -> Rect:
    """A viewport in whole pixels: parts of `of` (width, height) are rounded edge by edge."""
    x, y, w, h = viewport
    if _in_pixels(viewport):
        return int(x), int(y), int(w), int(h)
    left, low = round(x * of[0]), round(y * of[1])
    return left, low, round((x + w) * of[0]) - left, round((y + h) * of[1]) - low


def _switch(block: Statement, word: str, default: bool) -> bool:
    """Whether an attribute of a block is on."""
    value = default
    for attributes in block.all("attributes"):
        if (found := attributes.last(word)) is not None and found.values[0] not in ("AUTO", -1.0):
            found.carry()
            value = found.values[0] not in ("OFF", 0.0)
    return value


def _off_screen(window: Statement) -> bool:
    """Whether a window renders to a frame buffer that no display shows."""
    drawables = [one for attributes in window.all("attributes") for one in attributes.all("hint_drawable")]
    return any(one.values[0] in OFF_SCREEN for one in drawables)
