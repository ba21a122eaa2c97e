"""Convert a run's layout to the diagram that is drawn. The only file here that knows how a run is laid out."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from wall.commands.drawing.model import TIMES, TO, Box, Diagram, Edge, Process, Role, Screen
from wall.commands.drawing.traffic import bytes_a_sample, framelet_traffic, samples_traffic, si
from wall.compositing.graph import Graph, Layer, Step
from wall.config.graph import FrameSync, ReconstructNode, SinkNode
from wall.core.data import Float64
from wall.geometry.eyes import eye_of, standing_eye
from wall.geometry.panels import Panel
from wall.roles.plan import HEAD, Layout

SAME_M = 1e-5  # metres between corners of panels that count as one screen


def diagram_of(layout: Layout, *, samples_per_s: float) -> Diagram:
    """The diagram of a layout. `samples_per_s`: expected of a rank, for the bytes of sample streams."""
    sampling, refresh_hz = layout.sampling, layout.config.views[0].refresh_hz
    sizes = sorted({_sample_bytes(layout, layer) for layer in layout.graph.layers})
    lock_step = " in lock step" if isinstance(layout.graph.sync, FrameSync) else ""
    return Diagram(
        name=Path(layout.loaded.path).name,
        size=(layout.wall.width, layout.wall.height),
        screens=_screens(layout),
        processes=_processes(layout),
        boxes=_boxes(layout),
        edges=tuple(_edges(layout, samples_per_s)),
        assumptions=(
            f"samples: {si(samples_per_s, ' samples/s')} a rank, {' or '.join(f'{size:.3g}' for size in sizes)} bytes "
            f"each ({sampling.method})",
            f"framelets: whole, {refresh_hz:g} a second{lock_step}, before compression; a still view sends less",
        ),
    )


def _screens(layout: Layout) -> tuple[Screen, ...]:
    """The wall's screens: panels at the same position are one."""
    together: dict[tuple[int, ...], list[Panel]] = {}
    for panel in layout.wall.panels:
        key = tuple(int(value) for value in np.round(panel.lit.ravel() / SAME_M))
        together.setdefault(key, []).append(panel)
    eye, separation = standing_eye(layout.loaded, layout.wall.of_view(0), 0), layout.config.views[0].eye_separation
    return tuple(_screen(layout, panels, eye, separation) for panels in together.values())


def _screen(layout: Layout, panels: list[Panel], eye: Float64, separation: float) -> Screen:
    """One or more panels at the same position as a screen."""
    first = panels[0]
    names = list(dict.fromkeys(panel.of or panel.id for panel in panels))
    eyes = {tuple(eye_of(panel, eye, separation)) for panel in panels}
    processes = {_maker(layout.graph, panel.index) for panel in panels}
    arc = None if first.surface is None else first.surface.outline()
    hung = dict.fromkeys(" ".join(filter(None, (panel.config.host, panel.config.display))) for panel in panels)
    return Screen(
        id=_together(names),
        pixels=first.pixels,
        corners=first.lit if arc is None else _corners(arc),
        arc=arc,
        bezel=(first.config.bezel.left, first.config.bezel.right, first.config.bezel.top, first.config.bezel.bottom),
        eyes=tuple(np.array(one) for one in sorted(eyes)),
        notes=(*_peculiar(panels, len(eyes)), *(host for host in hung if host not in ("", first.id))),
        process=processes.pop() if len(processes) == 1 else "",
        panels=tuple(panel.id for panel in panels) if len(panels) > 1 else (),
    )


def _corners(arc: Float64) -> Float64:
    """(3, 3) rows lower left, lower right, upper left of a curved screen that is drawn flat, as wide as its chords."""
    lower_left, lower_right, upper_right, upper_left = arc.reshape(4, -1, 3)[:, 0]
    across = lower_right - lower_left
    up = (upper_left + upper_right - lower_left - lower_right) / 2
    up = up - (up @ across) / (across @ across) * across
    return np.array([lower_left, lower_right, lower_left + up])


def _together(names: list[str]) -> str:
    """Join names without repeating their common beginning: left-eye + right-eye, or wall-left + right."""
    beginnings = [names[0][: sign.end()] for sign in re.finditer(r"[-_.]", names[0])]
    shared = max((own for own in beginnings if all(name.startswith(own) for name in names)), key=len, default="")
    return " + ".join([names[0], *(name.removeprefix(shared) for name in names[1:])])


def _peculiar(panels: list[Panel], eyes: int) -> list[str]:
    """Notes on a screen that its outline does not show: stereo, shared positions, rotation."""
    first = panels[0]
    said = [first.config.stereo.replace("_", " ")] if first.config.stereo != "mono" and len(panels) == 1 else []
    if len(panels) > 1:
        said.append("stereo" if eyes == len(panels) else f"{len(panels)} in one place")
    return [*said, f"turned {first.config.rotation}°"] if first.config.rotation else said


def _maker(graph: Graph, panel: int) -> str:
    """The process that inserts a panel's samples; "" if there are several."""
    processes = {layer.compositor for layer in graph.layers if layer.panel == panel}
    return _rank_key(processes.pop()) if len(processes) == 1 else ""


def _processes(layout: Layout) -> dict[str, Process]:
    """The head, the compositors and the groups of renderers, by the key that boxes name."""
    graph, processes = layout.graph, {}
    for rank in range(graph.compositors):
        role: Role = "compositor" if rank else "head"
        processes[_rank_key(rank)] = Process(
            label=_rank_key(rank), detail=_on_host(graph, f"rank {rank}", rank), role=role
        )
    for layer in graph.layers:
        key = _ranks_key(layer.ranks)
        processes[key] = Process(label=key, detail=_on_host(graph, "", *layer.ranks), role="renderer")
    return processes


def _rank_key(rank: int) -> str:
    """The key and label of a compositor's process."""
    return "head" if rank == HEAD else f"compositor {rank}"


def _ranks_key(ranks: tuple[int, ...]) -> str:
    """The key and label of the ranks that render one layer."""
    if len(ranks) == 1:
        return f"rank {ranks[0]}"
    if ranks == tuple(range(ranks[0], ranks[-1] + 1)):
        return f"ranks {ranks[0]}{TO}{ranks[-1]}"
    return "ranks " + ", ".join(map(str, ranks))


def _on_host(graph: Graph, text: str, *ranks: int) -> str:
    """The text with the hosts of these ranks, as far as they are known."""
    hosts = dict.fromkeys(graph.hosts[rank] for rank in ranks if rank in graph.hosts)
    return ", ".join(part for part in (text, *hosts) if part)


def _boxes(layout: Layout) -> tuple[Box, ...]:
    """A box for every node, inputs first."""
    layers, steps = {one.samples: one for one in layout.graph.layers}, {s.node.id: s for s in layout.graph.steps}
    return tuple(
        _samples_box(layout, layers[node.id]) if node.id in layers else _step_box(steps[node.id])
        for node in layout.graph.nodes
    )


def _samples_box(layout: Layout, layer: Layer) -> Box:
    """The box of a layer's samples."""
    process, panel = _ranks_key(layer.ranks), layout.wall.viewports[layer.panel]
    share = "" if layer.range is None else f" {layer.range[0]:.0%}{TO}{layer.range[1]:.0%}"
    op = "samples" if layer.scale == 1.0 else f"samples {TIMES} {layer.scale:g}"
    op += "" if layer.samples_hz is None else f", {layer.samples_hz:g} Hz"
    return Box(id=layer.samples, op=op, detail=f"{panel.id}{share}, {process}", process=process, source=True)


def _step_box(step: Step) -> Box:
    """The box of a step of the graph."""
    node, process = step.node, _rank_key(step.rank)
    if isinstance(node, SinkNode):
        return Box(id=node.id, op=f"{node.kind} sink", detail="", process=process, sink=True)
    size = f"{step.rect.width} {TIMES} {step.rect.height} px"
    if isinstance(node, ReconstructNode) and node.refresh_hz is not None:
        size += f", {node.refresh_hz:g} Hz"
    return Box(id=node.id, op=node.op_name, detail=size, process=process, source=not node.sources)


def _share(layout: Layout, layer: Layer) -> float:
    """The share of its ranks' time that a layer gets, by the views' weights."""
    views = layout.config.views
    weights = [views[other.view].weight for other in layout.graph.layers if set(other.ranks) & set(layer.ranks)]
    return views[layer.view].weight / sum(weights)


def _most_samples(layout: Layout, layer: Layer) -> float:
    """Samples a second that each of a layer's ranks may trace at most."""
    width, height = layout.wall.traced[layer.traced].pixels
    return math.inf if layer.samples_hz is None else layer.samples_hz * width * height / len(layer.ranks)


def _sample_bytes(layout: Layout, layer: Layer) -> float:
    """Bytes that a sample of a layer takes on the wire."""
    sampling, (depths, objects) = layout.sampling, layout.graph.fields_of(layer)
    return bytes_a_sample(sampling.method, sampling.samples_per_batch, depths=depths, objects=objects)


def _edges(layout: Layout, samples_per_s: float) -> Iterator[Edge]:
    """Every edge. A framelet is sent to a process once: the first edge has its bytes, others to that process none."""
    graph, refresh_hz = layout.graph, layout.config.views[0].refresh_hz
    layers = {layer.samples: layer for layer in graph.layers}
    sent: set[tuple[int, int]] = set()
    for step in graph.steps:
        for name in step.node.sources:
            if name in layers:
                share = _share(layout, layers[name])
                rate = min(share * samples_per_s, _most_samples(layout, layers[name]))
                amount = samples_traffic(len(layers[name].ranks), rate, _sample_bytes(layout, layers[name]))
                yield Edge(start=name, end=step.node.id, bytes_per_s=amount, crosses=True)
                continue
            giver = graph.step(name)
            crosses, key = giver.rank != step.rank, (giver.index, step.rank)
            whole = framelet_traffic(giver.rect.area, giver.channels, encoded=giver.encoded, refresh_hz=refresh_hz)
            yield Edge(
                start=name, end=step.node.id, bytes_per_s=whole if crosses and key not in sent else 0.0, crosses=crosses
            )
            sent.add(key)
