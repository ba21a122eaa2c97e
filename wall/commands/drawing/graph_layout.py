"""Lay out a graph in layers from left to right, with a rectangle for every process.

A node's layer is the longest path to it. A *cluster* is a process with all its nodes, or an edge that passes layers
outside of its processes; clusters that share a layer stand above each other, in an order that barycentres improve
(Sugiyama, Tagawa, Toda 1981), and are then moved to make edges straight.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import accumulate, pairwise

import numpy as np

from wall.commands.drawing.model import Box, Edge

SWEEPS = 16  # orders tried
RELAXATIONS = 24
ROW_GAP, CLUSTER_GAP, PASSING_EDGE = 2.2, 3.2, 1.6  # mm: between boxes, between clusters, for an edge that passes
CROSSING_MM = 25.0  # how much longer edges may get for one crossing less

Item = str | tuple[int, int]  # id of a box, or (edge, layer) where it passes


@dataclass(slots=True, kw_only=True, eq=False)
class Cluster:
    """A process, or a passing edge, with its items in each layer."""

    process: str  # "" = an edge
    head: float  # mm kept free above its boxes, for its name
    pad: float  # mm around its boxes
    rows: dict[int, list[Item]] = field(default_factory=lambda: defaultdict(list))
    top: float = 0.0
    height: float = 0.0

    @property
    def span(self) -> tuple[int, int]:
        """Its first and its last layer."""
        return min(self.rows), max(self.rows)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class GraphLayout:
    """The layers and heights of boxes; graph_part.py adds widths."""

    level: Mapping[str, int]
    middle: Mapping[Item, float]  # y, mm
    clusters: tuple[Cluster, ...]
    height: float


def levels(boxes: Sequence[Box], edges: Sequence[Edge]) -> dict[str, int]:
    """Layer of each box: the longest path to it, sample streams first, other sources just before their first user."""
    inputs, users = defaultdict(list), defaultdict(list)
    for edge in edges:
        inputs[edge.end].append(edge.start)
        users[edge.start].append(edge.end)
    level: dict[str, int] = {}
    for box in boxes:
        level[box.id] = max((level[name] + 1 for name in inputs[box.id]), default=0)
    for box in boxes:
        if not inputs[box.id] and not box.op.startswith("samples") and users[box.id]:
            level[box.id] = min(level[name] for name in users[box.id]) - 1
    return level


def lay_out(
    boxes: Sequence[Box],
    edges: Sequence[Edge],
    heights: Mapping[str, float],
    frame: Callable[[str], tuple[float, float]],
) -> GraphLayout:
    """Find the position, from top to bottom, of every box and of every edge where it passes a layer.

    Parameters
    ----------
    boxes : inputs before the nodes that need them
    heights : of the boxes, mm
    frame : of a process, mm: what its name takes above its boxes, what is kept free around them
    """
    return _LayoutSearch(boxes, edges, heights, frame).best()


class _LayoutSearch:
    """Searches the order and positions of clusters with few crossings and short edges."""

    def __init__(
        self,
        boxes: Sequence[Box],
        edges: Sequence[Edge],
        heights: Mapping[str, float],
        frame: Callable[[str], tuple[float, float]],
    ) -> None:
        self._level = levels(boxes, edges)
        self._heights: dict[Item, float] = {name: height for name, height in heights.items()}  # noqa: C416 (other keys)
        self._near: dict[Item, list[Item]] = defaultdict(list)
        self._segments: dict[int, list[tuple[Item, Item]]] = defaultdict(list)
        self._middle: dict[Item, float] = {}
        self._above: dict[int, list[Cluster]] = {}
        self._below: dict[int, list[Cluster]] = {}
        clusters: dict[str, Cluster] = {}
        process_of = {box.id: box.process for box in boxes}
        for box in boxes:
            if box.process not in clusters:
                head, pad = frame(box.process)
                clusters[box.process] = Cluster(process=box.process, head=head, pad=pad)
            clusters[box.process].rows[self._level[box.id]].append(box.id)
        self._clusters = list(clusters.values())
        for k, edge in enumerate(edges):
            inside = clusters[process_of[edge.start]] if process_of[edge.start] == process_of[edge.end] else None
            self._add_edge(k, edge, inside)
        for cluster in self._clusters:
            cluster.height = max(self._room(items) for items in cluster.rows.values()) + cluster.head + 2 * cluster.pad

    def _add_edge(self, number: int, edge: Edge, inside: Cluster | None) -> None:
        """Add an item for each layer an edge passes: in its process if both ends are in one, else in a new cluster."""
        first, last = self._level[edge.start], self._level[edge.end]
        chain: list[Item] = [edge.start, *((number, level) for level in range(first + 1, last)), edge.end]
        cluster = inside
        if cluster is None and len(chain) > 2:
            cluster = Cluster(process="", head=0.0, pad=0.0)
            self._clusters.append(cluster)
        for item in chain[1:-1]:
            assert cluster is not None
            assert isinstance(item, tuple)
            cluster.rows[item[1]].append(item)
            self._heights[item] = PASSING_EDGE
        for offset, (a, b) in enumerate(pairwise(chain)):
            self._near[a].append(b)
            self._near[b].append(a)
            self._segments[first + offset].append((a, b))

    def best(self) -> GraphLayout:
        """The best of some sweeps: fewest crossings, then shortest edges."""
        least, found = np.inf, {}
        order = self._clusters
        tops: dict[int, float] = {}
        for _ in range(SWEEPS):
            self._stack(order)
            for turn in range(RELAXATIONS):
                self._relax(order if turn % 2 else order[::-1])
                self._order_items()
            if (cost := self._cost()) < least - 1e-6:
                least, found = cost, dict(self._middle)
                tops = {id(cluster): cluster.top for cluster in order}
            order = sorted(self._clusters, key=self._barycentre)
        for cluster in self._clusters:
            cluster.top = tops[id(cluster)]
        high = min(cluster.top for cluster in self._clusters)
        for cluster in self._clusters:
            cluster.top -= high
        return GraphLayout(
            level=self._level,
            middle={item: y - high for item, y in found.items()},
            clusters=tuple(self._clusters),
            height=max(cluster.top + cluster.height for cluster in self._clusters),
        )

    def _room(self, items: Sequence[Item]) -> float:
        """Height of items above each other, mm."""
        return sum(self._heights[item] for item in items) + ROW_GAP * (len(items) - 1)

    def _stack(self, order: Sequence[Cluster]) -> None:
        """Put every cluster as far up as those before it in the order allow."""
        bottom: dict[int, Cluster] = {}
        self._above = defaultdict(list)
        self._below = defaultdict(list)
        for cluster in order:
            first, last = cluster.span
            above = {id(bottom[k]): bottom[k] for k in range(first, last + 1) if k in bottom}
            cluster.top = max(
                (other.top + other.height + _apart(other, cluster) for other in above.values()), default=0.0
            )
            for other in above.values():
                self._above[id(cluster)].append(other)
                self._below[id(other)].append(cluster)
            bottom.update(dict.fromkeys(range(first, last + 1), cluster))
        self._order_items()

    def _relax(self, turns: Sequence[Cluster]) -> None:
        """Move each cluster towards its neighbours as far as those above and below it allow."""
        for cluster in turns:
            low = max((a.top + a.height + _apart(a, cluster) for a in self._above[id(cluster)]), default=-np.inf)
            high = min((b.top - _apart(cluster, b) for b in self._below[id(cluster)]), default=np.inf)
            new = min(max(cluster.top + self._mean_offset(cluster), low), high - cluster.height)
            for items in cluster.rows.values():
                for item in items:
                    self._middle[item] += new - cluster.top
            cluster.top = new

    def _mean_offset(self, cluster: Cluster) -> float:
        """Mean distance by which its neighbours in other clusters are below it."""
        own = {item for items in cluster.rows.values() for item in items}
        away = [
            self._middle[other] - self._middle[item] for item in own for other in self._near[item] if other not in own
        ]
        return sum(away) / len(away) if away else 0.0

    def _barycentre(self, cluster: Cluster) -> int:
        """A cluster's barycentre, rounded so that clusters with nearly the same keep their order."""
        return round((cluster.top + cluster.height / 2 + self._mean_offset(cluster)) / ROW_GAP)

    def _order_items(self) -> None:
        """Order the items of each cluster by their neighbours, and put them as near to these as there is room."""
        for cluster in self._clusters:
            low, high = cluster.top + cluster.head + cluster.pad, cluster.top + cluster.height - cluster.pad
            for items in cluster.rows.values():
                for item in items:
                    self._middle.setdefault(item, (low + high) / 2)
                wanted = {item: self._neighbour_mean(item) for item in items}
                items.sort(key=lambda item: wanted[item])
                half = [self._heights[item] / 2 for item in items]
                steps = [*accumulate((a + b + ROW_GAP for a, b in pairwise(half)), initial=0.0)]
                level = _isotonic([wanted[item] - step for item, step in zip(items, steps, strict=True)])
                bottom = high - half[-1] - steps[-1]
                for item, base, step in zip(items, level, steps, strict=True):
                    self._middle[item] = min(max(base, low + half[0]), bottom) + step

    def _neighbour_mean(self, item: Item) -> float:
        """The mean position of an item's neighbours, its own if it has none."""
        near = [self._middle[other] for other in self._near[item] if other in self._middle]
        return sum(near) / len(near) if near else self._middle[item]

    def _cost(self) -> float:
        """The length of edges from top to bottom, mm, plus CROSSING_MM for each crossing."""
        cost = 0.0
        for segments in self._segments.values():
            a, b = np.array([(self._middle[start], self._middle[end]) for start, end in segments]).T
            crossings = np.count_nonzero(np.subtract.outer(a, a) * np.subtract.outer(b, b) < -1e-9) / 2
            cost += float(np.abs(a - b).sum()) + CROSSING_MM * crossings
        return cost


def _apart(above: Cluster, below: Cluster) -> float:
    """Distance between two clusters, mm: less between those without a frame."""
    return CLUSTER_GAP if above.pad or below.pad else ROW_GAP


def _isotonic(values: Sequence[float]) -> list[float]:
    """The non-decreasing sequence nearest to values, by pooling adjacent violators."""
    pools: list[list[float]] = []  # sum, count
    for value in values:
        pools.append([value, 1])
        while len(pools) > 1 and pools[-2][0] / pools[-2][1] > pools[-1][0] / pools[-1][1]:
            total, count = pools.pop()
            pools[-1][0] += total
            pools[-1][1] += count
    return [total / count for total, count in pools for _ in range(int(count))]
