"""Alike nodes as one: a wall of a thousand panels is still a graph of five boxes.

Two nodes are alike if they do the same in alike places, take from alike nodes and give to alike ones; found by
refining a partition until nothing more can be told apart (the partition refinement of Hopcroft, done plainly).
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Mapping
from dataclasses import replace

from wall.drawing.layers import levels
from wall.drawing.model import Box, Place, Sketch, Wire

MOST_ROWS = 12  # nodes above each other that are still drawn one by one


def bundled(sketch: Sketch) -> Sketch:
    """The same graph with at most about MOST_ROWS nodes above each other, if alike nodes allow that.

    First every head and compositor keeps its own bundles; if that is not enough, alike compositors are one too.
    """
    for merged in (False, True):
        if _rows(sketch) <= MOST_ROWS:
            return sketch
        sketch = _quotient(sketch, merged=merged)
    return sketch


def _rows(sketch: Sketch) -> int:
    return max(Counter(levels(sketch.boxes, sketch.wires).values()).values())


def _quotient(sketch: Sketch, *, merged: bool) -> Sketch:
    kinds = _kinds(sketch, merged=merged)
    members: dict[int, list[Box]] = defaultdict(list)
    for box in sketch.boxes:
        members[kinds[box.id]].append(box)
    names = {kind: boxes[0].id for kind, boxes in members.items()}
    places = dict(sketch.places)
    together = []
    for boxes in members.values():
        key = _place_of(boxes, places)
        together.append(_as_one(boxes, key))
    sums: dict[tuple[str, str], list[Wire]] = defaultdict(list)
    for wire in sketch.wires:
        sums[names[kinds[wire.start]], names[kinds[wire.end]]].append(wire)
    wires = [
        Wire(
            start=start,
            end=end,
            bytes_per_s=sum(wire.bytes_per_s for wire in every),
            crosses=every[0].crosses,
            count=sum(wire.count for wire in every),
        )
        for (start, end), every in sums.items()
    ]
    return replace(sketch, boxes=tuple(together), wires=tuple(wires), places=places)


def _kinds(sketch: Sketch, *, merged: bool) -> dict[str, int]:
    def place(box: Box) -> str:
        role = sketch.places[box.place].role
        return role if merged or role == "renderer" else box.place

    inputs, users = defaultdict(list), defaultdict(list)
    for wire in sketch.wires:
        inputs[wire.end].append((wire.start, wire.crosses))
        users[wire.start].append((wire.end, wire.crosses))
    kinds = _numbered({box.id: (box.op, box.count, place(box), box.sink and box.detail) for box in sketch.boxes})
    while True:
        told = {
            box.id: (
                kinds[box.id],
                tuple(sorted({(kinds[name], crosses) for name, crosses in inputs[box.id]})),
                tuple(sorted({(kinds[name], crosses) for name, crosses in users[box.id]})),
            )
            for box in sketch.boxes
        }
        finer = _numbered(told)
        if len(set(finer.values())) == len(set(kinds.values())):
            return finer
        kinds = finer


def _numbered(told: Mapping[str, object]) -> dict[str, int]:
    numbers: dict[object, int] = {}
    return {name: numbers.setdefault(what, len(numbers)) for name, what in told.items()}


def _as_one(boxes: list[Box], place: str) -> Box:
    if len(boxes) == 1:
        return replace(boxes[0], place=place)
    details = {box.detail for box in boxes}
    span = f"{boxes[0].id} … {boxes[-1].id}"
    return replace(
        boxes[0],
        place=place,
        title=span,
        detail=details.pop() if len(details) == 1 else "",
        count=sum(box.count for box in boxes),
    )


def _place_of(boxes: list[Box], places: dict[str, Place]) -> str:
    """The place of alike boxes; a new one that names the first and the last where they differ."""
    keys = list(dict.fromkeys(box.place for box in boxes))
    if len(keys) == 1:
        return keys[0]
    first, last = places[keys[0]], places[keys[-1]]
    key = f"{keys[0]} … {keys[-1]}"
    places[key] = replace(first, label=f"{first.label} … {last.label}", detail=f"{len(keys)} processes")
    return key
