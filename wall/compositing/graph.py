"""The compositing graph as a checked plan: what every node takes, gives and covers, and which rank runs it.

samples -> reconstruct -> framelets -> operators -> sinks. Values only; build.py makes them from a configuration.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Literal

from wall.config.graph import FrameSync, SinkNode
from wall.core.data import CHANNELS, Channels, Rect, Region
from wall.geometry.panels import Wall, of_fewer_pixels
from wall.geometry.regions import panel_regions
from wall.geometry.strips import Strips
from wall.operators.base import Node


@dataclass(frozen=True, slots=True, kw_only=True)
class Layer:
    """A samples node with its reconstruct node: samples of one panel, and the framelet made of them."""

    index: int  # in Graph.layers
    samples: str  # ids of the two nodes
    node: str
    panel: int  # index in Wall.viewports: where it is shown
    traced: int  # index in Wall.traced: whose pixels its samples are of
    view: int  # that it shows
    ranks: tuple[int, ...]  # who renders it
    range: tuple[float, float] | None  # of the scene's objects; None: all
    transparent: bool  # where nothing is
    reprojects: bool  # its samples move with camera and objects, whichever sampler chose them
    compositor: int  # rank that reconstructs it
    scale: float = 1.0  # pixels of what is traced, over those of what is shown, in each direction
    samples_hz: float | None = None  # whole images a second that are traced at most; None: no limit
    refresh_hz: float | None = None  # reconstructed so often at most, and moved between; None: at every refresh

    @property
    def objects(self) -> str:
        """Which of the scene's objects it has, to follow another word; "" for all."""
        return "" if self.range is None else f", objects {self.range[0]:.0%} to {self.range[1]:.0%}"

    @property
    def of_its_own(self) -> bool:
        """Whether it is reconstructed at a rate or a resolution of its own, and so not what is shown."""
        return self.scale < 1.0 or self.refresh_hz is not None

    @property
    def at_renderer(self) -> bool:
        """Whether the rank that renders it reconstructs it too: then its samples do not travel."""
        return self.compositor in self.ranks


@dataclass(frozen=True, slots=True, kw_only=True)
class Step:
    """A planned node that gives a framelet or shows one."""

    index: int  # in Graph.steps: its name on the wire
    node: Node
    inputs: tuple[int, ...]  # indices of steps
    rank: int  # of the compositor that does it
    rect: Rect  # in the frame
    channels: Channels
    encoded: bool  # its colour is display bytes
    computes: bool  # with light; else it moves values, or makes bytes itself
    order: int
    panels: tuple[int, ...]  # viewports whose pixels it holds; a sink: panels that it shows whole
    users: tuple[int, ...] = ()  # indices of steps
    apart: bool = False  # it lays images of one panel over each other that several processes make, each when it can

    @property
    def common_time(self) -> bool:
        """Whether its inputs must show one moment."""
        return self.node.COMMON_TIME or self.apart


@dataclass(frozen=True, slots=True, kw_only=True)
class Graph:
    """A checked graph. Rank 0 is the head (a compositor); then come other compositors, then renderers."""

    nodes: tuple[Node, ...]  # inputs before those who need them
    steps: tuple[Step, ...]  # likewise; samples nodes are in layers
    layers: tuple[Layer, ...]  # in the order of the panels, then the insets
    compositors: int  # the head among them
    hosts: dict[int, str] = field(default_factory=dict)  # wanted machines, by rank
    sync: FrameSync | Literal["none"] = "none"
    balanced: bool = False  # regions are strips, and move with what they cost

    def with_panels_of_layers(self, wall: Wall) -> Wall:
        """The wall with a panel for each layer that is not traced as the panel that shows it."""
        own = {layer.traced: layer for layer in self.layers if layer.traced != layer.panel}
        panels = (replace(of_fewer_pixels(wall.viewports[own[k].panel], own[k].scale), index=k) for k in sorted(own))
        return replace(wall, of_layers=tuple(panels))

    def regions(self, wall: Wall) -> tuple[tuple[Region, ...], ...]:
        """The regions of every renderer, in rank order: one of each layer that it renders.

        Raises ConfigError: regions too large, or too many ranks.
        """
        if self.balanced:
            strips = self.strips(wall)
            return strips.regions(strips.evenly(self.renderers))
        found: dict[int, list[Region]] = {}
        for layer in self.layers:
            rects = panel_regions(wall.traced[layer.traced], len(layer.ranks))
            for rank, rect in zip(layer.ranks, rects, strict=True):
                region = Region(layer=layer.index, panel=layer.traced, rect=rect, view=layer.view)
                found.setdefault(rank, []).append(region)
        return tuple(tuple(found[rank]) for rank in sorted(found))

    def strips(self, wall: Wall) -> Strips:
        """The layers as panels that strips are cut of."""
        whole = [
            Region(layer=layer.index, panel=layer.traced, rect=rect, view=layer.view)
            for layer in self.layers
            for rect in panel_regions(wall.traced[layer.traced], 1)
        ]
        return Strips(tuple(whole))

    @property
    def renderers(self) -> int:
        """How many ranks render."""
        return len({rank for layer in self.layers for rank in layer.ranks})

    @property
    def sinks(self) -> tuple[SinkNode, ...]:
        """All sink nodes."""
        return tuple(node for node in self.nodes if isinstance(node, SinkNode))

    @property
    def page_rank(self) -> int:
        """The compositor that serves the page; the head where there is none."""
        pages = (step for step in self.steps if isinstance(step.node, SinkNode) and step.node.kind == "browser")
        return next((step.rank for step in pages), 0)

    @property
    def rank_of(self) -> dict[str, int]:
        """The rank on which each node's work is done; of a samples node the first of its renderers."""
        renderers = {layer.samples: layer.ranks[0] for layer in self.layers}
        return renderers | {step.node.id: step.rank for step in self.steps}

    def step(self, node_id: str) -> Step:
        """KeyError if there is none of that id."""
        for step in self.steps:
            if step.node.id == node_id:
                return step
        raise KeyError(node_id)

    def panels_followed(self) -> tuple[int | None, ...]:
        """Of every step, the panel whose rays its pixels follow; None: several panels', or turned, scaled or bent."""
        kept: list[bool] = []
        for step in self.steps:
            kept.append(step.node.KEEPS_RAYS and all(kept[k] for k in step.inputs))
        return tuple(s.panels[0] if kept[s.index] and len(s.panels) == 1 else None for s in self.steps)

    def beyond_bytes(self, layer: Layer) -> tuple[str, ...]:
        """What is needed of a layer beside display bytes, in words. Renderers make layers of which nothing else is."""
        step = self.step(layer.node)
        light = () if step.encoded else ("linear light",)
        clear = ("a transparent background",) if layer.transparent else ()
        small = ("light that is enlarged",) if layer.scale < 1.0 else ()
        slow = ("depth by which it is moved",) if layer.refresh_hz is not None else ()
        return (*light, *(name for name in CHANNELS if name in step.channels - {"colour"}), *clear, *small, *slow)

    def fields_of(self, layer: Layer) -> tuple[bool, bool]:
        """Whether anything is made of the depths of a layer's samples, and of their objects, where they stay in place.

        Samples that are reprojected, as all of the adaptive sampler, need both.
        """
        channels, moved = self.step(layer.node).channels, layer.reprojects or layer.refresh_hz is not None
        return moved or "depth" in channels, moved or layer.transparent or "object_id" in channels

    def layer_of(self, rank: int) -> Layer:
        """The first layer that a renderer renders; KeyError if it is none."""
        for layer in self.layers:
            if rank in layer.ranks:
                return layer
        raise KeyError(rank)

    def sinks_on(self, rank: int) -> tuple[Step, ...]:
        """The sinks that a compositor runs."""
        return tuple(step for step in self.steps if step.rank == rank and isinstance(step.node, SinkNode))

    def reconstructed_at(self, rank_of: Mapping[int, int]) -> Graph:
        """The same graph with some layers reconstructed elsewhere: ranks by index of layer."""
        layers = tuple(replace(layer, compositor=rank_of.get(layer.index, layer.compositor)) for layer in self.layers)
        moved = {layer.node: layer.compositor for layer in layers}
        steps = tuple(replace(step, rank=moved.get(step.node.id, step.rank)) for step in self.steps)
        return replace(self, layers=layers, steps=steps)

    def layers_on(self, rank: int) -> tuple[Layer, ...]:
        """The layers that a compositor reconstructs."""
        return tuple(layer for layer in self.layers if layer.compositor == rank)

    def has_sink(self, kind: str) -> bool:
        """Whether there is a sink of a kind."""
        return any(sink.kind == kind for sink in self.sinks)

    @property
    def plain(self) -> bool:
        """Whether every panel's samples are its image, but for lines around, and the sinks show just those."""
        ops, panels = {step.node.op_name for step in self.steps}, {layer.panel for layer in self.layers}
        as_traced = not any(layer.of_its_own for layer in self.layers)
        return ops <= {"reconstruct", "outline", "tile", "sink"} and len(panels) == len(self.layers) and as_traced
