"""Where boxes stand: in layers, each process a rectangle, nothing over anything else."""

from __future__ import annotations

from itertools import combinations

import pytest
from small_diagrams import binary_tree, graph, sort_first

from wall.commands.drawing.graph_layout import GraphLayout, lay_out, levels
from wall.commands.drawing.model import Diagram

HEIGHT_MM = 7.0
SKETCHES = {
    "one panel": sort_first(1),
    "eight panels": sort_first(8),
    "two compositors": sort_first(5, compositors=2),
    "tree": binary_tree(8),
    "long edge": graph(
        {
            "s": ("samples", "rank 1", ()),
            "f": ("reconstruct", "compositor 1", ("s",)),
            "g": ("scale", "head", ("f",)),
            "h": ("flip", "compositor 1", ("g",)),
            "i": ("crop", "head", ("h",)),
            "j": ("depth", "head", ("i", "f")),
            "k": ("sink", "head", ("j",)),
        }
    ),
}


def layout(diagram: Diagram) -> GraphLayout:
    heights = {box.id: HEIGHT_MM for box in diagram.boxes}
    return lay_out(
        diagram.boxes, diagram.edges, heights, lambda process: (0.0, 0.0) if "rank" in process else (6.0, 1.5)
    )


def test_layers_are_longest_paths() -> None:
    diagram = SKETCHES["long edge"]
    assert levels(diagram.boxes, diagram.edges) == {"s": 0, "f": 1, "g": 2, "h": 3, "i": 4, "j": 5, "k": 6}


def test_a_source_image_stands_just_before_its_user() -> None:
    boxes = {
        "s": ("samples", "rank 1", ()),
        "f": ("reconstruct", "head", ("s",)),
        "logo": ("image", "head", ()),
        "o": ("over", "head", ("f", "logo")),
    }
    diagram = graph(boxes)
    assert levels(diagram.boxes, diagram.edges)["logo"] == 1


@pytest.mark.parametrize("name", SKETCHES)
def test_boxes_of_a_layer_do_not_cover_each_other(name: str) -> None:
    found = layout(SKETCHES[name])
    for a, b in combinations(SKETCHES[name].boxes, 2):
        if found.level[a.id] == found.level[b.id]:
            assert abs(found.middle[a.id] - found.middle[b.id]) >= HEIGHT_MM


@pytest.mark.parametrize("name", SKETCHES)
def test_processes_that_share_a_layer_do_not_cover_each_other(name: str) -> None:
    for a, b in combinations(layout(SKETCHES[name]).clusters, 2):
        (a0, a1), (b0, b1) = a.span, b.span
        if a0 <= b1 and b0 <= a1:
            assert a.top + a.height <= b.top + 1e-9 or b.top + b.height <= a.top + 1e-9


@pytest.mark.parametrize("name", SKETCHES)
def test_boxes_stand_inside_their_process_and_its_page(name: str) -> None:
    found, diagram = layout(SKETCHES[name]), SKETCHES[name]
    clusters = {cluster.process: cluster for cluster in found.clusters if cluster.process}
    for box in diagram.boxes:
        cluster = clusters[box.process]
        low, high = cluster.top + cluster.head + cluster.pad, cluster.top + cluster.height - cluster.pad
        assert low + HEIGHT_MM / 2 - 1e-9 <= found.middle[box.id] <= high - HEIGHT_MM / 2 + 1e-9
        assert 0 <= cluster.top <= cluster.top + cluster.height <= found.height + 1e-9


def test_panels_keep_their_order_and_their_edges_are_straight() -> None:
    found = layout(SKETCHES["eight panels"])
    rows = [found.middle[f"s{k}"] for k in range(8)]
    assert rows == sorted(rows)
    assert [found.middle[f"p{k}"] for k in range(8)] == pytest.approx(rows)


def test_a_tree_has_no_crossings() -> None:
    diagram = SKETCHES["tree"]
    found = layout(diagram)
    for a, b in combinations(diagram.edges, 2):
        if found.level[a.start] == found.level[b.start] and found.level[a.end] == found.level[b.end]:
            left = found.middle[a.start] - found.middle[b.start]
            right = found.middle[a.end] - found.middle[b.end]
            assert left * right >= -1e-9
