"""From a layout to what its drawing shows: the one file that knows both."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from wall.compositing.graph import inputs_of
from wall.config.loading import Loaded
from wall.config.schema import NodeConfig, ReconstructNode, SamplesNode, SinkNode
from wall.config.screens import BezelConfig
from wall.config.views import DEFAULT_FOV_DEGREES
from wall.data import Channels, Float64, Rect
from wall.drawing.model import TIMES, TO, Box, Place, Role, Screen, Sketch, Wire
from wall.drawing.traffic import bytes_a_sample, framelet_traffic, samples_traffic, si
from wall.geometry.cameras import default_eye
from wall.geometry.panels import Wall
from wall.processes.plan import Layout

COLOUR: Channels = frozenset({"colour"})


def sketch(layout: Layout, *, samples_per_s: float) -> Sketch:
    """Everything to be drawn. `samples_per_s`: expected of a rank, for the bytes of sample streams."""
    sampling, refresh_hz = layout.sampling, layout.config.views[0].refresh_hz
    sample_bytes = bytes_a_sample(sampling.method, sampling.samples_per_batch)
    return Sketch(
        name=Path(layout.loaded.path).name,
        size=(layout.wall.width, layout.wall.height),
        screens=_screens(layout),
        places=_places(layout),
        boxes=tuple(_box(layout, node) for node in layout.graph.nodes),
        wires=tuple(_wires(layout, samples_per_s * sample_bytes)),
        remarks=(
            f"samples: {si(samples_per_s, ' samples/s')} a rank, {sample_bytes:.3g} bytes each ({sampling.method})",
            f"framelets: whole, {refresh_hz:g} a second, before compression; a still view sends less",
        ),
    )


def _screens(layout: Layout) -> tuple[Screen, ...]:
    config = layout.config.wall
    bezels = [config.grid.bezel] * len(layout.wall.panels) if config.grid else [p.bezel for p in config.panels or ()]
    eye = _eye(layout.loaded, layout.wall)
    return tuple(
        Screen(
            id=panel.id,
            pixels=panel.pixels,
            corners=panel.corners,
            bezel=_sides(bezel),
            eyes=(eye,),
            notes=(panel.host,) if panel.host else (),
            place=_rank_key(layout, layout.compositor_of(panel.index)),
        )
        for panel, bezel in zip(layout.wall.panels, bezels, strict=True)
    )


def _eye(loaded: Loaded, wall: Wall) -> Float64:
    config = loaded.config.views[0]
    if config.eye is not None:
        return np.array(config.eye, dtype=np.float64)
    if not wall.flat:
        raise loaded.error(
            ("views", 0), "the wall is not flat, so the eye's place is needed", "eye: [x, y, z] in metres"
        )
    return default_eye(wall, config.camera.fov or DEFAULT_FOV_DEGREES)


def _sides(bezel: BezelConfig) -> tuple[float, float, float, float]:
    return bezel.left, bezel.right, bezel.top, bezel.bottom


def _places(layout: Layout) -> dict[str, Place]:
    places = {}
    for rank in range(layout.graph.compositors):
        role: Role = "compositor" if rank else "head"
        places[_rank_key(layout, rank)] = Place(
            label=f"compositor {rank}" if rank else "head", detail=f"rank {rank}", role=role
        )
    for node in layout.graph.nodes:
        if isinstance(node, SamplesNode):
            key = _place(layout, node)
            places[key] = Place(label=key, detail="", role="renderer")
    return places


def _rank_key(layout: Layout, rank: int) -> str:
    return "head" if rank == 0 else f"compositor {rank}"


def _place(layout: Layout, node: NodeConfig) -> str:
    if isinstance(node, ReconstructNode):
        return _rank_key(layout, node.on)
    if not isinstance(node, SamplesNode):
        return "head"
    panel = layout.wall.panel(node.panel).index
    ranks = [rank for rank in layout.renderers() if layout.region(rank).panel == panel]
    return f"rank {ranks[0]}" if len(ranks) == 1 else f"ranks {ranks[0]}{TO}{ranks[-1]}"


def _box(layout: Layout, node: NodeConfig) -> Box:
    place = _place(layout, node)
    if isinstance(node, SamplesNode):
        return Box(id=node.id, op="samples", detail=f"{node.panel}, {place}", place=place, source=True)
    if isinstance(node, SinkNode):
        op = "sink" if node.kind == node.id else f"{node.kind} sink"
        return Box(id=node.id, op=op, detail="", place=place, sink=True)
    rect = _rect(layout, node)
    return Box(id=node.id, op=node.op, detail=f"{rect.width} {TIMES} {rect.height} px", place=place)


def _rect(layout: Layout, node: NodeConfig) -> Rect:
    by_id = {other.id: other for other in layout.graph.nodes}
    if isinstance(node, ReconstructNode):
        samples = by_id[node.input]
        assert isinstance(samples, SamplesNode)
        panel = layout.wall.panel(samples.panel)
        return Rect(x=panel.screen[0], y=panel.screen[1], width=panel.pixels[0], height=panel.pixels[1])
    return Rect(x=0, y=0, width=layout.wall.width, height=layout.wall.height)


def _wires(layout: Layout, rank_bytes_per_s: float) -> list[Wire]:
    by_id = {node.id: node for node in layout.graph.nodes}
    wires = []
    for node in layout.graph.nodes:
        for name in inputs_of(node):
            giver = by_id[name]
            crosses = _place(layout, giver) != _place(layout, node)
            amount = _amount(layout, giver, rank_bytes_per_s) if crosses else 0.0
            wires.append(Wire(start=name, end=node.id, bytes_per_s=amount, crosses=crosses))
    return wires


def _amount(layout: Layout, giver: NodeConfig, rank_bytes_per_s: float) -> float:
    if isinstance(giver, SamplesNode):
        return samples_traffic(giver.ranks, 1.0, rank_bytes_per_s)
    refresh_hz = layout.config.views[0].refresh_hz
    return framelet_traffic(_rect(layout, giver).area, COLOUR, encoded=True, refresh_hz=refresh_hz)
