"""The data of a drawing: screens in space, boxes of graph nodes, and edges between them."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from wall.core.data import Float64

TIMES, TO, MINUS = "\N{MULTIPLICATION SIGN}", "\N{EN DASH}", "\N{MINUS SIGN}"

Role = Literal["head", "compositor", "renderer"]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Screen:
    """One panel, or several at the same position, such as those of both eyes."""

    id: str
    pixels: tuple[int, int]
    corners: Float64  # (3, 3) rows lower left, lower right, upper left of the lit area; metres, wall frame
    bezel: tuple[float, float, float, float]  # left, right, top, bottom, metres
    eyes: tuple[Float64, ...]  # (3,) metres, wall frame: the eyes that look at it
    notes: tuple[str, ...] = ()  # further lines of its label
    process: str = ""  # that makes its image; "" = several processes or none
    panels: tuple[str, ...] = ()  # ids of its panels, where there are several
    arc: Float64 | None = None  # (n, 3) metres, wall frame: around what shines, if it is curved; corners are on it

    def shares_eye(self, other: Screen) -> bool:
        """Whether one eye looks at both."""
        return any(bool((a == b).all()) for a in self.eyes for b in other.eyes)


@dataclass(frozen=True, slots=True, kw_only=True)
class Process:
    """A process, or the ranks that share one piece of work."""

    label: str
    detail: str  # ranks, host
    role: Role
    count: int = 1  # processes drawn as one


@dataclass(frozen=True, slots=True, kw_only=True)
class Box:
    """A node of the graph, or `count` equivalent ones drawn as one."""

    id: str
    op: str
    detail: str
    process: str  # key of Diagram.processes
    title: str = ""  # instead of the id
    source: bool = False
    sink: bool = False
    count: int = 1


@dataclass(frozen=True, slots=True, kw_only=True)
class Edge:
    """An edge, or `count` edges drawn as one."""

    start: str  # Box.id
    end: str
    bytes_per_s: float  # of all of them together; 0 = a call inside a process
    crosses: bool  # from process to process
    count: int = 1


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Diagram:
    """Everything that a drawing shows."""

    name: str
    size: tuple[int, int]  # of the whole wall, pixels
    screens: tuple[Screen, ...]
    processes: Mapping[str, Process]  # in the order of their ranks
    boxes: tuple[Box, ...]  # inputs before the nodes that need them
    edges: tuple[Edge, ...]
    assumptions: tuple[str, ...]  # what the figures assume

    def incoming(self) -> dict[str, float]:
        """Bytes/s that come into each process from others."""
        process_of = {box.id: box.process for box in self.boxes}
        found: dict[str, float] = defaultdict(float)
        for edge in self.edges:
            if edge.crosses:
                found[process_of[edge.end]] += edge.bytes_per_s
        return found
