"""What `wall check` says of packets: which fields samples bring, and which are left out as nothing is made of them."""

from __future__ import annotations

from collections.abc import Iterator

from wall.compositing.graph import Layer
from wall.config.graph import NodeGraph
from wall.packets.plain_body import bytes_a_sample
from wall.roles.plan import Layout, Plan
from wall.scene.needs import needs

MOST_NAMES = 8  # of layers in a line


def fields_of_packets(plan: Plan) -> Iterator[str]:
    """A line for each set of fields, with the layers whose packets have it."""
    found: dict[str, list[str]] = {}
    for layer in plan.layout.graph.layers:
        adaptive = plan.layout.sampling_of(layer.view).method == "adaptive"
        found.setdefault(_adaptive(plan, layer) if adaptive else _plain(plan, layer), []).append(
            name_of(plan.layout, layer)
        )
    for fields, names in found.items():
        more = f" and {len(names) - MOST_NAMES} more" * (len(names) > MOST_NAMES)
        yield f"packets of {', '.join(names[:MOST_NAMES])}{more}: {fields}"


def name_of(layout: Layout, layer: Layer) -> str:
    """What a layer is called: by its node where the configuration names nodes, else by the panel that it shows."""
    if isinstance(layout.config.graph, NodeGraph):
        return layer.node
    return layout.wall.viewports[layer.panel].id + layer.objects


def _plain(plan: Plan, layer: Layer) -> str:
    depths, objects = plan.layout.graph.fields_of(layer)
    sent = ["colour", "position", "time", *["depth"] * depths, *["object"] * objects]
    left_out = [*["depth"] * (not depths), *["object"] * (not objects)]
    why = f"; left out: {' and '.join(left_out)}, of which the graph makes nothing" if left_out else ""
    size = bytes_a_sample(depths=depths, objects=objects)
    return f"{', '.join(sent)}, {size} bytes a sample before compression{why}"


def _adaptive(plan: Plan, layer: Layer) -> str:
    wanted = needs(plan.scene_of(layer.view))
    sent = "colour, position, depth, object, time, change"
    if wanted.paths:
        return f"{sent}, normal, albedo (paths are noisy); left out: light visibility"
    if wanted.relighting:
        return f"{sent}, normal, light visibility (light changes); left out: albedo"
    return f"{sent}; left out: normal, light visibility and albedo, as no light changes and none is noisy"
