"""Choose and place the labels of panels: as much text as fits, next to each other where panels overlap."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from wall.commands.drawing.front_view import FrontView, Placed, meet, meeting
from wall.commands.drawing.model import TIMES, Screen
from wall.commands.drawing.page import BLACK, BODY_PT, SMALL_PT, Page, text_width
from wall.core.data import Float64

LINE_MM = 2.9  # from baseline to baseline
LABEL_SHARE = 0.94  # share of a panel that its label may take
OFFSETS = (0.0, -0.25, 0.25, -0.5, 0.5)  # of a label from the panel's middle, as shares of the free space
Lines = list[tuple[str, float, bool]]  # text, points, bold
Box = tuple[float, float, float, float]  # left, bottom, right, top, mm


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Label:
    """Lines of text centred at a point of the drawing's plane."""

    lines: Lines
    middle: Float64  # (2,) mm, y up

    @property
    def box(self) -> Box:
        """Its bounds, mm, y up."""
        width, height = size_of(self.lines)
        x, y = self.middle
        return x - width / 2, y - height / 2, x + width / 2, y + height / 2

    @property
    def has_resolution(self) -> bool:
        """Whether it names the panel's resolution."""
        return any(TIMES in text for text, _, bold in self.lines if not bold)

    def write(self, page: Page, x: float, y: float) -> None:
        """Write it with its middle at (x, y) of the page, mm, y down."""
        top = y - len(self.lines) * LINE_MM / 2
        for k, (text, size, bold) in enumerate(self.lines):
            colour = BLACK if bold else "#4d4d4d"
            page.write(x, top + (k + 0.78) * LINE_MM, text, size=size, bold=bold, colour=colour, align="center")


def labels(front: FrontView, scale: float) -> list[Label | None]:
    """A label for each screen; None where its id does not fit. `scale`: mm of paper a metre."""
    found = _placed(front, scale, resolution=True)
    alike = len({one.screen.pixels for one in front.placed}) == 1
    if alike and not all(label is not None and label.has_resolution for label in found):
        return _placed(front, scale, resolution=False)  # the caption says it once
    return found


def pixels(size: tuple[int, int]) -> str:
    """Width and height as text."""
    return f"{size[0]} {TIMES} {size[1]}"


def size_of(lines: Lines) -> tuple[float, float]:
    """Width and height of lines, mm."""
    return max(text_width(text, size, bold=bold) for text, size, bold in lines), len(lines) * LINE_MM


def _placed(front: FrontView, scale: float, *, resolution: bool) -> list[Label | None]:
    """Place labels, those of small screens first, so that a large screen behind them avoids them."""
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
        room = _free_size(front.placed[i], scale)
        for avoided in ([*taken, *shared[i]], taken) if shared[i] else (taken,):
            found[i] = _best_label(front.placed[i].screen, rects[i], room, avoided, resolution=resolution)
            if found[i] is not None:
                break
    return found


def _best_label(
    screen: Screen, rect: Float64, room: tuple[float, float], avoided: Sequence[Box], *, resolution: bool
) -> Label | None:
    """The label with the most text that fits, as near to the screen's middle as possible; None if none fits."""
    for lines in _variants(screen, room[0], resolution=resolution):
        width, height = size_of(lines)
        free = (room[0] - width, room[1] - height)
        if min(free) < 0:
            continue
        for down in OFFSETS if avoided else OFFSETS[:1]:
            for across in OFFSETS if avoided else OFFSETS[:1]:
                label = Label(lines=lines, middle=rect.mean(axis=0) + np.array([across * free[0], down * free[1]]))
                if not any(_overlap(label.box, box) for box in avoided):
                    return label
    return None


def _variants(screen: Screen, room: float, *, resolution: bool) -> list[Lines]:
    """A screen's possible labels, those with the most text first."""
    found = []
    for with_resolution in (True, False) if resolution else (False,):
        for size in (BODY_PT, SMALL_PT):
            lines: Lines = [(part, size, True) for part in _wrapped(screen.id, size, room)]
            if with_resolution:
                lines.append((pixels(screen.pixels), SMALL_PT, False))
            for notes in (screen.notes, ()) if screen.notes else ((),):
                found.append(lines + [(note, SMALL_PT, False) for note in notes])
    return found


def _free_size(placed: Placed, scale: float) -> tuple[float, float]:
    """Width and height of the largest horizontal label that a screen can hold, mm."""
    width, height = (LABEL_SHARE * scale * edge for edge in placed.size)
    tilt = abs(float(placed.right[1]))
    if tilt < 0.02:
        return width, height
    if tilt > 0.9998:
        return height, width
    return (min(width, height) * 0.7,) * 2


def _wrapped(text: str, size: float, room: float) -> list[str]:
    """An id in lines: one that is too wide is broken at its punctuation."""
    if text_width(text, size, bold=True) <= room:
        return [text]
    lines = [""]
    for part in re.findall(r"[^-_. +]+[-_. +]*|[-_. +]+", text):
        if lines[-1] and text_width(lines[-1] + part, size, bold=True) > room:
            lines.append("")
        lines[-1] += part
    return [line.strip() for line in lines]


def _overlap(a: Box, b: Box) -> bool:
    """Whether two boxes overlap."""
    return a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3]
