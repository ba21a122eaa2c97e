"""What a drawing shows, whatever it was made of: screens in space, boxes, and wires between them."""

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
    """One panel, or several that light the same place, such as those of both eyes."""

    id: str
    pixels: tuple[int, int]
    corners: Float64  # (3, 3) rows lower left, lower right, upper left of the lit area; metres, wall frame
    bezel: tuple[float, float, float, float]  # left, right, top, bottom, metres
    eyes: tuple[Float64, ...]  # (3,) metres, wall frame: from where it is seen
    notes: tuple[str, ...] = ()  # further lines of its label
    place: str = ""  # where its picture is made; "" = several places or none
    panels: tuple[str, ...] = ()  # ids of all that light it, where they are more than its own

    def shares_eye(self, other: Screen) -> bool:
        """Whether one eye looks at both."""
        return any(bool((a == b).all()) for a in self.eyes for b in other.eyes)


@dataclass(frozen=True, slots=True, kw_only=True)
class Place:
    """A process, or the ranks that share one piece of work."""

    label: str
    detail: str  # ranks, host
    role: Role
    count: int = 1  # processes drawn as one


@dataclass(frozen=True, slots=True, kw_only=True)
class Box:
    """A node of the graph, or `count` alike ones drawn as one."""

    id: str
    op: str
    detail: str
    place: str  # key of Sketch.places
    title: str = ""  # instead of the id
    source: bool = False
    sink: bool = False
    count: int = 1


@dataclass(frozen=True, slots=True, kw_only=True)
class Wire:
    """An edge, or `count` edges drawn as one."""

    start: str  # Box.id
    end: str
    bytes_per_s: float  # of all of them together; 0 = a call inside a process
    crosses: bool  # from process to process
    count: int = 1


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Sketch:
    """All that a drawing shows."""

    name: str
    size: tuple[int, int]  # of the whole wall, pixels
    screens: tuple[Screen, ...]
    places: Mapping[str, Place]  # in the order of their ranks
    boxes: tuple[Box, ...]  # inputs before those who need them
    wires: tuple[Wire, ...]
    remarks: tuple[str, ...]  # what the figures assume

    def incoming(self) -> dict[str, float]:
        """Bytes/s that come into each place from others."""
        place_of = {box.id: box.place for box in self.boxes}
        found: dict[str, float] = defaultdict(float)
        for wire in self.wires:
            if wire.crosses:
                found[place_of[wire.end]] += wire.bytes_per_s
        return found
