"""Where boxes and wires go: layers from left to right, every process a rectangle of its own.

Layers are longest paths from the sources. A *lane* is a process with all its nodes, or a wire that passes layers
outside of its processes; lanes that share a layer stand above each other, in an order that is improved by barycentres
(Sugiyama, Tagawa, Toda 1981) and then pulled straight.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from wall.commands.drawing.model import Box, Wire

SWEEPS = 16
SETTLING = 24
ROW_GAP, LANE_GAP, WIRE_ROOM = 2.2, 3.2, 1.6  # mm: between boxes, between lanes, for a wire that passes
CROSSING_MM = 25.0  # how much longer wires may get for one crossing less

Item = str | tuple[int, int]  # id of a box, or (wire, layer) where it passes


@dataclass(slots=True, kw_only=True, eq=False)
class Lane:
    """A process, or a passing wire, in some layers."""

    place: str  # "" = a wire
    head: float  # mm kept free above its boxes, for its name
    pad: float  # mm around its boxes
    rows: dict[int, list[Item]] = field(default_factory=lambda: defaultdict(list))
    top: float = 0.0
    height: float = 0.0

    @property
    def span(self) -> tuple[int, int]:
        return min(self.rows), max(self.rows)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Stacked:
    """Layers and heights; graph_part.py gives them widths."""

    level: Mapping[str, int]
    middle: Mapping[Item, float]  # y, mm
    lanes: tuple[Lane, ...]
    height: float


def levels(boxes: Sequence[Box], wires: Sequence[Wire]) -> dict[str, int]:
    """Layer of each box: the longest path to it, sample streams first, other sources just before their first user."""
    inputs, users = defaultdict(list), defaultdict(list)
    for wire in wires:
        inputs[wire.end].append(wire.start)
        users[wire.start].append(wire.end)
    level: dict[str, int] = {}
    for box in boxes:
        level[box.id] = max((level[name] + 1 for name in inputs[box.id]), default=0)
    for box in boxes:
        if not inputs[box.id] and box.op != "samples" and users[box.id]:
            level[box.id] = min(level[name] for name in users[box.id]) - 1
    return level


def stack(
    boxes: Sequence[Box],
    wires: Sequence[Wire],
    heights: Mapping[str, float],
    frame: Callable[[str], tuple[float, float]],
) -> Stacked:
    """Give every box, and every wire where it passes a layer, a height on the page.

    Parameters
    ----------
    boxes : inputs before those who need them
    heights : of the boxes, mm
    frame : of a place, mm: what its name takes above its boxes, what is kept free around them
    """
    return _Stacking(boxes, wires, heights, frame).best()


class _Stacking:
    def __init__(
        self,
        boxes: Sequence[Box],
        wires: Sequence[Wire],
        heights: Mapping[str, float],
        frame: Callable[[str], tuple[float, float]],
    ) -> None:
        self._level = levels(boxes, wires)
        self._heights: dict[Item, float] = {name: height for name, height in heights.items()}  # noqa: C416 (other keys)
        self._near: dict[Item, list[Item]] = defaultdict(list)
        self._segments: dict[int, list[tuple[Item, Item]]] = defaultdict(list)
        self._middle: dict[Item, float] = {}
        self._above: dict[int, list[Lane]] = {}
        self._below: dict[int, list[Lane]] = {}
        lanes: dict[str, Lane] = {}
        place_of = {box.id: box.place for box in boxes}
        for box in boxes:
            if box.place not in lanes:
                head, pad = frame(box.place)
                lanes[box.place] = Lane(place=box.place, head=head, pad=pad)
            lanes[box.place].rows[self._level[box.id]].append(box.id)
        self._lanes = list(lanes.values())
        for k, wire in enumerate(wires):
            inside = lanes[place_of[wire.start]] if place_of[wire.start] == place_of[wire.end] else None
            self._add_wire(k, wire, inside)
        for lane in self._lanes:
            lane.height = max(self._room(items) for items in lane.rows.values()) + lane.head + 2 * lane.pad

    def _add_wire(self, number: int, wire: Wire, inside: Lane | None) -> None:
        """Items where it passes a layer, inside its process if both ends are there, else in a lane of its own."""
        first, last = self._level[wire.start], self._level[wire.end]
        chain: list[Item] = [wire.start, *((number, level) for level in range(first + 1, last)), wire.end]
        lane = inside
        if lane is None and len(chain) > 2:
            lane = Lane(place="", head=0.0, pad=0.0)
            self._lanes.append(lane)
        for item in chain[1:-1]:
            assert lane is not None
            assert isinstance(item, tuple)
            lane.rows[item[1]].append(item)
            self._heights[item] = WIRE_ROOM
        for offset, (a, b) in enumerate(pairwise(chain)):
            self._near[a].append(b)
            self._near[b].append(a)
            self._segments[first + offset].append((a, b))

    def best(self) -> Stacked:
        """The best of some sweeps: fewest crossings, then shortest wires."""
        least, found = np.inf, {}
        order = self._lanes
        tops: dict[int, float] = {}
        for _ in range(SWEEPS):
            self._pile(order)
            for turn in range(SETTLING):
                self._settle(order if turn % 2 else order[::-1])
                self._spread()
            if (cost := self._cost()) < least - 1e-6:
                least, found = cost, dict(self._middle)
                tops = {id(lane): lane.top for lane in order}
            order = sorted(self._lanes, key=self._pull)
        for lane in self._lanes:
            lane.top = tops[id(lane)]
        high = min(lane.top for lane in self._lanes)
        for lane in self._lanes:
            lane.top -= high
        return Stacked(
            level=self._level,
            middle={item: y - high for item, y in found.items()},
            lanes=tuple(self._lanes),
            height=max(lane.top + lane.height for lane in self._lanes),
        )

    def _room(self, items: Sequence[Item]) -> float:
        return sum(self._heights[item] for item in items) + ROW_GAP * (len(items) - 1)

    def _pile(self, order: Sequence[Lane]) -> None:
        """Every lane as high as those before it in the order allow."""
        bottom: dict[int, Lane] = {}
        self._above = defaultdict(list)
        self._below = defaultdict(list)
        for lane in order:
            first, last = lane.span
            above = {id(bottom[k]): bottom[k] for k in range(first, last + 1) if k in bottom}
            lane.top = max((other.top + other.height + _apart(other, lane) for other in above.values()), default=0.0)
            for other in above.values():
                self._above[id(lane)].append(other)
                self._below[id(other)].append(lane)
            bottom.update(dict.fromkeys(range(first, last + 1), lane))
        self._spread()

    def _settle(self, turns: Sequence[Lane]) -> None:
        """Move each lane towards its neighbours as far as those above and below it allow."""
        for lane in turns:
            low = max((a.top + a.height + _apart(a, lane) for a in self._above[id(lane)]), default=-np.inf)
            high = min((b.top - _apart(lane, b) for b in self._below[id(lane)]), default=np.inf)
            new = min(max(lane.top + self._lean(lane), low), high - lane.height)
            for items in lane.rows.values():
                for item in items:
                    self._middle[item] += new - lane.top
            lane.top = new

    def _lean(self, lane: Lane) -> float:
        """How far its neighbours in other lanes are below it, mean."""
        own = {item for items in lane.rows.values() for item in items}
        away = [
            self._middle[other] - self._middle[item] for item in own for other in self._near[item] if other not in own
        ]
        return float(np.mean(away)) if away else 0.0

    def _pull(self, lane: Lane) -> int:
        """Where it wants to be, roughly: lanes that want the same keep their order."""
        return round((lane.top + lane.height / 2 + self._lean(lane)) / ROW_GAP)

    def _spread(self) -> None:
        """Order the items of each lane by their neighbours, and place them as near to these as their room allows."""
        for lane in self._lanes:
            low, high = lane.top + lane.head + lane.pad, lane.top + lane.height - lane.pad
            for items in lane.rows.values():
                for item in items:
                    self._middle.setdefault(item, (low + high) / 2)
                wanted = {item: self._wanted(item) for item in items}
                items.sort(key=lambda item: wanted[item])
                half = np.array([self._heights[item] / 2 for item in items])
                steps = np.concatenate([[0.0], half[:-1] + half[1:] + ROW_GAP]).cumsum()
                level = _isotonic([wanted[item] - step for item, step in zip(items, steps, strict=True)])
                bottom = high - half[-1] - steps[-1]
                for item, base, step in zip(items, level, steps, strict=True):
                    self._middle[item] = float(min(max(base, low + half[0]), bottom) + step)

    def _wanted(self, item: Item) -> float:
        near = [self._middle[other] for other in self._near[item] if other in self._middle]
        return float(np.mean(near)) if near else self._middle[item]

    def _cost(self) -> float:
        cost = 0.0
        for segments in self._segments.values():
            a, b = np.array([(self._middle[start], self._middle[end]) for start, end in segments]).T
            crossings = np.count_nonzero(np.subtract.outer(a, a) * np.subtract.outer(b, b) < -1e-9) / 2
            cost += float(np.abs(a - b).sum()) + CROSSING_MM * crossings
        return cost


def _apart(above: Lane, below: Lane) -> float:
    """Distance of lanes: less between those without a frame."""
    return LANE_GAP if above.pad or below.pad else ROW_GAP


def _isotonic(values: Sequence[float]) -> list[float]:
    """The growing sequence nearest to values: pool adjacent violators."""
    pools: list[list[float]] = []  # sum, count
    for value in values:
        pools.append([value, 1])
        while len(pools) > 1 and pools[-2][0] / pools[-2][1] > pools[-1][0] / pools[-1][1]:
            total, count = pools.pop()
            pools[-1][0] += total
            pools[-1][1] += count
    return [total / count for total, count in pools for _ in range(int(count))]
