"""Walls and graphs to draw, without a configuration behind them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from wall.commands.drawing.model import Box, Diagram, Edge, Process, Role, Screen

EYE = (0.0, 0.0, 2.0)


def screen(
    name: str,
    lower_left: Sequence[float],
    lower_right: Sequence[float],
    upper_left: Sequence[float],
    *,
    eye: Sequence[float] = EYE,
    bezel: float = 0.0,
) -> Screen:
    """A screen of 800 x 600 pixels by its corners, metres."""
    corners = np.array([lower_left, lower_right, upper_left], dtype=np.float64)
    return Screen(id=name, pixels=(800, 600), corners=corners, bezel=(bezel,) * 4, eyes=(np.array(eye),))


def upright(name: str, x: float, y: float, *, width: float = 1.0, height: float = 0.5, **more: object) -> Screen:
    """A screen in the plane z = 0 with its lower left corner at (x, y)."""
    return screen(name, (x, y, 0), (x + width, y, 0), (x, y + height, 0), **more)  # type: ignore[arg-type]


def graph(
    boxes: dict[str, tuple[str, str, Sequence[str]]], *, bytes_per_s: float = 1e6, screens: Sequence[Screen] = ()
) -> Diagram:
    """A diagram of boxes {id: (op, process, inputs)}, inputs first; edges between processes carry `bytes_per_s`."""
    processes: dict[str, Process] = {}
    for _, process, _ in boxes.values():
        role: Role = "head" if process == "head" else "renderer" if process.startswith("rank") else "compositor"
        processes.setdefault(process, Process(label=process, detail="", role=role))
    edges = []
    for name, (_, process, inputs) in boxes.items():
        for start in inputs:
            crosses = boxes[start][1] != process
            edges.append(Edge(start=start, end=name, bytes_per_s=bytes_per_s if crosses else 0.0, crosses=crosses))
    return Diagram(
        name="diagram",
        size=(800, 600),
        screens=tuple(screens) or (upright("only", 0.0, 0.0),),
        processes=processes,
        boxes=tuple(
            Box(id=name, op=op, detail="800 x 600 px", process=process, source=not inputs, sink=op == "sink")
            for name, (op, process, inputs) in boxes.items()
        ),
        edges=tuple(edges),
        assumptions=("assumed",),
    )


def sort_first(panels: int, *, compositors: int = 1) -> Diagram:
    """Samples, reconstruction a panel, one image, its page."""
    boxes: dict[str, tuple[str, str, Sequence[str]]] = {}
    for k in range(panels):
        process = k * compositors // panels
        boxes[f"s{k}"] = ("samples", f"rank {k + compositors}", ())
        boxes[f"p{k}"] = ("reconstruct", f"compositor {process}" if process else "head", (f"s{k}",))
    boxes["wall"] = ("tile", "head", tuple(f"p{k}" for k in range(panels)))
    boxes["page"] = ("sink", "head", ("wall",))
    return graph(boxes)


def binary_tree(leaves: int) -> Diagram:
    """Sort-last: every rank reconstructs what it renders, pairs are merged on the first of the two, all on the head."""
    boxes: dict[str, tuple[str, str, Sequence[str]]] = {}
    level = []
    for k in range(leaves):
        boxes[f"s{k}"] = ("samples", f"rank {k + 1}", ())
        boxes[f"f{k}"] = ("reconstruct", f"rank {k + 1}", (f"s{k}",))
        level.append(f"f{k}")
    while len(level) > 1:
        merged = []
        for a, b in zip(level[::2], level[1::2], strict=True):
            process = boxes[a][1] if len(level) > 2 else "head"
            boxes[f"d{len(boxes)}"] = ("depth", process, (a, b))
            merged.append(f"d{len(boxes) - 1}")
        level = merged
    boxes["page"] = ("sink", "head", (level[0],))
    return graph(boxes)
