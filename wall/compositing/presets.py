"""Expand presets (sort-first, sort-last) into nodes."""

from __future__ import annotations

from collections.abc import Sequence

from wall.config.graph import NodeGraph, PresetGraph, ReconstructNode, SamplesNode, SinkNode, SkyNode
from wall.config.views import BorderConfig, ViewConfig
from wall.geometry.panels import NO_VIEW, Panel, Wall
from wall.geometry.viewports import edges_of
from wall.operators.arrange import Tile
from wall.operators.base import Node
from wall.operators.depth import Depth
from wall.operators.outline import Outline, Side


def expanded(preset: PresetGraph, wall: Wall, views: Sequence[ViewConfig]) -> NodeGraph:
    """The nodes of a preset: each panel its own samples and framelet, one image of all, its sinks."""
    panel_nodes = _sort_last if preset.preset == "sort-last" else _sort_first
    shows = [viewport for viewport in wall.viewports if viewport.view != NO_VIEW]
    hosts: dict[int, int] = {}  # by panel: the viewport whose ranks render its insets too
    for viewport in shows:
        hosts.setdefault(viewport.on_panel, viewport.index)
    nodes = list[Node]()
    for viewport in shows:
        host = viewport.config.host if preset.renderers == "panel" else None
        on = None if host is None else f"host {host}"
        made, view = panel_nodes(viewport, preset.ranks_per_panel, hosts[viewport.on_panel], on), views[viewport.view]
        nodes += made if view.border is None else _with_border(made, view.border, edges_of(viewport, view, wall))
    if set(preset.sinks) != {"window"}:
        nodes.append(Tile(op="tile", id="wall", inputs=tuple(f"p{viewport.index}" for viewport in shows)))
    for kind in dict.fromkeys(preset.sinks):
        if kind == "window":
            for panel in wall.panels:
                own = tuple(f"p{viewport.index}" for viewport in shows if viewport.on_panel == panel.index)
                window, shown = f"window{panel.index}", own[0] if len(own) == 1 else f"views{panel.index}"
                if len(own) > 1:
                    nodes.append(Tile(op="tile", id=shown, inputs=own, on="panel"))
                nodes.append(SinkNode(op="sink", id=window, kind=kind, input=shown, on="panel"))
        else:
            nodes.append(SinkNode(op="sink", id=kind, kind=kind, input="wall"))
    return NodeGraph(compositors=preset.compositors, sync=preset.sync, nodes=tuple(nodes))


def _with_border(nodes: list[Node], border: BorderConfig, edges: tuple[Side, ...]) -> list[Node]:
    """The nodes of a viewport, the last of which is its image; with a line along those of its edges, if any."""
    if not edges:
        return nodes
    *before, image = nodes
    inside = image.model_copy(update={"id": f"inside-{image.id}"})
    line = Outline(op="outline", id=image.id, input=inside.id, width=border.width, color=border.color, sides=edges)
    return [*before, inside, line]


def _sort_first(panel: Panel, ranks: int, host: int, on: str | None) -> list[Node]:
    """`host`: the viewport of the same panel whose ranks render it; `on`: where they run, None: anywhere."""
    k = panel.index
    own = {"ranks": ranks, "on": on} if host == k else {"ranks_of": f"s{host}"}
    return [
        SamplesNode(op="samples", id=f"s{k}", panel=panel.id, **own),
        ReconstructNode(op="reconstruct", id=f"p{k}", input=f"s{k}"),
    ]


def _sort_last(panel: Panel, ranks: int, host: int, on: str | None) -> list[Node]:
    """Each rank a part of the objects, the sky behind all of them."""
    k, nodes = panel.index, list[Node]()
    for r in range(ranks):
        part = r / ranks, (r + 1) / ranks
        own = {"on": on} if host == k else {"ranks_of": f"s{host}-{r}"}
        nodes.append(SamplesNode(op="samples", id=f"s{k}-{r}", panel=panel.id, range=part, **own))
        nodes.append(
            ReconstructNode(op="reconstruct", id=f"f{k}-{r}", input=f"s{k}-{r}", background="transparent", on="panel")
        )
    nodes.append(SkyNode(op="sky", id=f"sky{k}", panel=panel.id))
    nodes.append(Depth(op="depth", id=f"p{k}", inputs=(*(f"f{k}-{r}" for r in range(ranks)), f"sky{k}")))
    return nodes
