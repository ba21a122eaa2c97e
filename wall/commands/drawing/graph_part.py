"""The compositing graph on a page: layers left to right, processes tinted, wires between them with their bytes/s."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from matplotlib.path import Path as Curve

from wall.commands.drawing.ink import BLACK, BODY_PT, GREY, LINE_PT, SMALL_PT, THIN_PT, Page, fitted, width_of
from wall.commands.drawing.layers import Item, Lane, Stacked, stack
from wall.commands.drawing.model import TIMES, Box, Sketch, Wire
from wall.commands.drawing.palette import Tint
from wall.commands.drawing.traffic import si

LINE_MM = 3.0  # from baseline to baseline
BOX_PAD = 1.2  # mm, between a box and its text
WIDEST_TEXT = 34.0  # mm; longer names are cut
HULL_PAD = 1.6
BEND = 6.0  # mm, in which a wire changes its height
PORT_STEP = 1.3  # mm between the ends of wires at one box, where there is room
ARROW = (1.5, 0.55)  # mm, length and half width
STACKED = 0.8  # mm by which the boxes behind a bundle stand out


Line = list[tuple[str, float, bool]]  # text, points, bold


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class GraphPart:
    """A graph with its size, ready to be drawn anywhere on a page."""

    sketch: Sketch
    tints: Mapping[str, Tint]
    stacked: Stacked
    left: tuple[float, ...]  # of each layer, mm
    widths: tuple[float, ...]
    heights: Mapping[str, float]
    lines: Mapping[str, list[Line]]
    width: float
    height: float

    def draw(self, page: Page, x: float, y: float) -> None:
        """Draw it with its top left corner at (x, y), mm."""
        _Drawing(self, page, x, y).draw()


def graph_part(sketch: Sketch, tints: Mapping[str, Tint], *, narrow: bool = False) -> GraphPart:
    """Lay the graph of a sketch out; `narrow` makes its boxes higher and less wide."""
    lines = {box.id: _lines(box, narrow=narrow) for box in sketch.boxes}
    fan_in: dict[str, int] = defaultdict(int)
    for wire in sketch.wires:
        fan_in[wire.end] += 1
    heights = {
        box.id: max(_text_height(lines[box.id]), min(fan_in[box.id], 14) * PORT_STEP + 1.0) for box in sketch.boxes
    }
    rooms = {box.id: heights[box.id] + 2 * _behind(box) for box in sketch.boxes}
    names = _names(sketch)
    framed = {key: (sum(map(bool, name)) * LINE_MM - 0.4 + HULL_PAD / 2, HULL_PAD) for key, name in names.items()}
    stacked = stack(sketch.boxes, sketch.wires, rooms, lambda place: framed.get(place, (0.0, 0.0)))
    last = max(stacked.level.values())
    widths = [
        max(_text_width(lines[box.id]) + _behind(box) for box in sketch.boxes if stacked.level[box.id] == k)
        for k in range(last + 1)
    ]
    gaps = [_gap(sketch, stacked, k) for k in range(last)]
    for lane in stacked.lanes:
        if lane.place in names:
            (a, b), wanted = lane.span, _name_width(names[lane.place]) + 2.0 - 2 * HULL_PAD
            widths[b] += max(0.0, wanted - sum(widths[a : b + 1]) - sum(gaps[a:b]))
    edge = HULL_PAD if any(lane.place in names and lane.span[0] == 0 for lane in stacked.lanes) else 0.0
    left = [edge + sum(widths[:k]) + sum(gaps[:k]) for k in range(last + 1)]
    return GraphPart(
        sketch=sketch,
        tints=tints,
        stacked=stacked,
        left=tuple(left),
        widths=tuple(widths),
        heights=heights,
        lines=lines,
        width=left[-1] + widths[-1] + HULL_PAD,
        height=stacked.height,
    )


def _names(sketch: Sketch) -> dict[str, tuple[str, str]]:
    """Two lines over every process but renderers of sample streams alone, whose boxes say it all."""
    incoming = sketch.incoming()
    more = {box.place for box in sketch.boxes if not box.source or sketch.places[box.place].role != "renderer"}
    named = {}
    for key, place in sketch.places.items():
        if key in more:
            together = " together" if place.count > 1 else ""
            total = f"in {si(incoming[key], 'B/s')}{together}" if incoming.get(key) else ""
            named[key] = (place.label, ", ".join(part for part in (place.detail, total) if part))
    return named


def _name_width(name: tuple[str, str]) -> float:
    return max(width_of(name[0], BODY_PT, bold=True), width_of(name[1], SMALL_PT))


def _lines(box: Box, *, narrow: bool) -> list[Line]:
    """Name and operator, then the detail; on a narrow page each below the other."""
    times = f"{box.count} {TIMES} " if box.count > 1 else ""
    alone = f"{box.op} ".removeprefix(f"{box.id} ").strip()  # `browser sink` named browser is a sink
    op = times + box.op if times else alone
    room = WIDEST_TEXT - (0.0 if narrow or not op else 1.0 + width_of(op, BODY_PT))
    name = (fitted(box.title or box.id, BODY_PT, room, bold=True), BODY_PT, True)
    lines = [[name], [(op, BODY_PT, False)]] if narrow else [[name, (op, BODY_PT, False)]]
    lines.append([(fitted(box.detail, SMALL_PT, WIDEST_TEXT), SMALL_PT, False)])
    filled = [[part for part in line if part[0]] for line in lines]
    return [line for line in filled if line]


def _line_width(line: Line) -> float:
    return sum(width_of(text, size, bold=bold) for text, size, bold in line) + len(line) - 1.0


def _text_width(lines: list[Line]) -> float:
    return max(_line_width(line) for line in lines) + 2 * BOX_PAD


def _behind(box: Box) -> float:
    """By how much the boxes behind a bundle stand out, mm."""
    return 2 * STACKED if box.count > 1 else 0.0


def _text_height(lines: list[Line]) -> float:
    return len(lines) * LINE_MM + 1.4


def _labels(sketch: Sketch) -> dict[str, str]:
    """What stands at the beginning of the wires that leave each box's process."""
    leaving: dict[str, list[Wire]] = defaultdict(list)
    for wire in sketch.wires:
        if wire.bytes_per_s > 0:
            leaving[wire.start].append(wire)
    return {start: " + ".join(dict.fromkeys(_label(wire, wires) for wire in wires)) for start, wires in leaving.items()}


def _label(wire: Wire, others: list[Wire]) -> str:
    count = wire.count * sum(other.bytes_per_s == wire.bytes_per_s and other.count == wire.count for other in others)
    each = si(wire.bytes_per_s / wire.count, "B/s")
    return each if count == 1 else f"{count} {TIMES} {each}"


def _gap(sketch: Sketch, stacked: Stacked, level: int) -> float:
    labels = _labels(sketch)
    widest = [width_of(text, SMALL_PT) for start, text in labels.items() if stacked.level[start] == level]
    return 2 * HULL_PAD + BEND + (max(widest) + 1.0 if widest else 0.0)


class _Drawing:
    def __init__(self, part: GraphPart, page: Page, x: float, y: float) -> None:
        self._part, self._page, self._x, self._y = part, page, x, y
        self._box = {box.id: box for box in part.sketch.boxes}
        self._labels = _labels(part.sketch)

    def draw(self) -> None:
        names = _names(self._part.sketch)
        for lane in self._part.stacked.lanes:
            if lane.place in names:
                self._hull(lane, names[lane.place])
        for number, wire in enumerate(self._part.sketch.wires):
            self._wire(number, wire)
        for start, text in self._labels.items():
            level = self._part.stacked.level[start]
            x = self._right(level) + HULL_PAD + 0.6
            self._page.write(x, self._middle(start) - 0.7, text, size=SMALL_PT)
        for box in self._part.sketch.boxes:
            self._draw_box(box)

    def _left(self, level: int) -> float:
        return self._x + self._part.left[level]

    def _right(self, level: int) -> float:
        return self._left(level) + self._part.widths[level]

    def _middle(self, item: Item) -> float:
        return self._y + self._part.stacked.middle[item]

    def _hull(self, lane: Lane, name: tuple[str, str]) -> None:
        first, last = lane.span
        x, y, tint = self._left(first) - HULL_PAD, self._y + lane.top, self._part.tints[lane.place]
        width = self._right(last) + HULL_PAD - x
        style = {"fill": tint.fill, "line": tint.line, "width": THIN_PT, "level": -2}
        self._page.rect(x, y, width, lane.height, gid=f"place-{lane.place.replace(' ', '-')}", **style)
        self._page.write(x + 1.0, y + LINE_MM, name[0], bold=True, colour=tint.line)
        self._page.write(x + 1.0, y + 2 * LINE_MM - 0.3, name[1], size=SMALL_PT, colour=tint.line)

    def _draw_box(self, box: Box) -> None:
        level, tint = self._part.stacked.level[box.id], self._part.tints[box.place]
        x, height, width = self._left(level), self._part.heights[box.id], self._part.widths[level] - _behind(box)
        y = self._middle(box.id) - height / 2
        lone = box.place not in _names(self._part.sketch)
        style = {"fill": tint.fill if lone else "#ffffff", "line": tint.line, "width": THIN_PT}
        for behind in (2, 1) if box.count > 1 else ():
            self._page.rect(x + behind * STACKED, y - behind * STACKED, width, height, level=2, **style)
        self._page.rect(x, y, width, height, gid=f"node-{box.id}", level=3, **style)
        lines = self._part.lines[box.id]
        base = y + height / 2 - len(lines) * LINE_MM / 2 + 0.78 * LINE_MM
        for k, line in enumerate(lines):
            at = x + BOX_PAD
            for text, size, bold in line:
                colour = BLACK if size == BODY_PT else "#4d4d4d"
                self._page.write(at, base + k * LINE_MM, text, size=size, bold=bold, colour=colour)
                at += width_of(text, size, bold=bold) + 1.0

    def _wire(self, number: int, wire: Wire) -> None:
        """Out of the box, past its label, then a bend in every gap, into the port."""
        first, last = (self._part.stacked.level[name] for name in (wire.start, wire.end))
        points = [(self._right(first), self._middle(wire.start))]
        codes: list[int | np.uint8] = [Curve.MOVETO]
        for level in range(first + 1, last + 1):
            end = level == last
            y = self._port(number, wire) if end else self._middle((number, level))
            x = self._left(level) - (ARROW[0] if end else 0.0)
            bend = self._left(level) - HULL_PAD - BEND
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
        colour, width = (BLACK, LINE_PT) if wire.crosses else (GREY, THIN_PT)
        name = f"wire-{wire.start}-{wire.end}"
        self._page.stroke(points, codes=codes, line=colour, width=width, gid=name, level=1)
        arrow_head(self._page, points[-1], colour)

    def _port(self, number: int, wire: Wire) -> float:
        """Where a wire ends: the wires of one box are spread over its side, in the order in which they come."""
        last = self._part.stacked.level[wire.end]
        came = []
        for other, every in enumerate(self._part.sketch.wires):
            if every.end == wire.end:
                adjacent = self._part.stacked.level[every.start] == last - 1
                came.append((self._middle(every.start if adjacent else (other, last - 1)), other))
        came.sort()
        k, room = [other for _, other in came].index(number), self._part.heights[wire.end] - 2.4
        step = min(PORT_STEP, room / max(len(came) - 1, 1))
        return self._middle(wire.end) + (k - (len(came) - 1) / 2) * step


def arrow_head(page: Page, base: tuple[float, float], colour: str) -> None:
    """A filled tip that points to the right; its base at (x, y), mm."""
    x, y = base
    tip = [(x, y - ARROW[1]), (x + ARROW[0], y), (x, y + ARROW[1])]
    page.stroke(np.array(tip), closed=True, fill=colour, line=None, level=1)
