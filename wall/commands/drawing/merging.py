"""Merge equivalent nodes, so that the graph of a wall of a thousand panels has five boxes.

Two nodes are equivalent if they do the same in equivalent processes, with equivalent inputs and users. The classes
are found by partition refinement (Hopcroft 1971, in its plain form): classes are split until none changes.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

from wall.commands.drawing.graph_layout import levels
from wall.commands.drawing.model import Box, Diagram, Edge, Process

MOST_ROWS = 12  # nodes above each other that are still drawn one by one
SPAN = " … "

Kinds = Callable[[Diagram], dict[str, int]]


def merged(diagram: Diagram) -> Diagram:
    """Merge equivalent nodes until at most about MOST_ROWS stand above each other.

    First nodes are merged inside their process, then equivalent compositors are merged too, and at last all nodes of
    a layer that do the same in the same kind of process.
    """
    kinds: tuple[Kinds, ...] = (_equivalent_in_one_process, _equivalent, _of_one_layer)
    for told in kinds:
        if _rows(diagram) <= MOST_ROWS:
            break
        diagram = _merge(diagram, told(diagram), whole_roles=told is _of_one_layer)
    return diagram


def _rows(diagram: Diagram) -> int:
    """The most nodes that stand above each other."""
    return max(Counter(levels(diagram.boxes, diagram.edges).values()).values())


def _merge(diagram: Diagram, kinds: dict[str, int], *, whole_roles: bool) -> Diagram:
    """Merge boxes of one kind; `whole_roles`: into one process for all renderers, one for all compositors."""
    members: dict[int, list[Box]] = defaultdict(list)
    for box in diagram.boxes:
        members[kinds[box.id]].append(box)
    names = {kind: boxes[0].id for kind, boxes in members.items()}
    processes = dict(diagram.processes)
    keys: dict[str, list[str]] = defaultdict(list)
    for box in diagram.boxes if whole_roles else ():
        keys[processes[box.process].role].append(box.process)
    together = []
    for boxes in members.values():
        own = [box.process for box in boxes]
        together.append(_merged_box(boxes, _common_process(keys.get(processes[own[0]].role, own), processes)))
    sums: dict[tuple[str, str, bool], list[Edge]] = defaultdict(list)
    for edge in diagram.edges:
        sums[names[kinds[edge.start]], names[kinds[edge.end]], edge.crosses].append(edge)
    edges = [
        Edge(
            start=start,
            end=end,
            bytes_per_s=sum(edge.bytes_per_s for edge in every),
            crosses=crosses,
            count=sum(edge.count for edge in every),
        )
        for (start, end, crosses), every in sums.items()
    ]
    moved = {box.process: one.process for boxes, one in zip(members.values(), together, strict=True) for box in boxes}
    screens = tuple(replace(screen, process=moved.get(screen.process, "")) for screen in diagram.screens)
    return replace(diagram, screens=screens, boxes=tuple(together), edges=tuple(edges), processes=processes)


def _equivalent_in_one_process(diagram: Diagram) -> dict[str, int]:
    """Classes of equivalent nodes, apart for each head and compositor."""
    return _partition(diagram, merged=False)


def _equivalent(diagram: Diagram) -> dict[str, int]:
    """Classes of equivalent nodes over all processes of a role."""
    return _partition(diagram, merged=True)


def _of_one_layer(diagram: Diagram) -> dict[str, int]:
    """Classes of nodes with the same operator, layer and role."""
    level = levels(diagram.boxes, diagram.edges)
    return _numbered({box.id: (box.op, level[box.id], diagram.processes[box.process].role) for box in diagram.boxes})


def _partition(diagram: Diagram, *, merged: bool) -> dict[str, int]:
    """Classes of equivalent nodes; `merged`: compositors of different processes may be equivalent."""

    def process(box: Box) -> str:
        role = diagram.processes[box.process].role
        return role if merged or role == "renderer" else box.process

    inputs, users = defaultdict(list), defaultdict(list)
    for edge in diagram.edges:
        inputs[edge.end].append((edge.start, edge.crosses))
        users[edge.start].append((edge.end, edge.crosses))
    kinds = _numbered({box.id: (box.op, box.count, process(box), box.sink and box.detail) for box in diagram.boxes})
    while True:
        told = {
            box.id: (
                kinds[box.id],
                tuple(sorted({(kinds[name], crosses) for name, crosses in inputs[box.id]})),
                tuple(sorted({(kinds[name], crosses) for name, crosses in users[box.id]})),
            )
            for box in diagram.boxes
        }
        finer = _numbered(told)
        if len(set(finer.values())) == len(set(kinds.values())):
            return finer
        kinds = finer


def _numbered(told: Mapping[str, object]) -> dict[str, int]:
    """The class of each node: equal values have equal numbers, from 0 in order of appearance."""
    numbers: dict[object, int] = {}
    return {name: numbers.setdefault(what, len(numbers)) for name, what in told.items()}


def _merged_box(boxes: list[Box], process: str) -> Box:
    """Several boxes as one, titled by the first and the last."""
    if len(boxes) == 1:
        return replace(boxes[0], process=process)
    details = {box.detail for box in boxes}
    first, last = (box.title or box.id for box in (boxes[0], boxes[-1]))
    return replace(
        boxes[0],
        process=process,
        title=f"{first.partition(SPAN)[0]}{SPAN}{last.rpartition(SPAN)[2]}",
        detail=details.pop() if len(details) == 1 else "",
        count=sum(box.count for box in boxes),
    )


def _common_process(keys: Sequence[str], processes: dict[str, Process]) -> str:
    """The process of merged boxes: their own, or a new one named after the first and the last."""
    order = {key: k for k, key in enumerate(processes)}
    different = sorted(set(keys), key=order.__getitem__)
    if len(different) == 1:
        return different[0]
    first, last = processes[different[0]], processes[different[-1]]
    count = sum(processes[key].count for key in different)
    label = f"{first.label.partition(SPAN)[0]}{SPAN}{last.label.rpartition(SPAN)[2]}"
    processes[label] = replace(first, label=label, detail=f"{count} processes", count=count)
    return label
