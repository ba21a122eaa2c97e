"""Expand presets (sort-first, sort-last) into nodes."""

from __future__ import annotations

from wall.config.graph import NodeGraph, PresetGraph, ReconstructNode, SamplesNode, SinkNode, SkyNode
from wall.geometry.panels import Panel, Wall
from wall.operators.arrange import Tile
from wall.operators.base import Node
from wall.operators.depth import Depth


def expanded(preset: PresetGraph, wall: Wall) -> NodeGraph:
    """The nodes of a preset: each panel its own samples and framelet, one image of all, its sinks."""
    panel_nodes = _sort_last if preset.preset == "sort-last" else _sort_first
    nodes = [node for panel in wall.viewports for node in panel_nodes(panel, preset.ranks_per_panel)]
    if set(preset.sinks) != {"window"}:
        nodes.append(Tile(op="tile", id="wall", inputs=tuple(f"p{panel.index}" for panel in wall.viewports)))
    for kind in dict.fromkeys(preset.sinks):
        if kind == "window":
            for panel in wall.panels:
                window, shown = f"window{panel.index}", f"p{panel.index}"
                if insets := tuple(f"p{inset.index}" for inset in wall.insets if inset.inset_of == panel.index):
                    nodes.append(Tile(op="tile", id=f"views{panel.index}", inputs=(shown, *insets), on="panel"))
                    shown = f"views{panel.index}"
                nodes.append(SinkNode(op="sink", id=window, kind=kind, input=shown, on="panel"))
        else:
            nodes.append(SinkNode(op="sink", id=kind, kind=kind, input="wall"))
    return NodeGraph(compositors=preset.compositors, sync=preset.sync, nodes=tuple(nodes))


def _sort_first(panel: Panel, ranks: int) -> list[Node]:
    k, over = panel.index, panel.inset_of
    own = {"ranks": ranks} if over is None else {"ranks_of": f"s{over}"}
    return [
        SamplesNode(op="samples", id=f"s{k}", panel=panel.id, **own),
        ReconstructNode(op="reconstruct", id=f"p{k}", input=f"s{k}"),
    ]


def _sort_last(panel: Panel, ranks: int) -> list[Node]:
    """Each rank a part of the objects, the sky behind all of them."""
    k, over, nodes = panel.index, panel.inset_of, list[Node]()
    for r in range(ranks):
        part, shared = (r / ranks, (r + 1) / ranks), None if over is None else f"s{over}-{r}"
        nodes.append(SamplesNode(op="samples", id=f"s{k}-{r}", panel=panel.id, range=part, ranks_of=shared))
        nodes.append(
            ReconstructNode(op="reconstruct", id=f"f{k}-{r}", input=f"s{k}-{r}", background="transparent", on="panel")
        )
    nodes.append(SkyNode(op="sky", id=f"sky{k}", panel=panel.id))
    nodes.append(Depth(op="depth", id=f"p{k}", inputs=(*(f"f{k}-{r}" for r in range(ranks)), f"sky{k}")))
    return nodes
