"""Walls and graphs to draw, without a configuration behind them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from wall.commands.drawing.model import Box, Place, Role, Screen, Sketch, Wire

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
) -> Sketch:
    """A sketch of boxes {id: (op, place, inputs)}, inputs first; wires between places carry `bytes_per_s`."""
    places: dict[str, Place] = {}
    for _, place, _ in boxes.values():
        role: Role = "head" if place == "head" else "renderer" if place.startswith("rank") else "compositor"
        places.setdefault(place, Place(label=place, detail="", role=role))
    wires = []
    for name, (_, place, inputs) in boxes.items():
        for start in inputs:
            crosses = boxes[start][1] != place
            wires.append(Wire(start=start, end=name, bytes_per_s=bytes_per_s if crosses else 0.0, crosses=crosses))
    return Sketch(
        name="sketch",
        size=(800, 600),
        screens=tuple(screens) or (upright("only", 0.0, 0.0),),
        places=places,
        boxes=tuple(
            Box(id=name, op=op, detail="800 x 600 px", place=place, source=not inputs, sink=op == "sink")
            for name, (op, place, inputs) in boxes.items()
        ),
        wires=tuple(wires),
        remarks=("assumed",),
    )


def sort_first(panels: int, *, compositors: int = 1) -> Sketch:
    """Samples, reconstruction a panel, one picture, its page."""
    boxes: dict[str, tuple[str, str, Sequence[str]]] = {}
    for k in range(panels):
        place = k * compositors // panels
        boxes[f"s{k}"] = ("samples", f"rank {k + compositors}", ())
        boxes[f"p{k}"] = ("reconstruct", f"compositor {place}" if place else "head", (f"s{k}",))
    boxes["wall"] = ("tile", "head", tuple(f"p{k}" for k in range(panels)))
    boxes["page"] = ("sink", "head", ("wall",))
    return graph(boxes)


def binary_tree(leaves: int) -> Sketch:
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
            place = boxes[a][1] if len(level) > 2 else "head"
            boxes[f"d{len(boxes)}"] = ("depth", place, (a, b))
            merged.append(f"d{len(boxes) - 1}")
        level = merged
    boxes["page"] = ("sink", "head", (level[0],))
    return graph(boxes)
