"""Alike nodes as one: a wall of a thousand panels is still a graph of five boxes.

Two nodes are alike if they do the same in alike places, take from alike nodes and give to alike ones; found by
refining a partition until nothing more can be told apart (the partition refinement of Hopcroft, done plainly).
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

from wall.commands.drawing.layers import levels
from wall.commands.drawing.model import Box, Place, Sketch, Wire

MOST_ROWS = 12  # nodes above each other that are still drawn one by one
SPAN = " … "

Kinds = Callable[[Sketch], dict[str, int]]


def bundled(sketch: Sketch) -> Sketch:
    """The same graph with at most about MOST_ROWS nodes above each other, if alike nodes allow that.

    First every head and compositor keeps its own bundles, then alike compositors are one too; at last all nodes of
    a layer that do the same in the same kind of process are.
    """
    kinds: tuple[Kinds, ...] = (_alike_in_one_place, _alike, _of_one_layer)
    for told in kinds:
        if _rows(sketch) <= MOST_ROWS:
            break
        sketch = _quotient(sketch, told(sketch), whole_roles=told is _of_one_layer)
    return sketch


def _rows(sketch: Sketch) -> int:
    return max(Counter(levels(sketch.boxes, sketch.wires).values()).values())


def _quotient(sketch: Sketch, kinds: dict[str, int], *, whole_roles: bool) -> Sketch:
    """Boxes of one kind as one; `whole_roles`: in one place for all renderers, one for all compositors."""
    members: dict[int, list[Box]] = defaultdict(list)
    for box in sketch.boxes:
        members[kinds[box.id]].append(box)
    names = {kind: boxes[0].id for kind, boxes in members.items()}
    places = dict(sketch.places)
    keys: dict[str, list[str]] = defaultdict(list)
    for box in sketch.boxes if whole_roles else ():
        keys[places[box.place].role].append(box.place)
    together = []
    for boxes in members.values():
        own = [box.place for box in boxes]
        together.append(_as_one(boxes, _common_place(keys.get(places[own[0]].role, own), places)))
    sums: dict[tuple[str, str, bool], list[Wire]] = defaultdict(list)
    for wire in sketch.wires:
        sums[names[kinds[wire.start]], names[kinds[wire.end]], wire.crosses].append(wire)
    wires = [
        Wire(
            start=start,
            end=end,
            bytes_per_s=sum(wire.bytes_per_s for wire in every),
            crosses=crosses,
            count=sum(wire.count for wire in every),
        )
        for (start, end, crosses), every in sums.items()
    ]
    moved = {box.place: one.place for boxes, one in zip(members.values(), together, strict=True) for box in boxes}
    screens = tuple(replace(screen, place=moved.get(screen.place, "")) for screen in sketch.screens)
    return replace(sketch, screens=screens, boxes=tuple(together), wires=tuple(wires), places=places)


def _alike_in_one_place(sketch: Sketch) -> dict[str, int]:
    return _refined(sketch, merged=False)


def _alike(sketch: Sketch) -> dict[str, int]:
    return _refined(sketch, merged=True)


def _of_one_layer(sketch: Sketch) -> dict[str, int]:
    level = levels(sketch.boxes, sketch.wires)
    return _numbered({box.id: (box.op, level[box.id], sketch.places[box.place].role) for box in sketch.boxes})


def _refined(sketch: Sketch, *, merged: bool) -> dict[str, int]:
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
    first, last = (box.title or box.id for box in (boxes[0], boxes[-1]))
    return replace(
        boxes[0],
        place=place,
        title=f"{first.partition(SPAN)[0]}{SPAN}{last.rpartition(SPAN)[2]}",
        detail=details.pop() if len(details) == 1 else "",
        count=sum(box.count for box in boxes),
    )


def _common_place(keys: Sequence[str], places: dict[str, Place]) -> str:
    """The place of alike boxes; a new one that names the first and the last where they differ."""
    order = {key: k for k, key in enumerate(places)}
    different = sorted(set(keys), key=order.__getitem__)
    if len(different) == 1:
        return different[0]
    first, last = places[different[0]], places[different[-1]]
    count = sum(places[key].count for key in different)
    label = f"{first.label.partition(SPAN)[0]}{SPAN}{last.label.rpartition(SPAN)[2]}"
    places[label] = replace(first, label=label, detail=f"{count} processes", count=count)
    return label
