"""Models of `graph:`, the compositing graph: a preset, or nodes. compositing/ checks it and plans where nodes run.

Nodes that make framelets of framelets are operators: each describes itself in wall/operators.
"""

from __future__ import annotations

from functools import reduce
from operator import or_
from typing import Annotated, Any, ClassVar, Literal

from annotated_types import Ge, Gt, Le
from pydantic import BeforeValidator, Discriminator, Field, Tag, model_validator

from wall.core.fields import Model, Name, Number, Order, RefreshRate, Share, Whole, refusal
from wall.operators.base import Input, Node
from wall.operators.registry import OPERATORS, plugins

SinkKind = Literal["browser", "png", "recorder", "window"]
MAX_NODES = 65535  # their numbers travel as two bytes
Ranks = Annotated[Whole, Ge(1), Le(1024)]
Rank = Annotated[Whole, Ge(0), Le(65535)]
Scale = Annotated[Number, Gt(0.0), Le(1.0)]


class SamplesNode(Node):
    """Samples of one panel, traced by one or more ranks; of all objects, or of a part of them."""

    op: Literal["samples"] = Field(description="samples of one panel")
    panel: Name = Field(description="id of the panel, or of an inset: PANEL.VIEW")
    ranks: Ranks | None = Field(
        default=None, description="ranks that share the panel, each renders a part of it; absent = 1, or all of `group`"
    )
    rank: Rank | None = Field(default=None, description="the one rank that renders it, by its number")
    group: Name | None = Field(default=None, description="a group of graph.groups that renders it")
    ranks_of: Name | None = Field(
        default=None,
        description="another samples node, of another view: its ranks render this too, and share their time by the "
        "views' weights",
    )
    range: tuple[Share, Share] | None = Field(
        default=None,
        description="part of the scene's objects that is seen, such as [0, 0.5]: by triangles, in the scene's order; "
        "all of them cast shadows",
    )
    scale: Scale = Field(
        default=1.0,
        description="pixels that are traced, a share of the panel's in each direction; its reconstruct node enlarges",
    )
    refresh_hz: RefreshRate | None = Field(
        default=None, description="as many samples a second as so many whole images have, at most; absent = no limit"
    )

    TAKES: ClassVar[Literal["nothing", "samples", "framelet"]] = "nothing"
    GIVES: ClassVar[Literal["nothing", "samples", "framelet"]] = "samples"

    @model_validator(mode="after")
    def _names_ranks_once(self) -> SamplesNode:
        if self.rank is not None and (self.group is not None or self.ranks is not None):
            raise refusal("names one rank, and others beside", accepted="one of rank, group, ranks", at=("rank",))
        if self.ranks_of is not None and (self.rank, self.group, self.ranks) != (None, None, None):
            raise refusal("says who renders it a second time", accepted="ranks_of alone", at=("ranks_of",))
        if self.range is not None and not self.range[0] < self.range[1]:
            raise refusal("holds nothing", accepted="[from, to] with from < to, both from 0 to 1", at=("range",))
        return self


class ReconstructNode(Node):
    """Reconstructs a framelet from samples."""

    op: Literal["reconstruct"] = Field(description="samples to a framelet of the panel")
    input: Input
    background: Literal["keep", "transparent"] = Field(
        default="keep", description="transparent: the sky has alpha 0, and colours are times alpha"
    )
    order: Order | None = Field(default=None, description="for `over`: the smaller is the nearer")
    refresh_hz: RefreshRate | None = Field(
        default=None,
        description="reconstructed so often a second at most, fewer times than its view is shown; between, its pixels "
        "go with camera and objects. Absent = at every refresh",
    )

    TAKES: ClassVar[Literal["nothing", "samples", "framelet"]] = "samples"


class SkyNode(Node):
    """The sky as a panel sees it, behind layers without a background."""

    op: Literal["sky"] = Field(description="the sky as a panel sees it")
    panel: Name = Field(description="id of the panel")
    order: Order | None = Field(default=None, description="for `over`")

    TAKES: ClassVar[Literal["nothing", "samples", "framelet"]] = "nothing"


class SinkNode(Node):
    """Shows or stores images: window, page or files."""

    op: Literal["sink"] = Field(description="where an image ends")
    kind: SinkKind = Field(
        description="browser: the live page; png: images at the end; recorder: a numbered sequence; window: full "
        "screen on the panel's display"
    )
    input: Input

    GIVES: ClassVar[Literal["nothing", "samples", "framelet"]] = "nothing"


_KINDS: list[type[Node]] = [SamplesNode, ReconstructNode, SkyNode, SinkNode, *OPERATORS.values(), *plugins().values()]
_AnyNode: Any = Annotated[reduce(or_, _KINDS), Field(discriminator="op")]


class FrameSync(Model):
    """Classic compositing in lock step: a frame is shown when all of it is there, and then the next one begins."""

    mode: Literal["frame"] = Field(description="frame: in lock step")
    timeout_s: Annotated[Number, Ge(0.01), Le(60.0)] = Field(
        default=0.5, description="seconds that a frame waits for its last part; a part that is late is shown as it was"
    )


def _mode_alone(value: Any) -> Any:
    return {"mode": value} if value == "frame" else value


Sync = Annotated[
    Literal["none"] | FrameSync,
    BeforeValidator(_mode_alone, json_schema_input_type=Literal["none", "frame"] | FrameSync),
    Field(description="none: whatever came is shown; frame: every panel shows the same numbered frame"),
]


class PresetGraph(Model):
    """A graph that is built from the wall's panels."""

    preset: Literal["sort-first", "sort-last"] = Field(
        default="sort-first",
        description="sort-first: every panel has its own ranks, one image of all panels; sort-last: a panel's ranks "
        "each render a part of the objects, the nearest wins",
    )
    ranks_per_panel: Ranks = Field(default=1, description="renderers that share one panel")
    renderers: Literal["anywhere", "panel"] = Field(
        default="anywhere", description="panel: those of a panel run on its `host`, where it names one"
    )
    compositors: Ranks = Field(default=1, description="processes that fold samples into images, the head among them")
    sync: Sync = Field(default="none")
    balance: bool = Field(
        default=False,
        description="whether borders between renderers, of all panels, follow what rendering costs; for sort-first, "
        "one view, sync: none",
    )
    sinks: Annotated[tuple[SinkKind, ...], Field(min_length=1, max_length=4)] = Field(
        default=("browser", "png"), description="where the images end"
    )


class NodeGraph(Model):
    """A graph written out node by node."""

    compositors: Ranks = Field(default=1, description="processes that fold samples into images, the head among them")
    sync: Sync = Field(default="none")
    groups: dict[Name, Annotated[tuple[Rank, ...], Field(min_length=1, max_length=1024)]] = Field(
        default={}, description="renderers by number, under a name"
    )
    nodes: Annotated[tuple[_AnyNode, ...], Field(min_length=1, max_length=MAX_NODES)] = Field(
        description="nodes in any order"
    )


def _spelled_out(value: Any) -> Any:
    return {"preset": value} if isinstance(value, str) else value


def _kind_of(value: Any) -> str:
    nodes = "nodes" in value if isinstance(value, dict) else isinstance(value, NodeGraph)
    return "<nodes>" if nodes else "<preset>"


_Graph = Annotated[
    Annotated[PresetGraph, Tag("<preset>")] | Annotated[NodeGraph, Tag("<nodes>")], Discriminator(_kind_of)
]
GraphConfig = Annotated[
    _Graph,
    BeforeValidator(_spelled_out, json_schema_input_type=Literal["sort-first", "sort-last"] | PresetGraph | NodeGraph),
]
