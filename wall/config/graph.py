"""`graph:` how samples become pictures: a preset, or nodes. compositing/graph.py checks the DAG."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from annotated_types import Ge, Le
from pydantic import BeforeValidator, Discriminator, Field, Tag

from wall.fields import Model, Name, Whole

SinkKind = Literal["browser", "png", "recorder"]
Ranks = Annotated[Whole, Ge(1), Le(1024)]


class SamplesNode(Model):
    """Samples of one panel, traced by one or more ranks."""

    op: Literal["samples"] = Field(description="samples of one panel")
    id: Name = Field(description="name of the node")
    panel: Name = Field(description="id of the panel")
    ranks: Ranks = Field(default=1, description="ranks that share the panel; each renders a part of it")


class ReconstructNode(Model):
    """Samples to a framelet."""

    op: Literal["reconstruct"] = Field(description="samples to a framelet of the panel")
    id: Name = Field(description="name of the node")
    input: Name = Field(description="id of a samples node")
    filter: Literal["newest"] = Field(default="newest", description="newest: every pixel shows its newest sample")
    on: Annotated[Whole, Ge(0), Le(1023)] = Field(default=0, description="which compositor does it; 0 is the head")


class TileNode(Model):
    """Framelets side by side to one picture."""

    op: Literal["tile"] = Field(description="framelets side by side to a picture")
    id: Name = Field(description="name of the node")
    inputs: Annotated[tuple[Name, ...], Field(min_length=1, max_length=1024)] = Field(
        description="ids of reconstruct nodes"
    )


class SinkNode(Model):
    """Where a picture ends."""

    op: Literal["sink"] = Field(description="where a picture ends")
    id: Name = Field(description="name of the node")
    kind: SinkKind = Field(
        description="browser: the live page; png: pictures at the end; recorder: a numbered sequence"
    )
    input: Name = Field(description="id of a tile node")


NodeConfig = Annotated[SamplesNode | ReconstructNode | TileNode | SinkNode, Field(discriminator="op")]


class PresetGraph(Model):
    """A graph that is built from the wall's panels."""

    preset: Literal["sort-first"] = Field(
        default="sort-first",
        description="sort-first: every panel has its own ranks, one picture of all panels",
    )
    ranks_per_panel: Ranks = Field(default=1, description="renderers that share one panel")
    compositors: Ranks = Field(default=1, description="processes that fold samples into pictures, the head among them")
    sinks: Annotated[tuple[SinkKind, ...], Field(min_length=1, max_length=3)] = Field(
        default=("browser", "png"), description="where the pictures end"
    )


class NodeGraph(Model):
    """A graph written out node by node."""

    compositors: Ranks = Field(default=1, description="processes that fold samples into pictures, the head among them")
    nodes: Annotated[tuple[NodeConfig, ...], Field(min_length=1, max_length=4096)] = Field(
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
    BeforeValidator(_spelled_out, json_schema_input_type=Literal["sort-first"] | PresetGraph | NodeGraph),
]
