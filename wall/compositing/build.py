"""Build the compositing graph of a configuration: expand a preset, check the nodes, plan.

A pure function of the configuration, so that every rank computes it alone and all agree. Errors point to the node in
the YAML file.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from wall.compositing import checks
from wall.compositing.channels import computes, find_channels, find_encoded, find_orders
from wall.compositing.covering import Covering, panels_shown
from wall.compositing.graph import Graph, Layer, Step
from wall.compositing.placement import Placement
from wall.compositing.presets import expanded
from wall.compositing.ranks import number_ranks
from wall.compositing.refusals import Refusals
from wall.compositing.structure import check_structure, in_order, users_of
from wall.compositing.windows import with_windows
from wall.config.graph import MAX_NODES, NodeGraph, PresetGraph, ReconstructNode, SamplesNode, SinkNode
from wall.config.loading import Loaded
from wall.config.views import ViewConfig
from wall.geometry.panels import Wall
from wall.geometry.rects import panel_rect
from wall.geometry.seats import curved_image
from wall.operators.base import Node, Operator
from wall.operators.curve import Curve
from wall.operators.over import Over


def build(loaded: Loaded, wall: Wall) -> Graph:
    """Expand a preset, check the nodes, plan. Raises ConfigError with all that is wrong."""
    config = loaded.config.graph
    written, balanced = not isinstance(config, PresetGraph), False
    if isinstance(config, PresetGraph):
        balanced = config.balance
        config = _expanded(loaded, config, wall)
    elif bordered := [k for k, view in enumerate(loaded.config.views) if view.border is not None]:
        wanted = "a graph by a preset; among nodes of your own, outline"
        raise loaded.error(("views", bordered[0], "border"), "the graph is written node by node", wanted)
    refusals = Refusals(loaded, config.nodes, written=written)
    check_structure(config.nodes, refusals)
    checks.check_panels_exist(config.nodes, wall, refusals)
    checks.check_curves_are_curved(config.nodes, wall, refusals)
    refusals.raise_any()
    graph = replace(_planned(config, wall, loaded.config.views, refusals), balanced=balanced)
    checks.check_balance_fits(loaded, graph, wall)
    checks.check_sync_fits(loaded, config, refusals)
    checks.check_rates_fit(loaded, graph, refusals)
    checks.check_compares_panels(graph, refusals)
    checks.check_compares_times(graph, refusals)
    checks.check_waits_one_way(graph, refusals)
    checks.check_curves_take_panels(graph, wall, refusals)
    checks.check_windows_show_panels(graph, refusals)
    checks.check_windows_are_apart(graph, config, wall, refusals)
    refusals.raise_any()
    if not graph.has_sink("window"):
        return graph
    rects = {step.node.id: step.rect for step in graph.steps}
    sinks = [step for step in graph.steps if isinstance(step.node, SinkNode)]
    shown = {step.node.id: tuple(wall.panels[k] for k in step.panels) for step in sinks}
    config = with_windows(config, wall, rects, shown)
    refusals = Refusals(loaded, config.nodes, written=False)
    return replace(_planned(config, wall, loaded.config.views, refusals), balanced=balanced)


def _expanded(loaded: Loaded, config: PresetGraph, wall: Wall) -> NodeGraph:
    """The nodes of a preset. Raises ConfigError where they would be too many."""
    apart = all(panel.config.host is not None for panel in wall.panels)  # then the head may have none of the panels
    if config.compositors > (most := len(wall.panels) + apart):
        came = f"{config.compositors} compositors cannot share {len(wall.panels)} panels"
        raise loaded.error(("graph", "compositors"), came, f"1 to {most}")
    nodes = len(wall.viewports) * (2 * config.ranks_per_panel + 3 if config.preset == "sort-last" else 3)
    nodes += sum(loaded.config.views[viewport.view].border is not None for viewport in wall.insets)
    if nodes > MAX_NODES:
        came = f"{len(wall.panels)} panels with {config.ranks_per_panel} ranks each take {nodes} nodes"
        raise loaded.error(("graph", "ranks_per_panel"), came, f"fewer ranks: at most {MAX_NODES} nodes")
    return expanded(config, wall, loaded.config.views)


def _planned(config: NodeGraph, wall: Wall, views: Sequence[ViewConfig], refusals: Refusals) -> Graph:
    """The plan of every node. Raises ConfigError with all that is wrong."""
    order = in_order([_placed(node, wall, views) for node in config.nodes])
    index = {panel.id: panel.index for panel in wall.viewports}
    samples = [node for node in config.nodes if isinstance(node, SamplesNode)]
    samples.sort(key=lambda node: index[node.panel])
    ranks = number_ranks(config, samples, refusals)
    covering = Covering(wall, refusals)
    covering.find(order)
    covering.check_sinks(order)
    placement = Placement(config, wall, ranks, refusals)
    held = covering.panels
    rank_of = placement.find(order, held)
    apart = _apart(order, rank_of, held) if config.sync == "none" else frozenset[str]()
    channels = find_channels(order, refusals, moved=apart)
    encoded = find_encoded(order, channels, refusals)
    orders = find_orders(order, refusals)
    refusals.raise_any()
    makers = [node for node in order if not isinstance(node, SamplesNode)]
    number = {node.id: k for k, node in enumerate(makers)}
    users = users_of(order)
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
            else tuple(sorted(held[node.id])),
            users=tuple(number[user.id] for user in users[node.id]),
            apart=node.id in apart,
        )
        for node in makers
    )
    layers = _layers(config, samples, steps, ranks, wall)
    hosts = dict(sorted(placement.hosts.items()))
    return Graph(nodes=order, steps=steps, layers=layers, compositors=config.compositors, hosts=hosts, sync=config.sync)


def _apart(
    order: Sequence[Node], rank_of: Mapping[str, int], held: Mapping[str, frozenset[int]]
) -> frozenset[str]:
    """The `over` nodes whose inputs other processes make, all of one panel as it is seen: they can be reprojected."""
    found, made = set[str](), dict[str, frozenset[int]]()  # panels that a node's pixels come from
    seen = dict[str, bool]()  # whether they are as their panel is seen
    for node in order:
        made[node.id] = held[node.id].union(*(made[name] for name in node.sources))
        seen[node.id] = node.KEEPS_RAYS and all(seen[name] for name in node.sources)
        one_panel = len(made[node.id]) == 1 and seen[node.id]
        if isinstance(node, Over) and one_panel and any(rank_of[k] != rank_of[node.id] for k in node.sources):
            found.add(node.id)
    return frozenset(found)


def _placed(node: Node, wall: Wall, views: Sequence[ViewConfig]) -> Node:
    """The same node; one that names a panel gets the panel's pixels as its area, or its surface."""
    panel = getattr(node, "panel", None)
    if not isinstance(node, Operator) or panel is None:
        return node
    if isinstance(node, Curve):
        return node.placed(curved_image(wall.panel(panel), views))
    rect = panel_rect(wall.panel(panel))
    return node.model_copy(update={"area": (rect.x, rect.y, rect.width, rect.height), "panel": None})


def _layers(
    config: NodeGraph,
    samples: Sequence[SamplesNode],
    steps: Sequence[Step],
    ranks: dict[str, tuple[int, ...]],
    wall: Wall,
) -> tuple[Layer, ...]:
    of_input = {step.node.input: step for step in steps if isinstance(step.node, ReconstructNode)}
    compared = _compared(steps)
    layers, panels = list[Layer](), {panel.id: panel for panel in wall.viewports}
    taken, free = set[tuple[int, int]](), len(wall.viewports)
    for k, node in enumerate(samples):
        step = of_input[node.id]
        assert isinstance(step.node, ReconstructNode)
        traced = panels[node.panel].index
        pairs = {(traced, rank) for rank in ranks[node.id]}
        if node.scale < 1.0 or pairs & taken:  # a rank's packets say by their panel which layer they are of
            traced, free = free, free + 1
        else:
            taken |= pairs
        layers.append(
            Layer(
                index=k,
                samples=node.id,
                node=step.node.id,
                panel=panels[node.panel].index,
                traced=traced,
                view=panels[node.panel].view,
                ranks=ranks[node.id],
                range=node.range,
                transparent=step.node.background == "transparent",
                reprojects=config.sync == "none" and compared[step.index],
                compositor=step.rank,
                scale=node.scale,
                samples_hz=node.refresh_hz,
                refresh_hz=step.node.refresh_hz,
            )
        )
    return tuple(layers)


def _compared(steps: Sequence[Step]) -> list[bool]:
    """Of each step, whether an operator after it compares values, which must show the same time."""
    compared = [False] * len(steps)
    for step in reversed(steps):  # users stand after what they use
        compared[step.index] = any(steps[k].node.COMMON_TIME or compared[k] for k in step.users)
    return compared
