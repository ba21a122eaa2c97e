"""Equivalent nodes are merged into one box: no edge is lost, and small graphs stay as they are."""

from __future__ import annotations

from dataclasses import replace

import pytest
from small_diagrams import binary_tree, sort_first, upright

from wall.commands.drawing.merging import MOST_ROWS, merged
from wall.commands.drawing.model import Diagram


def ops(diagram: Diagram) -> dict[str, int]:
    """Nodes by operator, however they are drawn."""
    found: dict[str, int] = {}
    for box in diagram.boxes:
        found[box.op] = found.get(box.op, 0) + box.count
    return found


def test_a_small_graph_is_drawn_node_by_node() -> None:
    diagram = sort_first(MOST_ROWS)
    assert merged(diagram) is diagram


def test_a_thousand_panels_are_four_boxes() -> None:
    found = merged(sort_first(1024))
    assert [(box.id, box.op, box.count) for box in found.boxes] == [
        ("s0", "samples", 1024),
        ("p0", "reconstruct", 1024),
        ("wall", "tile", 1),
        ("page", "sink", 1),
    ]
    assert found.boxes[0].title == "s0 … s1023"
    assert found.processes[found.boxes[0].process].label == "rank 1 … rank 1024"


def test_nodes_of_different_compositors_stay_apart_where_there_is_room() -> None:
    found = merged(sort_first(100, compositors=4))
    assert [(box.process, box.count) for box in found.boxes if box.op == "reconstruct"] == [
        ("head", 25),
        ("compositor 1", 25),
        ("compositor 2", 25),
        ("compositor 3", 25),
    ]


def test_many_compositors_become_one() -> None:
    found = merged(sort_first(100, compositors=50))
    assert [(box.process, box.count) for box in found.boxes if box.op == "reconstruct"] == [
        ("head", 2),
        ("compositor 1 … compositor 49", 98),
    ]
    assert found.processes["compositor 1 … compositor 49"].detail == "49 processes"


def test_panels_take_the_colour_of_the_process_that_composites_them() -> None:
    diagram = sort_first(100, compositors=50)
    screens = [
        replace(upright(f"p{k}", k, 0.0), process=process) for k, process in enumerate(("head", "compositor 7", ""))
    ]
    found = merged(replace(diagram, screens=tuple(screens)))
    assert [screen.process for screen in found.screens] == ["head", "compositor 1 … compositor 49", ""]


@pytest.mark.parametrize(
    "diagram", [sort_first(1024), sort_first(100, compositors=50), binary_tree(64)], ids=["large", "spread", "tree"]
)
def test_nodes_edges_and_bytes_are_all_kept(diagram: Diagram) -> None:
    found = merged(diagram)
    assert len(found.boxes) < len(diagram.boxes) / 4
    assert ops(found) == ops(diagram)
    for crosses in (False, True):
        before = [edge for edge in diagram.edges if edge.crosses == crosses]
        after = [edge for edge in found.edges if edge.crosses == crosses]
        assert sum(edge.count for edge in after) == len(before)
        assert sum(edge.bytes_per_s for edge in after) == sum(edge.bytes_per_s for edge in before)
    assert sum(found.incoming().values()) == sum(diagram.incoming().values())


def test_a_large_tree_becomes_one_box_a_level() -> None:
    found = merged(binary_tree(64))
    assert [box.count for box in found.boxes] == [64, 64, 32, 16, 8, 4, 2, 1, 1]
