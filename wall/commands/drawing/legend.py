"""The legend under a drawing: what its colours and lines mean, and what its figures assume."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from wall.commands.drawing.graph_part import ARROW, arrow_head
from wall.commands.drawing.model import Diagram
from wall.commands.drawing.page import BLACK, EYE_MM, GREY, LINE_PT, SMALL_PT, THIN_PT, Page, text_width
from wall.commands.drawing.palette import BEZEL, FRUSTUM, OVERLAP, RENDERER, Colours

KEY_MM = (6.0, 2.4)  # width and height of a sample
ROW_MM = 3.8
APART_MM = 4.5

Entry = tuple[str, Callable[[Page, float, float], None]]  # text, and what draws its sample at (x, middle y)


class Legend:
    """Explains the colours and lines that occur in a drawing."""

    def __init__(self, diagram: Diagram, colours: Mapping[str, Colours], *, overlaps: bool) -> None:
        self._diagram, self._colours, self._overlaps = diagram, colours, overlaps

    def draw(self, page: Page, x: float, y: float, width: float) -> float:
        """Draw rows from (x, y) on, mm; returns the y of the lower edge."""
        page.stroke([(x, y - 3.0), (x + width, y - 3.0)], line=GREY, width=THIN_PT / 2)
        at = x
        for text, sample in self._entries():
            needed = KEY_MM[0] + 1.2 + text_width(text, SMALL_PT)
            if at > x and at + needed > x + width:
                at, y = x, y + ROW_MM
            sample(page, at, y)
            page.write(at + KEY_MM[0] + 1.2, y + 0.8, text, size=SMALL_PT)
            at += needed + APART_MM
        for remark in self._diagram.assumptions:
            y += ROW_MM
            page.write(x, y + 0.8, remark, size=SMALL_PT, colour="#4d4d4d")
        return y + 1.4

    def _entries(self) -> list[Entry]:
        """The entries for what the drawing contains."""
        used = {box.process for box in self._diagram.boxes}
        roles = {process.role for key, process in self._diagram.processes.items() if key in used}
        entries: list[Entry] = []
        if "renderer" in roles:
            entries.append(("renderers", _area(RENDERER.fill, RENDERER.line)))
        for key, process in self._diagram.processes.items():
            if key in used and process.role != "renderer" and len(entries) < 8:
                entries.append((process.label, _area(self._colours[key].fill, self._colours[key].line)))
        if any(edge.crosses for edge in self._diagram.edges):
            entries.append(("between processes, expected bytes/s", _edge(BLACK, LINE_PT)))
        if any(not edge.crosses for edge in self._diagram.edges):
            entries.append(("call inside a process, no bytes", _edge(GREY, THIN_PT)))
        if any(any(screen.bezel) for screen in self._diagram.screens):
            entries.append(("bezel", _area(BEZEL, None)))
        if self._overlaps:
            entries.append(("lit by two panels", _hatched))
        entries.append(("eye, its view of a panel", _frustum))
        return entries


def _area(fill: str, line: str | None) -> Callable[[Page, float, float], None]:
    """What draws a filled rectangle as a key."""

    def draw(page: Page, x: float, y: float) -> None:
        page.rect(x, y - KEY_MM[1] / 2, *KEY_MM, fill=fill, line=line, width=THIN_PT)

    return draw


def _hatched(page: Page, x: float, y: float) -> None:
    page.rect(x, y - KEY_MM[1] / 2, *KEY_MM, line=OVERLAP, hatch="//////", width=THIN_PT)


def _frustum(page: Page, x: float, y: float) -> None:
    tip = x + EYE_MM
    ends = [(tip, y), (x + KEY_MM[0], y - KEY_MM[1] / 2), (x + KEY_MM[0], y + KEY_MM[1] / 2)]
    page.stroke(ends, closed=True, fill=FRUSTUM, line=None, alpha=0.09)
    for end in ends[1:]:
        page.stroke([ends[0], end], line=FRUSTUM, width=THIN_PT)
    page.dot(tip, y, EYE_MM, fill=BLACK, line="#ffffff", width=THIN_PT)


def _edge(colour: str, width: float) -> Callable[[Page, float, float], None]:
    """What draws an arrow as a key."""

    def draw(page: Page, x: float, y: float) -> None:
        page.stroke([(x, y), (x + KEY_MM[0] - ARROW[0], y)], line=colour, width=width)
        arrow_head(page, (x + KEY_MM[0] - ARROW[0], y), colour)

    return draw
