"""Names on panels: as large and as much as their panel holds, beside each other where panels overlap."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from wall.commands.drawing.front import Front, Placed, meet, meeting
from wall.commands.drawing.ink import BLACK, BODY_PT, SMALL_PT, Page, width_of
from wall.commands.drawing.model import TIMES, Screen
from wall.core.data import Float64

LINE_MM = 2.9
ROOM = 0.94  # share of a panel that its label may take
FOUND = (0.0, -0.25, 0.25, -0.5, 0.5)  # from the middle, in halves of what is free: where a label may stand
Lines = list[tuple[str, float, bool]]  # text, points, bold
Box = tuple[float, float, float, float]  # left, bottom, right, top, mm


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Label:
    """Lines of text about a place on the drawing's plane."""

    lines: Lines
    middle: Float64  # (2,) mm, y up

    @property
    def box(self) -> Box:
        width, height = size_of(self.lines)
        x, y = self.middle
        return x - width / 2, y - height / 2, x + width / 2, y + height / 2

    @property
    def says_resolution(self) -> bool:
        return any(TIMES in text for text, _, bold in self.lines if not bold)

    def write(self, page: Page, x: float, y: float) -> None:
        """Write it with its middle at (x, y) of the page, mm, y down."""
        top = y - len(self.lines) * LINE_MM / 2
        for k, (text, size, bold) in enumerate(self.lines):
            colour = BLACK if bold else "#4d4d4d"
            page.write(x, top + (k + 0.78) * LINE_MM, text, size=size, bold=bold, colour=colour, align="center")


def labels(front: Front, scale: float) -> list[Label | None]:
    """A label for each screen; None where there is no room for its id. `scale`: mm of paper a metre."""
    found = _placed(front, scale, resolution=True)
    alike = len({one.screen.pixels for one in front.placed}) == 1
    if alike and not all(label is not None and label.says_resolution for label in found):
        return _placed(front, scale, resolution=False)  # the caption says it once
    return found


def pixels(size: tuple[int, int]) -> str:
    """Width and height for a reader."""
    return f"{size[0]} {TIMES} {size[1]}"


def size_of(lines: Lines) -> tuple[float, float]:
    """Width and height of lines, mm."""
    return max(width_of(text, size, bold=bold) for text, size, bold in lines), len(lines) * LINE_MM


def _placed(front: Front, scale: float, *, resolution: bool) -> list[Label | None]:
    """Small screens first, so that a large one behind them finds what they leave."""
    rects = np.array([one.rect() for one in front.placed]) * scale
    shared: dict[int, list[Box]] = defaultdict(list)
    near: dict[int, list[int]] = defaultdict(list)
    for i, j in meeting(rects):
        both = meet(rects[i], rects[j])
        if both is not None:
            bounds = (*both.min(axis=0), *both.max(axis=0))
            for a, b in ((i, j), (j, i)):
                near[a].append(b)
                shared[a].append(bounds)
    found: list[Label | None] = [None] * len(rects)
    for i in sorted(range(len(rects)), key=lambda k: front.placed[k].size[0] * front.placed[k].size[1]):
        taken = [label.box for k in near[i] if (label := found[k]) is not None]
        room = _room(front.placed[i], scale)
        for avoided in ([*taken, *shared[i]], taken) if shared[i] else (taken,):
            found[i] = _fitting(front.placed[i].screen, rects[i], room, avoided, resolution=resolution)
            if found[i] is not None:
                break
    return found


def _fitting(
    screen: Screen, rect: Float64, room: tuple[float, float], avoided: Sequence[Box], *, resolution: bool
) -> Label | None:
    """The most that fits, as near to the middle as may be."""
    for lines in _wordings(screen, room[0], resolution=resolution):
        width, height = size_of(lines)
        free = (room[0] - width, room[1] - height)
        if min(free) < 0:
            continue
        for down in FOUND if avoided else FOUND[:1]:
            for across in FOUND if avoided else FOUND[:1]:
                label = Label(lines=lines, middle=rect.mean(axis=0) + np.array([across * free[0], down * free[1]]))
                if not any(_cover(label.box, box) for box in avoided):
                    return label
    return None


def _wordings(screen: Screen, room: float, *, resolution: bool) -> list[Lines]:
    """From the most to the least: with the resolution, in larger type, with notes."""
    found = []
    for with_resolution in (True, False) if resolution else (False,):
        for size in (BODY_PT, SMALL_PT):
            lines: Lines = [(part, size, True) for part in _broken(screen.id, size, room)]
            if with_resolution:
                lines.append((pixels(screen.pixels), SMALL_PT, False))
            for notes in (screen.notes, ()) if screen.notes else ((),):
                found.append(lines + [(note, SMALL_PT, False) for note in notes])
    return found


def _room(placed: Placed, scale: float) -> tuple[float, float]:
    """Width and height on the page in which a level label may stand, mm."""
    width, height = (ROOM * scale * edge for edge in placed.size)
    tilt = abs(float(placed.right[1]))
    if tilt < 0.02:
        return width, height
    if tilt > 0.9998:
        return height, width
    return (min(width, height) * 0.7,) * 2


def _broken(text: str, size: float, room: float) -> list[str]:
    """An id that is too wide, broken at its signs."""
    if width_of(text, size, bold=True) <= room:
        return [text]
    lines = [""]
    for part in re.findall(r"[^-_. +]+[-_. +]*|[-_. +]+", text):
        if lines[-1] and width_of(lines[-1] + part, size, bold=True) > room:
            lines.append("")
        lines[-1] += part
    return [line.strip() for line in lines]


def _cover(a: Box, b: Box) -> bool:
    return a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3]
