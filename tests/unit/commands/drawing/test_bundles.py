"""Alike nodes as one box: nothing is lost, and small graphs stay as they are."""

from __future__ import annotations

from dataclasses import replace

import pytest
from small_sketches import binary_tree, sort_first, upright

from wall.commands.drawing.bundles import MOST_ROWS, bundled
from wall.commands.drawing.model import Sketch


def ops(sketch: Sketch) -> dict[str, int]:
    """Nodes by operator, however they are drawn."""
    found: dict[str, int] = {}
    for box in sketch.boxes:
        found[box.op] = found.get(box.op, 0) + box.count
    return found


def test_a_small_graph_is_drawn_node_by_node() -> None:
    sketch = sort_first(MOST_ROWS)
    assert bundled(sketch) is sketch


def test_a_thousand_panels_are_four_boxes() -> None:
    found = bundled(sort_first(1024))
    assert [(box.id, box.op, box.count) for box in found.boxes] == [
        ("s0", "samples", 1024),
        ("p0", "reconstruct", 1024),
        ("wall", "tile", 1),
        ("page", "sink", 1),
    ]
    assert found.boxes[0].title == "s0 … s1023"
    assert found.places[found.boxes[0].place].label == "rank 1 … rank 1024"


def test_every_compositor_keeps_its_own_bundle_where_there_is_room() -> None:
    found = bundled(sort_first(100, compositors=4))
    assert [(box.place, box.count) for box in found.boxes if box.op == "reconstruct"] == [
        ("head", 25),
        ("compositor 1", 25),
        ("compositor 2", 25),
        ("compositor 3", 25),
    ]


def test_many_compositors_become_one() -> None:
    found = bundled(sort_first(100, compositors=50))
    assert [(box.place, box.count) for box in found.boxes if box.op == "reconstruct"] == [
        ("head", 2),
        ("compositor 1 … compositor 49", 98),
    ]
    assert found.places["compositor 1 … compositor 49"].detail == "49 processes"


def test_panels_take_the_tint_of_the_bundle_that_composites_them() -> None:
    sketch = sort_first(100, compositors=50)
    screens = [replace(upright(f"p{k}", k, 0.0), place=place) for k, place in enumerate(("head", "compositor 7", ""))]
    found = bundled(replace(sketch, screens=tuple(screens)))
    assert [screen.place for screen in found.screens] == ["head", "compositor 1 … compositor 49", ""]


@pytest.mark.parametrize(
    "sketch", [sort_first(1024), sort_first(100, compositors=50), binary_tree(64)], ids=["large", "spread", "tree"]
)
def test_nodes_wires_and_bytes_are_all_still_there(sketch: Sketch) -> None:
    found = bundled(sketch)
    assert len(found.boxes) < len(sketch.boxes) / 4
    assert ops(found) == ops(sketch)
    for crosses in (False, True):
        before = [wire for wire in sketch.wires if wire.crosses == crosses]
        after = [wire for wire in found.wires if wire.crosses == crosses]
        assert sum(wire.count for wire in after) == len(before)
        assert sum(wire.bytes_per_s for wire in after) == sum(wire.bytes_per_s for wire in before)
    assert sum(found.incoming().values()) == sum(sketch.incoming().values())


def test_a_large_tree_becomes_one_box_a_level() -> None:
    found = bundled(binary_tree(64))
    assert [box.count for box in found.boxes] == [64, 64, 32, 16, 8, 4, 2, 1, 1]
