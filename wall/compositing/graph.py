"""The compositing graph: presets expanded to nodes, nodes checked to be a typed DAG that covers the wall.

samples -> reconstruct -> framelet -> tile -> picture -> sink. Errors point to the node in the YAML file.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from graphlib import CycleError, TopologicalSorter

from wall.config.loading import Loaded, nearest
from wall.config.schema import (
    NodeConfig,
    NodeGraph,
    PresetGraph,
    ReconstructNode,
    SamplesNode,
    SinkNode,
    TileNode,
)
from wall.errors import ConfigError
from wall.geometry.panels import Wall
from wall.geometry.regions import Source

GIVES = {"samples": "samples", "reconstruct": "a framelet", "tile": "a picture", "sink": "nothing"}
TAKES = {"reconstruct": "samples", "tile": "a framelet", "sink": "a picture"}


@dataclass(frozen=True, slots=True, kw_only=True)
class Graph:
    """A checked graph. Ranks: 0 is the head (a compositor), then other compositors, then renderers."""

    nodes: tuple[NodeConfig, ...]  # inputs before those who need them
    sources: tuple[Source, ...]  # in the order of the panels; renderers follow it
    compositors: int  # the head among them
    sinks: tuple[SinkNode, ...]
    compositor_of_panel: tuple[int, ...]  # panel index -> compositor, 0 = the head

    @property
    def renderers(self) -> int:
        return sum(source.ranks for source in self.sources)

    @property
    def ranks_needed(self) -> int:
        """One head, the other compositors, and every renderer."""
        return self.compositors + self.renderers

    @property
    def first_renderer(self) -> int:
        """The rank whose region is regions(graph, wall)[0]."""
        return self.compositors

    def compositor_of(self, panel: int) -> int:
        """Which compositor (0 = the head) takes the samples of a panel in."""
        return self.compositor_of_panel[panel]

    def panels_of(self, compositor: int) -> tuple[int, ...]:
        """Indices of the panels that a compositor reconstructs."""
        return tuple(panel for panel, on in enumerate(self.compositor_of_panel) if on == compositor)

    def has_sink(self, kind: str) -> bool:
        return any(sink.kind == kind for sink in self.sinks)


def build(loaded: Loaded, wall: Wall) -> Graph:
    """Expand a preset, or check a graph that is written out. Raises ConfigError with all that is wrong."""
    config = loaded.config.graph
    if isinstance(config, PresetGraph):
        if config.compositors > len(wall.panels):
            raise loaded.error(
                ("graph", "compositors"),
                f"{config.compositors} compositors cannot share {len(wall.panels)} panels",
                f"1 to {len(wall.panels)}",
            )
        config = expanded(config, wall)
    elif problems := _Check(loaded, wall, config).problems():
        raise ConfigError("\n".join(str(problem) for problem in problems))
    return _graph(config, wall)


def expanded(preset: PresetGraph, wall: Wall) -> NodeGraph:
    """The nodes of a preset: each panel its own samples and reconstruction, one picture, its sinks."""
    nodes: list[NodeConfig] = []
    count = len(wall.panels)
    for panel in wall.panels:
        on = panel.index * preset.compositors // count
        samples, framelet = f"s{panel.index}", f"p{panel.index}"
        nodes.append(SamplesNode(op="samples", id=samples, panel=panel.id, ranks=preset.ranks_per_panel))
        nodes.append(ReconstructNode(op="reconstruct", id=framelet, input=samples, on=on))
    nodes.append(TileNode(op="tile", id="wall", inputs=tuple(f"p{i}" for i in range(count))))
    nodes.extend(SinkNode(op="sink", id=kind, kind=kind, input="wall") for kind in dict.fromkeys(preset.sinks))
    return NodeGraph(compositors=preset.compositors, nodes=tuple(nodes))


def inputs_of(node: NodeConfig) -> tuple[str, ...]:
    """Ids of the nodes a node needs."""
    if isinstance(node, TileNode):
        return node.inputs
    return () if isinstance(node, SamplesNode) else (node.input,)


def _graph(config: NodeGraph, wall: Wall) -> Graph:
    by_id = {node.id: node for node in config.nodes}
    order = TopologicalSorter({node.id: inputs_of(node) for node in config.nodes}).static_order()
    index = {panel.id: panel.index for panel in wall.panels}
    samples = {node.id: node for node in config.nodes if isinstance(node, SamplesNode)}
    compositor_of_panel = [0] * len(wall.panels)
    for node in config.nodes:
        if isinstance(node, ReconstructNode):
            compositor_of_panel[index[samples[node.input].panel]] = node.on
    sources = sorted((index[node.panel], node.ranks) for node in samples.values())
    return Graph(
        nodes=tuple(by_id[node_id] for node_id in order),
        sources=tuple(Source(panel=panel, ranks=ranks) for panel, ranks in sources),
        compositors=config.compositors,
        sinks=tuple(node for node in config.nodes if isinstance(node, SinkNode)),
        compositor_of_panel=tuple(compositor_of_panel),
    )


class _Check:
    """Everything that can be wrong with a graph that is written out. One question a method."""

    def __init__(self, loaded: Loaded, wall: Wall, config: NodeGraph) -> None:
        self._loaded, self._wall, self._config = loaded, wall, config
        self._by_id: dict[str, NodeConfig] = {}
        self._index = {id(node): i for i, node in enumerate(config.nodes)}
        self._found: list[ConfigError] = []

    def problems(self) -> list[ConfigError]:
        self._ids_differ()
        self._inputs_exist_and_fit()
        self._panels_are_covered_once()
        self._compositors_are_used()
        self._ends_in_one_picture()
        if not self._found:  # with a wrong input every node after it would be called unused as well
            self._is_acyclic()
            self._every_node_is_used_once()
        return self._found

    def _refuse(self, node: NodeConfig | None, at: Sequence[str | int], message: str, accepted: str = "") -> None:
        path = ("graph", "nodes", self._index[id(node)], *at) if node else ("graph", *at)
        self._found.append(self._loaded.error(path, message, accepted))

    def _ids_differ(self) -> None:
        for node in self._config.nodes:
            if node.id in self._by_id:
                first = self._index[id(self._by_id[node.id])]
                self._refuse(node, ["id"], f"nodes[{first}] has this id already", "ids that differ")
            else:
                self._by_id[node.id] = node

    def _inputs_exist_and_fit(self) -> None:
        for node in self._config.nodes:
            for i, name in enumerate(inputs_of(node)):
                at: list[str | int] = ["inputs", i] if isinstance(node, TileNode) else ["input"]
                giver = self._by_id.get(name)
                fitting = [n.id for n in self._config.nodes if GIVES[n.op] == TAKES[node.op] and n is not node]
                accepted = ", ".join(fitting) or f"a node that gives {TAKES[node.op]}"
                if giver is None:
                    self._refuse(node, at, "there is no such node", accepted + nearest(name, fitting))
                elif GIVES[giver.op] != TAKES[node.op]:
                    wanted = f"{node.op} needs {TAKES[node.op]}, {giver.op} gives {GIVES[giver.op]}"
                    self._refuse(node, at, wanted, accepted)

    def _panels_are_covered_once(self) -> None:
        panels = [panel.id for panel in self._wall.panels]
        seen: dict[str, str] = {}
        for node in self._config.nodes:
            if not isinstance(node, SamplesNode):
                continue
            if node.panel not in panels:
                self._refuse(node, ["panel"], "there is no such panel", ", ".join(panels) + nearest(node.panel, panels))
            elif node.panel in seen:
                self._refuse(
                    node,
                    ["panel"],
                    f"node {seen[node.panel]} covers this panel already",
                    "one samples node a panel",
                )
            seen.setdefault(node.panel, node.id)
        if missing := [panel for panel in panels if panel not in seen]:
            self._refuse(
                None,
                ["nodes"],
                f"nobody renders panel {', '.join(missing)}",
                "a samples node for every panel",
            )

    def _compositors_are_used(self) -> None:
        count, used = self._config.compositors, {0}
        for node in self._config.nodes:
            if isinstance(node, ReconstructNode):
                used.add(node.on)
                if node.on >= count:
                    what = "there is only compositor 0 (the head)" if count == 1 else f"there are {count} compositors"
                    self._refuse(node, ["on"], what, f"0 to {count - 1}, or more graph.compositors")
        if idle := sorted(set(range(count)) - used):
            self._refuse(
                None,
                ["compositors"],
                f"compositor {', '.join(map(str, idle))} has nothing to do",
                "a reconstruct node with `on` for each compositor",
            )

    def _ends_in_one_picture(self) -> None:
        tiles = [node for node in self._config.nodes if isinstance(node, TileNode)]
        for tile in tiles[1:]:
            self._refuse(tile, ["op"], "several pictures of one wall are not supported yet", "one tile node")
        if not any(isinstance(node, SinkNode) for node in self._config.nodes):
            self._refuse(None, ["nodes"], "no picture ends anywhere", "a node with op: sink")

    def _is_acyclic(self) -> None:
        # types alone forbid cycles today; operators that give what they take will not
        try:
            TopologicalSorter({node.id: inputs_of(node) for node in self._config.nodes}).prepare()
        except CycleError as error:
            names = " <- ".join(error.args[1])
            self._refuse(self._by_id[error.args[1][0]], [], f"needs its own result: {names}", "a graph without cycles")

    def _every_node_is_used_once(self) -> None:
        users: dict[str, list[str]] = {node.id: [] for node in self._config.nodes}
        for node in self._config.nodes:
            for name in inputs_of(node):
                users[name].append(node.id)
        for node in self._config.nodes:
            if isinstance(node, SinkNode):
                continue
            if not users[node.id]:
                self._refuse(
                    node,
                    ["id"],
                    f"nobody uses {GIVES[node.op]} of this node",
                    f"a node with input: {node.id}",
                )
            elif len(users[node.id]) > 1 and not isinstance(node, TileNode):
                self._refuse(node, ["id"], f"is used more than once ({', '.join(users[node.id])})", "one user")
