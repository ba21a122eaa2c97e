"""Choose the monitor and rectangle of each window of one X display. Pure: panels and monitors in, rectangles out.

A panel that names a `window` has it there, counted from its monitor if it names one, else from the whole X screen. A
panel that names a monitor fills it. A single panel that names neither fills the first monitor; several such panels lie
on it side by side as on the wall, bezels included, shrunk if they have to be: a wall on a desk.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from wall.core.errors import RunError
from wall.geometry.panels import Panel

TURNS = {  # image from window, a (2, 2) matrix row by row, x right and y down: a display mounted turned clockwise
    0: (1, 0, 0, 1),
    90: (0, -1, 1, 0),
    180: (-1, 0, 0, -1),
    270: (0, 1, -1, 0),
}


class Box(NamedTuple):
    """A rectangle of an X screen, pixels, origin at its top left corner."""

    x: int
    y: int
    width: int
    height: int


class Monitor(NamedTuple):
    """One monitor of an X screen as it is switched on."""

    name: str
    box: Box
    blanks_per_s: int  # vertical blanks; 0 where the server does not say


@dataclass(frozen=True, slots=True, kw_only=True)
class WindowRequest:
    """What a panel's configuration asks of its window."""

    id: str
    pixels: tuple[int, int]  # width, height as the viewer sees it
    screen: tuple[int, int]  # in the virtual screen
    span: tuple[int, int]  # width, height there
    rotation: int  # degrees clockwise that the display is mounted turned
    monitor: int | str | None  # index or name
    window: tuple[int, int, int, int] | None  # x, y, width, height
    most_hz: float | None  # images a second that it shows at most; None: as they come


@dataclass(frozen=True, slots=True, kw_only=True)
class Place:
    """Where a window shows a view, fractions of its image's width and height from the top left."""

    view: int
    left: float
    top: float
    right: float
    bottom: float


@dataclass(frozen=True, slots=True, kw_only=True)
class WindowPosition:
    """Rectangle, monitor and rotation of a window, and how often its image changes."""

    box: Box
    monitor: int | None  # which it fills; None: a window of that box
    rotation: int
    interval: int  # vertical blanks from one image to the next
    note: str = ""  # what the user should know: an image that is scaled


def request_of(panel: Panel, refresh_hz: float) -> WindowRequest:
    """The request of a panel's configuration, with `refresh_hz` images a second on their way to it."""
    window, own_hz = panel.config.window, panel.config.refresh_hz
    return WindowRequest(
        id=panel.id,
        pixels=panel.pixels,
        screen=panel.screen,
        span=panel.span,
        rotation=panel.config.rotation,
        monitor=panel.config.monitor,
        window=None if window is None else (window.x, window.y, window.width, window.height),
        most_hz=None if own_hz is None or own_hz >= refresh_hz else own_hz,
    )


def lay_out(panels: Sequence[WindowRequest], monitors: Sequence[Monitor], *, display: str) -> list[WindowPosition]:
    """The position of each panel's window on an X display.

    Raises RunError naming the panel, what it wants and what the display has, when there is no such monitor or another
    panel fills it.
    """
    if not monitors:
        raise RunError(f"panel {panels[0].id}: display {display} has no monitor that is switched on; wanted one")
    loose = [panel for panel in panels if panel.monitor is None and panel.window is None]
    on_desk = _side_by_side(loose, monitors[0].box) if len(loose) > 1 else {}
    filled: dict[int, str] = {}
    found = []
    for panel in panels:
        if panel.id in on_desk:
            found.append(_position(panel, on_desk[panel.id], None, monitors[0], rotation=0))
            continue
        index = _monitor_index(panel, monitors, display)
        if panel.window is not None:
            x, y, width, height = panel.window
            if panel.monitor is not None:
                x, y = x + monitors[index].box.x, y + monitors[index].box.y
            box = Box(x, y, width, height)
            found.append(_position(panel, box, None, monitors[index], rotation=panel.rotation))
            continue
        if index in filled:
            raise RunError(
                f"panel {panel.id}: monitor {monitors[index].name} of display {display} is filled by panel "
                f"{filled[index]}; wanted another `monitor`, or a `window` for both"
            )
        filled[index] = panel.id
        found.append(_position(panel, monitors[index].box, index, monitors[index], rotation=panel.rotation))
    return found


def _monitor_index(panel: WindowRequest, monitors: Sequence[Monitor], display: str) -> int:
    if panel.monitor is None:
        return 0
    for index, monitor in enumerate(monitors):
        if panel.monitor in (index, monitor.name):
            return index
    has = ", ".join(f"{k} ({m.name}, {m.box.width}x{m.box.height})" for k, m in enumerate(monitors))
    raise RunError(f"panel {panel.id}: display {display} has no monitor {panel.monitor}; it has {has}")


def _position(panel: WindowRequest, box: Box, fills: int | None, monitor: Monitor, *, rotation: int) -> WindowPosition:
    width, height = panel.pixels if rotation % 180 == 0 else panel.pixels[::-1]
    note = ""
    if (width, height) != (box.width, box.height):
        where = f"monitor {monitor.name}" if fills is not None else "its window"
        note = f"panel {panel.id}: {width}x{height} pixels are scaled to the {box.width}x{box.height} of {where}"
    return WindowPosition(
        box=box,
        monitor=fills,
        rotation=rotation,
        interval=max(1, round(monitor.blanks_per_s / panel.most_hz)) if panel.most_hz else 1,
        note=note,
    )


def _side_by_side(panels: Sequence[WindowRequest], room: Box) -> dict[str, Box]:
    """Boxes of panels as the virtual screen arranges them, shrunk to fit and centred in `room`.

    A panel's place is stretched to its pixels where it has more of them: those of both eyes side by side.
    """
    stretch = [max(p.pixels[k] / p.span[k] for p in panels) for k in (0, 1)]
    left, top = (min(p.screen[k] for p in panels) * stretch[k] for k in (0, 1))
    width, height = (max(p.screen[k] + p.span[k] for p in panels) * stretch[k] - (left, top)[k] for k in (0, 1))
    scale = min(1.0, room.width / width, room.height / height)
    x0 = room.x + (room.width - round(scale * width)) // 2
    y0 = room.y + (room.height - round(scale * height)) // 2
    boxes = {}
    for panel in panels:
        (x, right), (y, bottom) = (
            [round(scale * (at * stretch[k] - corner)) for at in (panel.screen[k], panel.screen[k] + panel.span[k])]
            for k, corner in enumerate((left, top))
        )
        boxes[panel.id] = Box(x0 + x, y0 + y, max(1, right - x), max(1, bottom - y))
    return boxes
