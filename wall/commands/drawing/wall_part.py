"""Draw the wall to scale: front view and top view, with a scale bar in metres."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from wall.commands.drawing.front_view import FrontView, front_view, meet, meeting
from wall.commands.drawing.labels import labels, pixels
from wall.commands.drawing.model import MINUS, TIMES, Diagram
from wall.commands.drawing.page import (
    BLACK,
    BODY_PT,
    EYE_MM,
    GREY,
    LINE_PT,
    SMALL_PT,
    THIN_PT,
    Page,
    text_width,
    truncated,
)
from wall.commands.drawing.palette import BEZEL, FRUSTUM, LIT, OVERLAP, Colours
from wall.commands.drawing.top_view import TopView, top_view
from wall.core.data import Float64

HEADING_MM = 4.2  # from the top of a view's heading to its picture
CAPTION_MM = 3.2
BETWEEN_MM = 5.0  # the two views
MOST_FRUSTA = 12  # of more only the outermost edges are drawn
SMALL_PANEL_MM = 8.0  # the outlines of smaller panels are proportionally thinner
BAR_MM = 5.0  # from the lowest point of the plan to the scale bar
KINDS = {"flat": "", "unrolled": "unrolled", "apart": "laid apart"}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class WallPart:
    """Both views of a wall with their scale, ready to be drawn anywhere on a page."""

    diagram: Diagram
    colours: Mapping[str, Colours]
    front: FrontView
    top: TopView
    scale: float  # mm of paper a metre
    width: float
    height: float

    def draw(self, page: Page, x: float, y: float) -> None:
        """Draw it with its top left corner at (x, y), mm."""
        _WallDrawing(self, page, x, y).draw()


def wall_part(diagram: Diagram, colours: Mapping[str, Colours], *, width: float, height: float) -> WallPart:
    """Both views of a wall at the largest common scale that fits into `width` x `height` mm."""
    seen, above = front_view(diagram.screens), top_view(diagram.screens)
    left, bottom, right, top = seen.bounds()
    west, far, east, near = above.bounds()
    room = height - 2 * HEADING_MM - CAPTION_MM - BETWEEN_MM - BAR_MM
    scale = min(width / max(right - left, east - west), room / (top - bottom + near - far))
    used = scale * (top - bottom + near - far) + height - room
    return WallPart(diagram=diagram, colours=colours, front=seen, top=above, scale=scale, width=width, height=used)


def nice_length(most: float) -> float:
    """The largest of 1, 2, 5 times a power of ten that is not above `most`."""
    power = 10.0 ** math.floor(math.log10(most))
    return max(step * power for step in (1, 2, 5) if step * power <= most * (1 + 1e-9))


def metres(value: float) -> str:
    """A length as text: "2.5 m", "35 cm", "4 mm"."""
    for unit, size in (("m", 1.0), ("cm", 1e-2)):
        if value >= size:
            return f"{value / size:.3g} {unit}"
    return f"{value / 1e-3:.3g} mm"


class _WallDrawing:
    """Draws a wall at a position of a page."""

    def __init__(self, part: WallPart, page: Page, x: float, y: float) -> None:
        self._part, self._page, self._x, self._y = part, page, x, y
        self._labels = labels(part.front, part.scale)

    def draw(self) -> None:
        """Draw the front view, its caption, the top view and the scale bar."""
        part, page = self._part, self._page
        left, bottom, right, top = part.front.bounds()
        west, far, east, near = part.top.bounds()
        page.write(self._x, self._y + 2.4, "Front view", bold=True)
        room = part.width - text_width("Front view", bold=True) - 1.4
        page.write(self._x + part.width - room, self._y + 2.4, truncated(self._how(), BODY_PT, room), colour=GREY)
        middle = self._x + part.width / 2
        if part.front.kind == "flat":  # the same process above and below: both views have one x
            low, high = min(left, west), max(right, east)
            origin = plan_origin = middle - part.scale * (low + high) / 2
        else:
            origin, plan_origin = middle - part.scale * (left + right) / 2, middle - part.scale * (west + east) / 2
        head = self._y + HEADING_MM
        self._front(np.array([origin, head + part.scale * top]))
        below = head + part.scale * (top - bottom) + CAPTION_MM
        page.write(self._x, below, self._extent(), size=SMALL_PT, colour=GREY)
        second = below + BETWEEN_MM
        page.write(self._x, second + 1.0, "Top view", bold=True)
        page.write(self._x + text_width("Top view", bold=True) + 1.4, second + 1.0, self._eye_text(), colour=GREY)
        head = second + HEADING_MM - 1.2
        self._plan(np.array([plan_origin, head - part.scale * far]))
        self._scale_bar(head + part.scale * (near - far) + BAR_MM - 1.2)

    def _how(self) -> str:
        """The front view's kind, and the first and last id where ids do not fit on the panels."""
        ids = [placed.screen.id for placed in self._part.front.placed]
        kind = KINDS[self._part.front.kind]
        left_out = f"{ids[0]} … {ids[-1]}" if not all(self._labels) else "in true sizes" if kind else ""
        return ", ".join(part for part in (kind, left_out) if part)

    def _extent(self) -> str:
        """The caption of the front view: the wall's size, its panels, and their resolution if it is the same."""
        left, bottom, right, top = self._part.front.bounds()
        sizes = {screen.pixels for screen in self._part.diagram.screens}
        count = sum(len(screen.panels) or 1 for screen in self._part.diagram.screens)
        each = "each " if count > 1 else ""
        same = f", {each}{pixels(next(iter(sizes)))} px" if len(sizes) == 1 else ""
        panels = f"{count} panels" if count > 1 else "1 panel"
        return f"{metres(right - left)} {TIMES} {metres(top - bottom)}, {panels}{same}"

    def _front(self, origin: Float64) -> None:
        """Draw the front view; `origin`: (0, 0) of its plane on the page, mm."""
        part, page = self._part, self._page

        def on_page(points: Float64) -> Float64:
            found: Float64 = origin + part.scale * points * np.array([1.0, -1.0])
            return found

        rects = np.array([placed.rect() for placed in part.front.placed])
        for placed, rect in zip(part.front.placed, rects, strict=True):
            screen, colours = placed.screen, part.colours.get(placed.screen.process)
            if any(screen.bezel):
                page.stroke(on_page(placed.rect(*screen.bezel)), closed=True, fill=BEZEL, line=None, level=-2)
            fill = colours.fill if colours else LIT
            width = THIN_PT * min(1.0, min(placed.size) * part.scale / SMALL_PANEL_MM)
            for k, panel in enumerate(screen.panels or (screen.id,)):
                drawn = {"fill": fill, "line": BLACK} if k == 0 else {"line": None}
                page.stroke(on_page(rect), closed=True, width=width, gid=f"panel-{panel}", level=-1, **drawn)
        for i, j in meeting(rects):
            one, other = (part.front.placed[k].screen for k in (i, j))
            shared = meet(rects[i], rects[j]) if one.shares_eye(other) else None
            if shared is not None:
                page.stroke(on_page(shared), closed=True, line=OVERLAP, hatch="//////", gid="overlap")
        for label in filter(None, self._labels):
            label.write(page, *(float(v) for v in on_page(label.middle / part.scale)))

    def _plan(self, origin: Float64) -> None:
        """Draw the top view; `origin`: x = z = 0 on the page, mm."""
        part, page = self._part, self._page

        def on_page(points: Float64) -> Float64:
            found: Float64 = origin + part.scale * points
            return found

        wedges = part.top.wedges
        for wedge in wedges:
            area = np.array([wedge.eye, *wedge.ends()])
            page.stroke(on_page(area), closed=True, fill=FRUSTUM, line=None, alpha=0.09, level=-3)
        for eye, end in part.top.edges(most=2 * MOST_FRUSTA):
            page.stroke(on_page(np.array([eye, end])), line=FRUSTUM, width=THIN_PT, level=-2)
        for outline in part.top.screens:
            if len(outline) > 4:
                self._arc(outline, on_page)
                continue
            normal = _across(outline)
            if normal is None:  # a floor, or tilted
                page.stroke(on_page(outline), closed=True, fill=BEZEL, line=None, alpha=0.15, level=-1)
                page.stroke(on_page(outline), closed=True, width=LINE_PT if len(wedges) <= MOST_FRUSTA else THIN_PT / 2)
                continue
            page.stroke(on_page(outline[:2]), width=2 * LINE_PT, level=1)
            for end in outline[:2]:
                page.stroke(on_page(end) + np.outer([-0.8, 0.8], normal), width=THIN_PT)
        for eye in part.top.eyes:
            x, y = on_page(eye)
            page.dot(x, y, EYE_MM, fill=BLACK, line="#ffffff", width=THIN_PT, gid="eye", level=2)

    def _arc(self, outline: Float64, on_page: Callable[[Float64], Float64]) -> None:
        """Draw a curved screen from above: its lower edge, and its area where that is not below the upper one."""
        sides = len(outline) // 4
        edge = outline[: sides + 1]
        upper = outline[3 * sides : 2 * sides - 1 : -1]
        if float(np.linalg.norm(edge[: len(upper)] - upper, axis=1).max()) > 0.02 * float(np.ptp(edge, axis=0).max()):
            self._page.stroke(on_page(outline), closed=True, fill=BEZEL, line=None, alpha=0.15, level=-1)
            self._page.stroke(on_page(outline), closed=True, width=LINE_PT)
            return
        self._page.stroke(on_page(edge), width=2 * LINE_PT, level=1)
        for end, before in ((edge[0], edge[1]), (edge[-1], edge[-2])):
            normal = _across(np.array([end, before, before, end]))
            if normal is not None:
                self._page.stroke(on_page(end) + np.outer([-0.8, 0.8], normal), width=THIN_PT)

    def _eye_text(self) -> str:
        """The caption of the top view: the eye's position, or the number of eyes."""
        eyes = np.unique(np.round([eye for screen in self._part.diagram.screens for eye in screen.eyes], 6), axis=0)
        if len(eyes) > 1:
            return f"{len(eyes)} eyes"
        position = ", ".join(f"{value:.3g}".replace("-", MINUS) for value in eyes[0] + 0.0)
        return f"eye at ({position}) m"

    def _scale_bar(self, y: float) -> None:
        """Draw a bar of a round length in metres."""
        length = nice_length(self._part.width / 4 / self._part.scale)
        x, end = self._x, self._x + self._part.scale * length
        self._page.stroke([(x, y), (end, y)], width=LINE_PT, gid="scale-bar")
        for at in (x, end):
            self._page.stroke([(at, y - 0.8), (at, y + 0.8)], width=LINE_PT)
        self._page.write(end + 1.2, y + 0.8, metres(length))


def _across(outline: Float64) -> Float64 | None:
    """(2,) unit vector across the line that an upright screen is from above; None for a tilted screen."""
    along = outline[1] - outline[0]
    length = float(np.linalg.norm(along))
    if length < 1e-6 or float(np.linalg.norm(outline[3] - outline[0])) > 0.02 * length:
        return None
    return np.array([-along[1], along[0]]) / length
