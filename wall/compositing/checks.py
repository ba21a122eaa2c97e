"""Checks of a graph that need its plan: sync, windows, and what `depth` compares. Each adds to the refusals."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from graphlib import CycleError, TopologicalSorter

from wall.compositing.graph import Graph
from wall.compositing.refusals import Refusals
from wall.compositing.structure import input_path
from wall.config.graph import FrameSync, NodeGraph, PresetGraph, SinkNode
from wall.config.loading import Loaded, nearest
from wall.core.network import is_loopback
from wall.geometry.panels import Wall
from wall.geometry.rects import panel_rect
from wall.geometry.strips import LEAST_ROWS
from wall.operators.base import Node, Operator
from wall.operators.curve import Curve


def check_panels_exist(nodes: Sequence[Node], wall: Wall, refusals: Refusals) -> None:
    """Panels that nodes name are panels of the wall."""
    panels = [panel.id for panel in wall.viewports]
    for node in nodes:
        panel = getattr(node, "panel", None)
        if panel is not None and panel not in panels:
            some = ", ".join(panels[:16]) + (" ..." if len(panels) > 16 else "")
            refusals.add(node, ["panel"], "there is no such panel", some + nearest(panel, panels))


def check_curves_are_curved(nodes: Sequence[Node], wall: Wall, refusals: Refusals) -> None:
    """What `curve` names is a curved panel."""
    flat = {panel.id for panel in wall.viewports if panel.surface is None}
    for node in nodes:
        if isinstance(node, Curve) and node.panel in flat:
            refusals.add(node, ["panel"], f"{node.panel} is flat", "a panel with a surface")


def check_curves_take_panels(graph: Graph, wall: Wall, refusals: Refusals) -> None:
    """What `curve` takes is the flat image of its panel, all of it and nothing else."""
    for step in graph.steps:
        node = step.node
        if isinstance(node, Curve):
            given, wanted = graph.steps[step.inputs[0]], panel_rect(wall.panel(node.panel))
            if given.rect != wanted or graph.panels_followed()[given.index] != wall.panel(node.panel).index:
                came = f"{node.input} is not the flat image of panel {node.panel}"
                refusals.add(node, ["input"], came, "a node that holds all of its pixels and no others, as they are")


def check_sync_fits(loaded: Loaded, config: NodeGraph, refusals: Refusals) -> None:
    """Only the sampling method `framed` makes the whole frames of lock step; nodes with settings have none."""
    for node in config.nodes if isinstance(config.sync, FrameSync) else ():
        if isinstance(node, Operator) and node.SETTINGS:
            came = "is read while the wall runs, and sync: {mode: frame} shows whole frames"
            refusals.add(node, ["op"], came, "sync: none")
    method = loaded.config.sampling_of(0).method
    if isinstance(config.sync, FrameSync) and method != "framed":
        came = f"frames in lock step are made of whole frames, and the sampling method is {method}"
        refusals.add(None, ["sync"], came, "sampling: {method: framed}, or sync: none")


def check_rates_fit(loaded: Loaded, graph: Graph, refusals: Refusals) -> None:
    """A layer's own rates need frames that nobody waits for, samples that are worth keeping, and a faster view."""
    nodes = {node.id: node for node in graph.nodes}
    for layer in graph.layers:
        view, method = loaded.config.views[layer.view], loaded.config.sampling_of(layer.view).method
        for name, rate in ((layer.node, layer.refresh_hz), (layer.samples, layer.samples_hz)):
            if rate is None:
                continue
            at: list[str | int] = ["refresh_hz"]
            if graph.sync != "none":
                came = "in lock step all layers of a frame are of one moment"
                refusals.add(nodes[name], at, came, "no refresh_hz, or sync: none")
            elif method == "progressive":
                came = "the sampling method progressive begins anew at every input, at a rate of its own"
                refusals.add(nodes[name], at, came, "no refresh_hz, or another method")
            elif name == layer.node and rate >= view.refresh_hz:
                came = f"view {view.id} is shown at {view.refresh_hz:g} Hz"
                refusals.add(nodes[name], at, came, f"below {view.refresh_hz:g}, or no refresh_hz: at every refresh")


def check_waits_one_way(graph: Graph, refusals: Refusals) -> None:
    """In lock step a rank waits for the ranks that it takes from, so these waits must have no cycle."""
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


def check_windows_show_panels(graph: Graph, refusals: Refusals) -> None:
    """A window shows a panel, so what it shows must hold a whole one."""
    for step in graph.steps:
        if isinstance(step.node, SinkNode) and step.node.kind == "window" and not step.panels:
            came = f"{step.node.input} holds no whole panel, and windows show panels"
            refusals.add(step.node, ["input"], came, "a node that holds the pixels of one panel or more")


def check_windows_are_apart(graph: Graph, config: NodeGraph, wall: Wall, refusals: Refusals) -> None:
    """A panel has at most one window on a rank."""
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


def note_of_windows(graph: Graph, wall: Wall) -> str:
    """That panels say where their windows are, and no sink opens any; "" else."""
    placed = [panel.of for panel in wall.panels if (panel.config.monitor, panel.config.window) != (None, None)]
    if not placed or any(sink.kind == "window" for sink in graph.sinks):
        return ""
    more = f" and {len(set(placed)) - 1} more name" if len(set(placed)) > 1 else " names"
    return (
        f"panel {placed[0]}{more} a monitor or window, and no sink opens windows: "
        "graph: {preset: sort-first, sinks: [window, browser]} has one"
    )


def notes_of_hosts(loaded: Loaded, graph: Graph, wall: Wall) -> Iterator[str]:
    """What a wall of several hosts would meet: a head that they cannot reach, windows that open nowhere, or all on one
    rank."""
    bind = loaded.config.transport.bind
    named = sorted({panel.config.host for panel in wall.panels if panel.config.host is not None})
    if len(named) > 1 and is_loopback(bind):
        what = f"only the machine of the head can reach it, and panels are on {', '.join(named[:4])}"
        yield str(loaded.error(("transport", "bind"), what, "0.0.0.0, or the head's address in their network"))
    if note := note_of_windows(graph, wall):
        yield f"{loaded.name}: {note}"
    hosts: dict[int, set[str]] = {}
    for step in graph.steps:
        if isinstance(step.node, SinkNode) and step.node.kind == "window":
            names = (wall.panels[k].config.host for k in step.panels)
            hosts.setdefault(step.rank, set()).update(name for name in names if name is not None)
    for rank, found in hosts.items():
        if len(found) > 1:
            yield (
                f"graph: windows of panels on {', '.join(sorted(found))} all open where rank {rank} runs; each host "
                f"opens its own with graph: {{compositors: {len(named)}}}"
            )


def check_balance_fits(loaded: Loaded, graph: Graph, wall: Wall) -> None:
    """Refuse `balance` where borders cannot move. Raises ConfigError."""
    if not graph.balanced:
        return
    path, config = ("graph", "balance"), loaded.config.graph
    assert isinstance(config, PresetGraph)
    if config.preset != "sort-first" or graph.sync != "none" or len(loaded.config.views) > 1:
        raise loaded.error(path, "borders move between parts of one picture", "sort-first, sync: none, one view")
    most = graph.strips(wall).most_ranks
    if graph.renderers > most:
        raise loaded.error(path, f"{graph.renderers} renderers for {most} strips of {LEAST_ROWS} rows", f"up to {most}")


def check_compares_panels(graph: Graph, refusals: Refusals) -> None:
    """Without lock step, framelets are reprojected to a common time, which works for single panels only."""
    followed = graph.panels_followed()
    for step in graph.steps:
        if graph.sync == "none" and step.node.COMMON_TIME:
            for k, source in enumerate(step.inputs):
                held = graph.steps[source].panels
                if held and followed[source] is None:
                    what = f"holds {len(held)} panels" if len(held) > 1 else "is turned, scaled or bent"
                    came = f"{what}, and without lock step depths are compared along the rays of one panel"
                    accepted = "a node of one panel, as it is seen, or sync: frame"
                    refusals.add(step.node, input_path(step.node, k), came, accepted)


def check_compares_times(graph: Graph, refusals: Refusals) -> None:
    """A panel that is cut out of several has one time only if a single compositor made all of them."""
    panels: list[frozenset[int]] = []  # that a step was made of, before anything was cut
    ranks: list[frozenset[int]] = []  # that did a step or one before it
    for step in graph.steps:
        panels.append(frozenset(step.panels).union(*(panels[k] for k in step.inputs)))
        ranks.append(frozenset({step.rank}).union(*(ranks[k] for k in step.inputs)))
        if graph.sync != "none" or not step.node.COMMON_TIME:
            continue
        for k, source in enumerate(step.inputs):
            if len(graph.steps[source].panels) == 1 < min(len(panels[source]), len(ranks[source])):
                came = "is cut out of panels of several compositors, which show different times"
                refusals.add(step.node, input_path(step.node, k), came, "the panel's own node, or sync: frame")
