"""Add the nodes that a panel's display needs between an image and its window.

A window sink shows each panel by itself: its pixels cut out, then its surface, colour, blending, warp and blend mask,
as the wall says.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from wall.config.displays import WarpFileConfig
from wall.config.graph import NodeGraph, SinkNode
from wall.core.data import Rect
from wall.geometry.panels import Panel, Wall
from wall.geometry.rects import panel_rect
from wall.operators.arrange import Crop
from wall.operators.base import Node
from wall.operators.blend_edges import BlendEdges
from wall.operators.blend_mask import BlendMask
from wall.operators.colour import Colour
from wall.operators.curve import Curve
from wall.operators.warp import Warp

MAX_STEM = 48  # characters of a node's id that added nodes begin with


def with_windows(
    config: NodeGraph, wall: Wall, rects: Mapping[str, Rect], shown: Mapping[str, tuple[Panel, ...]]
) -> NodeGraph:
    """The same graph with a window sink for each panel, fitted to its display.

    rects : of every node; shown : of every sink the panels that it shows whole
    """
    nodes: list[Node] = []
    taken = {node.id for node in config.nodes}
    for node in config.nodes:
        if not isinstance(node, SinkNode) or node.kind != "window":
            nodes.append(node)
            continue
        panels = shown[node.id]
        for panel in panels:
            name = node.id if len(panels) == 1 else f"{node.id[:MAX_STEM]}.{panel.index}"
            nodes += _window(node, name, panel, rects[node.input], taken)
    return config.model_copy(update={"nodes": tuple(nodes)})


def _window(node: SinkNode, name: str, panel: Panel, given: Rect, taken: set[str]) -> list[Node]:
    """What leads from the sink's input to the panel's window, and that."""
    chain: list[Node] = []
    stem, rect = name[:MAX_STEM], panel_rect(panel)

    def link(what: str) -> dict[str, Any]:
        own = f"{stem}.{what}"
        while own in taken:
            own += "_"
        taken.add(own)
        return {"id": own, "input": chain[-1].id if chain else node.input, "on": node.on}

    if given != rect:
        chain.append(Crop(op="crop", area=(rect.x, rect.y, rect.width, rect.height), **link("crop")))
    if panel.surface is not None:
        chain.append(Curve(op="curve", panel=panel.id, **link("curve")))
    if panel.config.colour is not None:
        c = panel.config.colour
        chain.append(Colour(op="colour", gain=c.gain, gamma=c.gamma, lut=c.lut, **link("colour")))
    if (ramps := _ramps(panel)) is not None:
        chain.append(BlendEdges(op="blend_edges", **ramps, **link("blend")))
    if isinstance(panel.config.warp, WarpFileConfig):
        chain.append(Warp(op="warp", file=panel.config.warp.file, **link("warp")))
    elif panel.config.warp is not None:
        chain.append(Warp(op="warp", mesh=panel.config.warp, **link("warp")))
    if panel.config.blend_mask is not None:
        chain.append(BlendMask(op="blend_mask", file=panel.config.blend_mask, **link("mask")))
    last = chain[-1].id if chain else node.input
    return [*chain, SinkNode(op="sink", id=name, kind="window", input=last, on=node.on)]


def _ramps(panel: Panel) -> dict[str, Any] | None:
    """Widths of the ramps in pixels, and the display's gamma; None where there are none."""
    if panel.blend is None:
        return None
    (across, down), b = panel.lit_pitch, panel.blend
    ramps = {
        "left": round(b.left / across), "right": round(b.right / across),
        "top": round(b.top / down), "bottom": round(b.bottom / down),
    }  # fmt: skip
    return {**ramps, "gamma": b.gamma} if any(ramps.values()) else None
