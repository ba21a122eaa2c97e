"""The interface of operators: a node of the YAML that declares its channels and writes regions of its output.

Pure: framelets in, pixels of one framelet out; no clock, no I/O but what `prepare` reads once. An operator does not
know in which process it runs, or which part of its input changed.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from functools import reduce
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, NamedTuple, Self

from annotated_types import Ge, Le
from pydantic import BeforeValidator, Field, model_validator

from wall.core.data import Channels, Framelet, Rect
from wall.core.fields import Model, Name, Text, Whole, refusal

Input = Annotated[Name, Field(description="id of the node whose framelet it takes")]
Inputs = Annotated[tuple[Name, ...], Field(min_length=1, max_length=4096, description="ids of nodes")]
Several = Annotated[tuple[Name, ...], Field(min_length=2, max_length=4096, description="ids of nodes, two or more")]
Coordinate = Annotated[Whole, Ge(-(1 << 20)), Le(1 << 20)]
Extent = Annotated[Whole, Ge(1), Le(1 << 20)]
Area = tuple[Coordinate, Coordinate, Extent, Extent]  # x, y, width, height in the frame, pixels


def _compositor(value: Any) -> Any:
    return f"compositor {value}" if isinstance(value, int) and not isinstance(value, bool) else value


OnRank = Annotated[Text, BeforeValidator(_compositor, json_schema_input_type=Text | Whole)]


class Node(Model):
    """A node of the compositing graph: its id, and where it runs."""

    id: Name = Field(description="name of the node")
    on: OnRank | None = Field(
        default=None,
        description="where it runs: head, panel, rank N, host NAME or compositor N; absent = where its first input is. "
        "A reconstruct node also: renderer; a samples node only: host NAME",
    )

    TAKES: ClassVar[Literal["nothing", "samples", "framelet"]] = "framelet"
    GIVES: ClassVar[Literal["nothing", "samples", "framelet"]] = "framelet"
    MAKES: ClassVar[Channels] = frozenset()  # that its output always holds: it needs them for its own work
    KEEPS_RAYS: ClassVar[bool] = True  # a pixel keeps the ray of its panel's pixel: no turning, scaling or warping
    COMMON_TIME: ClassVar[bool] = False  # it compares values, so all inputs must show the same time

    @property
    def op_name(self) -> str:
        """The word that `op:` has in the YAML."""
        return str(getattr(self, "op", type(self).__name__))

    @property
    def sources(self) -> tuple[str, ...]:
        """Ids of the nodes that it takes from, in order."""
        one, several = getattr(self, "input", None), getattr(self, "inputs", ())
        return (one, *several) if one is not None else tuple(several)


class Setting(NamedTuple):
    """A number of a node that can be changed while the wall runs: the key that configures it, and its range."""

    key: str
    low: float
    high: float
    unit: str


class Following(ABC):
    """What a node has prepared whose pixels change by themselves: with its settings, or as files are read."""

    @abstractmethod
    def follow(self, values: Mapping[str, float]) -> bool:
        """Take in its settings that are not as configured, by key. Returns whether all is to be made anew."""

    @property
    @abstractmethod
    def waits(self) -> bool:
        """Whether something is under way that will change its pixels."""

    @property
    @abstractmethod
    def failures(self) -> tuple[str, ...]:
        """What could not be had for them, in words."""

    @abstractmethod
    def close(self) -> None:
        """End what is under way; nobody asks for its pixels any more."""


class Operator(Node):
    """A node that makes one framelet from others. A package names its own in entry points `wall.operators`."""

    NEEDS: ClassVar[Channels] = frozenset({"colour"})  # of every input
    USES: ClassVar[Channels] = frozenset()  # of any input that has them
    LOSES: ClassVar[Channels] = frozenset()  # that its output cannot have: variance, where it is not linear
    SETTINGS: ClassVar[tuple[Setting, ...]] = ()  # what it has prepared is a Following then
    MOVES: ClassVar[bool] = False  # it copies values unchanged, so it takes linear and encoded colour alike
    ONE_OF: ClassVar[tuple[str, str, str] | None] = None  # two keys of which it has exactly one, and what that may be

    @model_validator(mode="after")
    def _has_one_of_two(self) -> Self:
        if self.ONE_OF is not None:
            one, other, accepted = self.ONE_OF
            if (getattr(self, one) is None) == (getattr(self, other) is None):
                article = "an" if one[0] in "aeiou" else "a"
                raise refusal(f"needs either {article} {one} or a {other}", accepted=accepted)
        return self

    def rect(self, inputs: Sequence[Rect]) -> Rect:
        """The rectangle of its output in the frame."""
        return reduce(Rect.join, inputs)

    def gives(self, inputs: Sequence[Channels]) -> Channels:
        """The channels of its output, for inputs with these channels."""
        return (frozenset.intersection(*inputs) | self.MAKES) - self.LOSES

    def moves(self, inputs: Sequence[Channels]) -> bool:
        """MOVES, for inputs with these channels."""
        return self.MOVES

    def touched(self, rect: Rect, inputs: Sequence[Rect], k: int) -> Rect:
        """The rectangle of the output that changes with `rect` of input k."""
        return rect

    def covers(self, rect: Rect, inputs: Sequence[Rect], k: int) -> tuple[Rect, ...]:
        """Where the output has pixels if input k has them in `rect`: less than `touched` if it removes some."""
        return (self.touched(rect, inputs, k),)

    def prepare(self, folder: Path, inputs: Sequence[Rect]) -> Any:
        """Read what it needs, once, for inputs that lie at these rectangles; relative paths start at `folder`.

        Raises ConfigError, at plan time, where a file is missing, wrong, or of another size than it must have.
        """
        return None

    def apply(self, inputs: Sequence[Framelet], out: Framelet, region: Rect, prepared: Any) -> None:
        """Write the pixels of `region` (frame coordinates, inside out.rect), in every channel that `out` has.

        `prepared` is what `prepare` gave. The same pixels come out however the output is cut into regions.
        """
        raise NotImplementedError


class AreaOperator(Operator):
    """An operator whose output is an area of the frame, given in pixels or by a panel's id."""

    area: Area | None = Field(default=None, description="x, y, width, height in the frame, pixels")
    panel: Name | None = Field(default=None, description="id of the panel whose pixels it covers, instead of an area")

    ONE_OF: ClassVar[tuple[str, str, str] | None] = ("area", "panel", "area: [x, y, width, height] or panel: ID")


def area_rect(area: Area) -> Rect:
    """The rectangle of an area."""
    x, y, width, height = area
    return Rect(x=x, y=y, width=width, height=height)
