"""Draw the compositing graph: layers from left to right, a coloured frame for each process, edges with bytes/s."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from matplotlib.path import Path as Curve

from wall.commands.drawing.graph_layout import Cluster, GraphLayout, Item, lay_out
from wall.commands.drawing.model import TIMES, Box, Diagram, Edge
from wall.commands.drawing.page import BLACK, BODY_PT, GREY, LINE_PT, SMALL_PT, THIN_PT, Page, text_width, truncated
from wall.commands.drawing.palette import Colours
from wall.commands.drawing.traffic import si

LINE_MM = 3.0  # from baseline to baseline
BOX_PAD = 1.2  # mm, between a box and its text
WIDEST_TEXT = 34.0  # mm; longer names are cut
FRAME_PAD = 1.6
BEND = 6.0  # mm of page width in which an edge moves up or down
PORT_STEP = 1.3  # mm between the ends of edges at one box, where there is room
ARROW = (1.5, 0.55)  # mm, length and half width
STACK_STEP = 0.8  # mm between the boxes drawn behind a merged one
MOST_PORTS = 14  # edges for which a box is made higher; more come closer together


Line = list[tuple[str, float, bool]]  # text, points, bold


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class GraphPart:
    """A graph that is laid out, with its size, ready to be drawn anywhere on a page."""

    diagram: Diagram
    colours: Mapping[str, Colours]
    layout: GraphLayout
    left: tuple[float, ...]  # of each layer, mm
    widths: tuple[float, ...]
    heights: Mapping[str, float]
    lines: Mapping[str, list[Line]]
    width: float
    height: float

    def draw(self, page: Page, x: float, y: float) -> None:
        """Draw it with its top left corner at (x, y), mm."""
        _GraphDrawing(self, page, x, y).draw()


def graph_part(diagram: Diagram, colours: Mapping[str, Colours], *, narrow: bool = False) -> GraphPart:
    """Lay out the graph of a diagram; `narrow` makes its boxes higher and narrower."""
    lines = {box.id: _lines(box, narrow=narrow) for box in diagram.boxes}
    fan_in: dict[str, int] = defaultdict(int)
    for edge in diagram.edges:
        fan_in[edge.end] += 1
    heights = {
        box.id: max(_text_height(lines[box.id]), min(fan_in[box.id], MOST_PORTS) * PORT_STEP + 1.0)
        for box in diagram.boxes
    }
    rooms = {box.id: heights[box.id] + 2 * _behind(box) for box in diagram.boxes}
    names = _names(diagram)
    framed = {key: (sum(map(bool, name)) * LINE_MM - 0.4 + FRAME_PAD / 2, FRAME_PAD) for key, name in names.items()}
    layout = lay_out(diagram.boxes, diagram.edges, rooms, lambda process: framed.get(process, (0.0, 0.0)))
    last = max(layout.level.values())
    widths = [
        max(_text_width(lines[box.id]) + _behind(box) for box in diagram.boxes if layout.level[box.id] == k)
        for k in range(last + 1)
    ]
    gaps = [_gap(diagram, layout, k) for k in range(last)]
    for cluster in layout.clusters:
        if cluster.process in names:
            (a, b), wanted = cluster.span, _name_width(names[cluster.process]) + 2.0 - 2 * FRAME_PAD
            widths[b] += max(0.0, wanted - sum(widths[a : b + 1]) - sum(gaps[a:b]))
    inset = FRAME_PAD if any(cluster.process in names and cluster.span[0] == 0 for cluster in layout.clusters) else 0.0
    left = [inset + sum(widths[:k]) + sum(gaps[:k]) for k in range(last + 1)]
    return GraphPart(
        diagram=diagram,
        colours=colours,
        layout=layout,
        left=tuple(left),
        widths=tuple(widths),
        heights=heights,
        lines=lines,
        width=left[-1] + widths[-1] + FRAME_PAD,
        height=layout.height,
    )


def _names(diagram: Diagram) -> dict[str, tuple[str, str]]:
    """Two lines of heading for every process except renderers that only send samples, whose boxes name them."""
    incoming = diagram.incoming()
    more = {box.process for box in diagram.boxes if not box.source or diagram.processes[box.process].role != "renderer"}
    named = {}
    for key, process in diagram.processes.items():
        if key in more:
            together = " together" if process.count > 1 else ""
            total = f"in {si(incoming[key], 'B/s')}{together}" if incoming.get(key) else ""
            named[key] = (process.label, ", ".join(part for part in (process.detail, total) if part))
    return named


def _name_width(name: tuple[str, str]) -> float:
    """Width of a process's heading, mm."""
    return max(text_width(name[0], BODY_PT, bold=True), text_width(name[1], SMALL_PT))


def _lines(box: Box, *, narrow: bool) -> list[Line]:
    """Name and operator, then the detail; on a narrow page each below the other."""
    times = f"{box.count} {TIMES} " if box.count > 1 else ""
    alone = f"{box.op} ".removeprefix(f"{box.id} ").strip()  # `browser sink` named browser is a sink
    op = times + box.op if times else alone
    room = WIDEST_TEXT - (0.0 if narrow or not op else 1.0 + text_width(op, BODY_PT))
    name = (truncated(box.title or box.id, BODY_PT, room, bold=True), BODY_PT, True)
    lines = [[name], [(op, BODY_PT, False)]] if narrow else [[name, (op, BODY_PT, False)]]
    lines.append([(truncated(box.detail, SMALL_PT, WIDEST_TEXT), SMALL_PT, False)])
    filled = [[part for part in line if part[0]] for line in lines]
    return [line for line in filled if line]


def _line_width(line: Line) -> float:
    """Width of a line of text with the gaps between its parts, mm."""
    return sum(text_width(text, size, bold=bold) for text, size, bold in line) + len(line) - 1.0


def _text_width(lines: list[Line]) -> float:
    """Width of a box with these lines, mm."""
    return max(_line_width(line) for line in lines) + 2 * BOX_PAD


def _behind(box: Box) -> float:
    """How far the boxes drawn behind a merged one reach beyond it, mm."""
    return 2 * STACK_STEP if box.count > 1 else 0.0


def _text_height(lines: list[Line]) -> float:
    """Height of a box with these lines, mm."""
    return len(lines) * LINE_MM + 1.4


def _labels(diagram: Diagram) -> dict[str, str]:
    """The texts at the beginning of the edges that leave each box's process."""
    leaving: dict[str, list[Edge]] = defaultdict(list)
    for edge in diagram.edges:
        if edge.bytes_per_s > 0:
            leaving[edge.start].append(edge)
    return {start: " + ".join(dict.fromkeys(_label(edge, edges) for edge in edges)) for start, edges in leaving.items()}


def _label(edge: Edge, others: list[Edge]) -> str:
    """The rate of an edge and of those in `others` with the same rate: `2 x 12 MB/s`."""
    count = edge.count * sum(other.bytes_per_s == edge.bytes_per_s and other.count == edge.count for other in others)
    each = si(edge.bytes_per_s / edge.count, "B/s")
    return each if count == 1 else f"{count} {TIMES} {each}"


def _gap(diagram: Diagram, layout: GraphLayout, level: int) -> float:
    """Width between a layer and the next, mm, with room for its edges' texts and bends."""
    labels = _labels(diagram)
    widest = [text_width(text, SMALL_PT) for start, text in labels.items() if layout.level[start] == level]
    return 2 * FRAME_PAD + BEND + (max(widest) + 1.0 if widest else 0.0)


class _GraphDrawing:
    """Draws a graph at a position of a page."""

    def __init__(self, part: GraphPart, page: Page, x: float, y: float) -> None:
        self._part, self._page, self._x, self._y = part, page, x, y
        self._box = {box.id: box for box in part.diagram.boxes}
        self._labels = _labels(part.diagram)

    def draw(self) -> None:
        """Draw processes, edges with their texts, then boxes."""
        names = _names(self._part.diagram)
        for cluster in self._part.layout.clusters:
            if cluster.process in names:
                self._frame(cluster, names[cluster.process])
        for number, edge in enumerate(self._part.diagram.edges):
            self._edge(number, edge)
        for start, text in self._labels.items():
            level = self._part.layout.level[start]
            x = self._right(level) + FRAME_PAD + 0.6
            self._page.write(x, self._middle(start) - 0.7, text, size=SMALL_PT)
        for box in self._part.diagram.boxes:
            self._draw_box(box)

    def _left(self, level: int) -> float:
        return self._x + self._part.left[level]

    def _right(self, level: int) -> float:
        return self._left(level) + self._part.widths[level]

    def _middle(self, item: Item) -> float:
        return self._y + self._part.layout.middle[item]

    def _frame(self, cluster: Cluster, name: tuple[str, str]) -> None:
        """Draw a process's frame and heading."""
        first, last = cluster.span
        x, y, colours = self._left(first) - FRAME_PAD, self._y + cluster.top, self._part.colours[cluster.process]
        width = self._right(last) + FRAME_PAD - x
        style = {"fill": colours.fill, "line": colours.line, "width": THIN_PT, "level": -2}
        self._page.rect(x, y, width, cluster.height, gid=f"process-{cluster.process.replace(' ', '-')}", **style)
        self._page.write(x + 1.0, y + LINE_MM, name[0], bold=True, colour=colours.line)
        self._page.write(x + 1.0, y + 2 * LINE_MM - 0.3, name[1], size=SMALL_PT, colour=colours.line)

    def _draw_box(self, box: Box) -> None:
        """Draw a box with its lines of text."""
        level, colours = self._part.layout.level[box.id], self._part.colours[box.process]
        x, height, width = self._left(level), self._part.heights[box.id], self._part.widths[level] - _behind(box)
        y = self._middle(box.id) - height / 2
        lone = box.process not in _names(self._part.diagram)
        style = {"fill": colours.fill if lone else "#ffffff", "line": colours.line, "width": THIN_PT}
        for behind in (2, 1) if box.count > 1 else ():
            self._page.rect(x + behind * STACK_STEP, y - behind * STACK_STEP, width, height, level=2, **style)
        self._page.rect(x, y, width, height, gid=f"node-{box.id}", level=3, **style)
        lines = self._part.lines[box.id]
        base = y + height / 2 - len(lines) * LINE_MM / 2 + 0.78 * LINE_MM
        for k, line in enumerate(lines):
            at = x + BOX_PAD
            for text, size, bold in line:
                colour = BLACK if size == BODY_PT else "#4d4d4d"
                self._page.write(at, base + k * LINE_MM, text, size=size, bold=bold, colour=colour)
                at += text_width(text, size, bold=bold) + 1.0

    def _edge(self, number: int, edge: Edge) -> None:
        """Draw an edge: out of the box, past its label, with a bend in every gap, into its port."""
        first, last = (self._part.layout.level[name] for name in (edge.start, edge.end))
        points = [(self._right(first), self._middle(edge.start))]
        codes: list[int | np.uint8] = [Curve.MOVETO]
        for level in range(first + 1, last + 1):
            end = level == last
            y = self._port(number, edge) if end else self._middle((number, level))
            x = self._left(level) - (ARROW[0] if end else 0.0)
            bend = self._left(level) - FRAME_PAD - BEND
            points += [
                (bend, points[-1][1]),
                (bend + BEND / 2, points[-1][1]),
                (bend + BEND / 2, y),
                (bend + BEND, y),
                (x, y),
            ]
            codes += [Curve.LINETO, Curve.CURVE4, Curve.CURVE4, Curve.CURVE4, Curve.LINETO]
            if not end:
                points.append((self._right(level), y))
                codes.append(Curve.LINETO)
        colour, width = (BLACK, LINE_PT) if edge.crosses else (GREY, THIN_PT)
        name = f"edge-{edge.start}-{edge.end}"
        self._page.stroke(points, codes=codes, line=colour, width=width, gid=name, level=1)
        arrow_head(self._page, points[-1], colour)

    def _port(self, number: int, edge: Edge) -> float:
        """The y at which an edge ends: the edges of a box are spread over its side, in their order downwards."""
        last = self._part.layout.level[edge.end]
        came = []
        for other, every in enumerate(self._part.diagram.edges):
            if every.end == edge.end:
                adjacent = self._part.layout.level[every.start] == last - 1
                came.append((self._middle(every.start if adjacent else (other, last - 1)), other))
        came.sort()
        k, room = [other for _, other in came].index(number), self._part.heights[edge.end] - 2.4
        step = min(PORT_STEP, room / max(len(came) - 1, 1))
        return self._middle(edge.end) + (k - (len(came) - 1) / 2) * step


def arrow_head(page: Page, base: tuple[float, float], colour: str) -> None:
    """Draw a filled arrow head that points to the right, its base at (x, y), mm."""
    x, y = base
    tip = [(x, y - ARROW[1]), (x + ARROW[0], y), (x, y + ARROW[1])]
    page.stroke(np.array(tip), closed=True, fill=colour, line=None, level=1)
