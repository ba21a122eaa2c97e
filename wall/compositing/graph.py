"""The compositing graph, checked and planned: what every node takes, gives and covers, and where it runs.

samples -> reconstruct -> framelets -> operators -> sinks. A pure function of the configuration, so that every rank
works it out alone and all agree. Errors point to the node in the YAML file.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from graphlib import CycleError, TopologicalSorter
from typing import Literal

from wall.compositing.channels import computes, find_channels, find_encoded, find_orders
from wall.compositing.covering import Covering, panel_rect, panels_shown
from wall.compositing.placement import Placement
from wall.compositing.presets import expanded
from wall.compositing.ranks import number_ranks
from wall.compositing.refusals import Refusals
from wall.compositing.structure import check_structure, in_order, input_path
from wall.compositing.windows import with_windows
from wall.config.graph import MAX_NODES
from wall.config.loading import Loaded, nearest
from wall.config.schema import (
    FrameSync,
    NodeConfig,
    NodeGraph,
    PresetGraph,
    ReconstructNode,
    SamplesNode,
    SinkNode,
)
from wall.core.data import CHANNELS, Channels, Rect
from wall.geometry.panels import Wall
from wall.geometry.regions import Source
from wall.operators.base import Operator


@dataclass(frozen=True, slots=True, kw_only=True)
class Layer:
    """Samples of one panel and the framelet they make: a samples node with its reconstruct node."""

    index: int  # in Graph.layers
    samples: str  # ids of the two nodes
    node: str
    panel: int  # index in Wall.panels
    ranks: tuple[int, ...]  # who renders it
    range: tuple[float, float] | None  # of the scene's objects; None: all
    transparent: bool  # where nothing is
    reprojects: bool  # its samples move with camera and objects, whichever sampler chose them
    compositor: int  # rank that reconstructs it


@dataclass(frozen=True, slots=True, kw_only=True)
class Step:
    """A node that gives a framelet or ends one, and what the planner found out about it."""

    index: int  # in Graph.steps: its name on the wire
    node: NodeConfig
    inputs: tuple[int, ...]  # indices of steps
    rank: int  # of the compositor that does it
    rect: Rect  # in the frame
    channels: Channels
    encoded: bool  # its colour is display bytes
    computes: bool  # with light; else it moves values, or makes bytes itself
    order: int
    panels: tuple[int, ...]  # whose pixels it holds; a sink: which it shows whole
    users: tuple[int, ...] = ()  # indices of steps


@dataclass(frozen=True, slots=True, kw_only=True)
class Graph:
    """A checked graph. Ranks: 0 is the head (a compositor), then other compositors, then renderers."""

    nodes: tuple[NodeConfig, ...]  # inputs before those who need them
    steps: tuple[Step, ...]  # likewise; samples nodes are in layers
    layers: tuple[Layer, ...]  # in the order of the panels
    compositors: int  # the head among them
    hosts: dict[int, str] = field(default_factory=dict)  # wanted machines, by rank
    sync: FrameSync | Literal["none"] = "none"

    @property
    def sources(self) -> tuple[Source, ...]:
        return tuple(Source(layer=layer.index, panel=layer.panel, ranks=layer.ranks) for layer in self.layers)

    @property
    def renderers(self) -> int:
        return sum(len(layer.ranks) for layer in self.layers)

    @property
    def ranks_needed(self) -> int:
        """One head, the other compositors, and every renderer."""
        return self.compositors + self.renderers

    @property
    def sinks(self) -> tuple[SinkNode, ...]:
        return tuple(node for node in self.nodes if isinstance(node, SinkNode))

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
            own = not isinstance(step.node, Operator) or step.node.KEEPS_RAYS
            kept.append(own and all(kept[k] for k in step.inputs))
        return tuple(s.panels[0] if kept[s.index] and len(s.panels) == 1 else None for s in self.steps)

    def beyond_bytes(self, layer: Layer) -> tuple[str, ...]:
        """What is needed of a layer beside display bytes, in words. A GPU makes layers of which nothing else is."""
        step = self.step(layer.node)
        light = () if step.encoded else ("linear light",)
        clear = ("a transparent background",) if layer.transparent else ()
        return (*light, *(name for name in CHANNELS if name in step.channels - {"colour"}), *clear)

    def layer_of(self, rank: int) -> Layer:
        """What a renderer renders; KeyError if it is none."""
        for layer in self.layers:
            if rank in layer.ranks:
                return layer
        raise KeyError(rank)

    def sinks_on(self, rank: int) -> tuple[Step, ...]:
        return tuple(step for step in self.steps if step.rank == rank and isinstance(step.node, SinkNode))

    def layers_on(self, rank: int) -> tuple[Layer, ...]:
        return tuple(layer for layer in self.layers if layer.compositor == rank)

    def has_sink(self, kind: str) -> bool:
        return any(sink.kind == kind for sink in self.sinks)

    @property
    def plain(self) -> bool:
        """Whether every panel's samples are its picture, and the sinks show just those."""
        ops = {getattr(step.node, "op", "") for step in self.steps}
        return ops <= {"reconstruct", "tile", "sink"} and len({layer.panel for layer in self.layers}) == len(
            self.layers
        )


def build(loaded: Loaded, wall: Wall) -> Graph:
    """Expand a preset, check the nodes, plan. Raises ConfigError with all that is wrong."""
    config = loaded.config.graph
    written = not isinstance(config, PresetGraph)
    if isinstance(config, PresetGraph):
        if config.compositors > len(wall.panels):
            raise loaded.error(
                ("graph", "compositors"),
                f"{config.compositors} compositors cannot share {len(wall.panels)} panels",
                f"1 to {len(wall.panels)}",
            )
        nodes = len(wall.panels) * (2 * config.ranks_per_panel + 3 if config.preset == "sort-last" else 3)
        if nodes > MAX_NODES:
            came = f"{len(wall.panels)} panels with {config.ranks_per_panel} ranks each take {nodes} nodes"
            raise loaded.error(("graph", "ranks_per_panel"), came, f"fewer ranks: at most {MAX_NODES} nodes")
        config = expanded(config, wall)
    refusals = Refusals(loaded, config.nodes, written=written)
    check_structure(config.nodes, refusals)
    _panels_exist(config.nodes, wall, refusals)
    refusals.raise_any()
    graph = _planned(config, wall, refusals)
    _sync_fits(loaded, config, refusals)
    _compares_panels(graph, refusals)
    _compares_moments(graph, refusals)
    _waits_one_way(graph, refusals)
    _windows_show_panels(graph, refusals)
    _windows_are_apart(graph, config, wall, refusals)
    refusals.raise_any()
    if not graph.has_sink("window"):
        return graph
    rects = {step.node.id: step.rect for step in graph.steps}
    shown = {step.node.id: tuple(wall.panels[k] for k in step.panels) for step in graph.steps}
    config = with_windows(config, wall, rects, shown)
    return _planned(config, wall, Refusals(loaded, config.nodes, written=False))


def _panels_exist(nodes: Sequence[NodeConfig], wall: Wall, refusals: Refusals) -> None:
    panels = [panel.id for panel in wall.panels]
    for node in nodes:
        panel = getattr(node, "panel", None)
        if panel is not None and panel not in panels:
            some = ", ".join(panels[:16]) + (" ..." if len(panels) > 16 else "")
            refusals.add(node, ["panel"], "there is no such panel", some + nearest(panel, panels))


def _sync_fits(loaded: Loaded, config: NodeGraph, refusals: Refusals) -> None:
    method = loaded.config.sampling_of(0).method
    if isinstance(config.sync, FrameSync) and method != "framed":
        came = f"frames in lock step are made of whole frames, and the sampling method is {method}"
        refusals.add(None, ["sync"], came, "sampling: {method: framed}, or sync: none")


def _waits_one_way(graph: Graph, refusals: Refusals) -> None:
    """In lock step a rank waits for those before it; two that are before each other would wait for ever."""
    if graph.sync == "none":
        return
    before: dict[int, set[int]] = {}
    for step in graph.steps:
        givers = {graph.steps[k].rank for k in step.inputs} - {step.rank}
        before.setdefault(step.rank, set()).update(givers)
    try:
        TopologicalSorter(before).prepare()
    except CycleError as error:
        circle = " -> ".join("the head" if rank == 0 else f"compositor {rank}" for rank in error.args[1])
        came = f"in lock step {circle} would wait for each other"
        refusals.add(None, ["sync"], came, "`on` so that framelets go one way between compositors, or sync: none")


def _windows_show_panels(graph: Graph, refusals: Refusals) -> None:
    """A window is a panel's: a picture that holds none whole cannot be shown in one."""
    for step in graph.steps:
        if isinstance(step.node, SinkNode) and step.node.kind == "window" and not step.panels:
            came = f"{step.node.input} holds no whole panel, and windows show panels"
            refusals.add(step.node, ["input"], came, "a node that holds the pixels of one panel or more")


def _windows_are_apart(graph: Graph, config: NodeGraph, wall: Wall, refusals: Refusals) -> None:
    """Two windows of one panel on one rank would take turns in showing their pictures."""
    steps = {step.node.id: step for step in graph.steps}
    first: dict[tuple[int, int], str] = {}  # by rank and panel
    for node in config.nodes:
        if not isinstance(node, SinkNode) or node.kind != "window":
            continue
        step = steps[node.id]
        twice = [k for k in step.panels if first.setdefault((step.rank, k), node.id) != node.id]
        if twice:
            other, panel = first[step.rank, twice[0]], wall.panels[twice[0]].id
            came = f"panel {panel} has a window there already, that of {other}"
            refusals.add(node, ["input"], came, f"panels without a window on the same rank, or no {other}")


def _compares_panels(graph: Graph, refusals: Refusals) -> None:
    """Depths of different moments can be brought to one moment panel by panel only."""
    followed = graph.panels_followed()
    for step in graph.steps:
        if graph.sync == "none" and isinstance(step.node, Operator) and step.node.COMMON_TIME:
            for k, source in enumerate(step.inputs):
                held = graph.steps[source].panels
                if held and followed[source] is None:
                    what = f"holds {len(held)} panels" if len(held) > 1 else "is turned, scaled or bent"
                    came = f"{what}, and without lock step depths are compared along the rays of one panel"
                    accepted = "a node of one panel, as it is seen, or sync: frame"
                    refusals.add(step.node, input_path(step.node, k), came, accepted)


def _compares_moments(graph: Graph, refusals: Refusals) -> None:
    """A panel that is cut out of several has the moment of all only if they were joined where they were made."""
    panels: list[frozenset[int]] = []  # that a step was made of, before anything was cut
    ranks: list[frozenset[int]] = []  # that did a step or one before it
    for step in graph.steps:
        panels.append(frozenset(step.panels).union(*(panels[k] for k in step.inputs)))
        ranks.append(frozenset({step.rank}).union(*(ranks[k] for k in step.inputs)))
        if graph.sync != "none" or not isinstance(step.node, Operator) or not step.node.COMMON_TIME:
            continue
        for k, source in enumerate(step.inputs):
            if len(graph.steps[source].panels) == 1 < min(len(panels[source]), len(ranks[source])):
                came = "is cut out of panels of several compositors, which show different moments"
                refusals.add(step.node, input_path(step.node, k), came, "the panel's own node, or sync: frame")


def _planned(config: NodeGraph, wall: Wall, refusals: Refusals) -> Graph:
    order = in_order([_with_area(node, wall) for node in config.nodes])
    index = {panel.id: panel.index for panel in wall.panels}
    samples = [node for node in config.nodes if isinstance(node, SamplesNode)]
    samples.sort(key=lambda node: index[node.panel])
    ranks = number_ranks(config, samples, refusals)
    covering = Covering(wall, refusals)
    covering.find(order)
    covering.check_sinks(order)
    channels = find_channels(order, refusals)
    encoded = find_encoded(order, channels, refusals)
    orders = find_orders(order, refusals)
    placement = Placement(config, wall, refusals)
    rank_of = placement.find(order, covering.panels)
    refusals.raise_any()
    makers = [node for node in order if not isinstance(node, SamplesNode)]
    number = {node.id: k for k, node in enumerate(makers)}
    users: dict[str, list[int]] = {node.id: [] for node in order}
    for node in makers:
        for name in node.sources:
            users[name].append(number[node.id])
    steps = tuple(
        Step(
            index=number[node.id],
            node=node,
            inputs=tuple(number[name] for name in node.sources if name in number),
            rank=rank_of[node.id],
            rect=covering.rect[node.id],
            channels=channels.get(node.id, frozenset({"colour"})),
            encoded=encoded[node.id],
            computes=computes(node, channels),
            order=orders[node.id],
            panels=tuple(p.index for p in panels_shown(wall, covering.cover[node.id]))
            if isinstance(node, SinkNode)
            else tuple(sorted(covering.panels[node.id])),
            users=tuple(users[node.id]),
        )
        for node in makers
    )
    layers = _layers(config, samples, steps, ranks, index)
    hosts = dict(sorted(placement.hosts.items()))
    return Graph(nodes=order, steps=steps, layers=layers, compositors=config.compositors, hosts=hosts, sync=config.sync)


def _with_area(node: NodeConfig, wall: Wall) -> NodeConfig:
    """A crop, a constant or a picture that names a panel, as one that names its pixels."""
    panel = getattr(node, "panel", None)
    if not isinstance(node, Operator) or panel is None:
        return node
    rect = panel_rect(wall.panel(panel))
    return node.model_copy(update={"area": (rect.x, rect.y, rect.width, rect.height), "panel": None})


def _layers(
    config: NodeGraph,
    samples: Sequence[SamplesNode],
    steps: Sequence[Step],
    ranks: dict[str, tuple[int, ...]],
    index: dict[str, int],
) -> tuple[Layer, ...]:
    of_input = {step.node.input: step for step in steps if isinstance(step.node, ReconstructNode)}
    layers = []
    for k, node in enumerate(samples):
        step = of_input[node.id]
        assert isinstance(step.node, ReconstructNode)
        layers.append(
            Layer(
                index=k,
                samples=node.id,
                node=step.node.id,
                panel=index[node.panel],
                ranks=ranks[node.id],
                range=node.range,
                transparent=step.node.background == "transparent",
                reprojects=config.sync == "none" and _compared(step, steps),
                compositor=step.rank,
            )
        )
    return tuple(layers)


def _compared(step: Step, steps: Sequence[Step]) -> bool:
    """Whether an operator after it compares values of one moment."""
    for k in step.users:
        node = steps[k].node
        if (isinstance(node, Operator) and node.COMMON_TIME) or _compared(steps[k], steps):
            return True
    return False
