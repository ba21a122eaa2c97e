"""What an operator is: a node of the YAML that says what it takes and gives, and writes a part of its output.

Pure: framelets in, pixels of one framelet out; no clock, no I/O but what `prepare` reads once. Nothing here knows in
which process it runs, or which part of its input changed.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

from annotated_types import Ge, Le
from pydantic import BeforeValidator, Field

from wall.core.data import Channels, Framelet, Rect
from wall.core.fields import Model, Name, Text, Whole

Input = Annotated[Name, Field(description="id of the node whose framelet it takes")]
Inputs = Annotated[tuple[Name, ...], Field(min_length=1, max_length=4096, description="ids of nodes")]
Several = Annotated[tuple[Name, ...], Field(min_length=2, max_length=4096, description="ids of nodes, two or more")]
Coordinate = Annotated[Whole, Ge(-(1 << 20)), Le(1 << 20)]
Extent = Annotated[Whole, Ge(1), Le(1 << 20)]
Area = tuple[Coordinate, Coordinate, Extent, Extent]  # x, y, width, height in the frame, pixels


def _compositor(value: Any) -> Any:
    return f"compositor {value}" if isinstance(value, int) and not isinstance(value, bool) else value


Place = Annotated[Text, BeforeValidator(_compositor, json_schema_input_type=Text | Whole)]


class Node(Model):
    """What every node of a graph has."""

    id: Name = Field(description="name of the node")
    on: Place | None = Field(
        default=None,
        description="where it runs: head, panel, rank N, host NAME or compositor N; absent = where its first input is",
    )

    TAKES: ClassVar[Literal["nothing", "samples", "framelet"]] = "framelet"
    GIVES: ClassVar[Literal["nothing", "samples", "framelet"]] = "framelet"

    @property
    def sources(self) -> tuple[str, ...]:
        """Ids of the nodes that it takes from, in order."""
        one, several = getattr(self, "input", None), getattr(self, "inputs", ())
        return (one, *several) if one is not None else tuple(several)


class Operator(Node):
    """A node that makes one framelet of others. Derive from it, and name it in the entry points `wall.operators`."""

    NEEDS: ClassVar[Channels] = frozenset({"colour"})  # of every input
    USES: ClassVar[Channels] = frozenset()  # of any input that has them
    MAKES: ClassVar[Channels] = frozenset()  # that its output holds whoever needs them: it works by them
    MOVES: ClassVar[bool] = False  # values come out as they went in: it takes linear and encoded colour alike
    KEEPS_RAYS: ClassVar[bool] = True  # its pixels are seen where their panel's are: it does not turn, scale or bend
    COMMON_TIME: ClassVar[bool] = False  # it compares values, which must show one moment

    def rect(self, inputs: Sequence[Rect]) -> Rect:
        """Where its output lies in the frame."""
        joined = inputs[0]
        for rect in inputs[1:]:
            joined = joined.join(rect)
        return joined

    def gives(self, inputs: Sequence[Channels]) -> Channels:
        """The channels that it can give of inputs with these."""
        return frozenset.intersection(*inputs)

    def moves(self, inputs: Sequence[Channels]) -> bool:
        """MOVES, for inputs with these channels."""
        return self.MOVES

    def touched(self, rect: Rect, inputs: Sequence[Rect], k: int) -> Rect:
        """What of the output changes with `rect` of input k."""
        return rect

    def covers(self, rect: Rect, inputs: Sequence[Rect], k: int) -> tuple[Rect, ...]:
        """Where the output shows something if input k does so in `rect`: less than `touched` if it takes some away."""
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
