"""What the planner adds before a window: each panel's own pixels, then its colour, blending, warp and mask."""

from __future__ import annotations

from small_graphs import WHOLE, built, nodes, refusals

from wall.compositing.graph import Graph
from wall.config.loading import loads
from wall.roles.plan import make_layout

FITTED = """\
wall:
  panels:
    - id: r0c0
      pixels: [8, 6]
      corners: {lower_left: [0, 0, 0], lower_right: [0.8, 0, 0], upper_left: [0, 0.6, 0]}
    - id: r0c1
      pixels: [8, 6]
      corners: {lower_left: [0.6, 0, 0], lower_right: [1.4, 0, 0], upper_left: [0.6, 0.6, 0]}
      overlap: {left: 0.2}
      blend: {left: 0.2, gamma: 2.0}
      colour: {gain: 0.5}
      warp: {columns: 2, rows: 2, points: [[0, 0], [1, 0], [0, 1], [0.9, 1]]}
      blend_mask: right.png
"""
WINDOW = "id: out, op: sink, kind: window, input: w"


def before(graph: Graph, name: str) -> list[str]:
    """The operations that lead from a reconstruction to a node, nearest last, of single inputs."""
    found: list[str] = []
    step = graph.step(name)
    while len(step.inputs) == 1:
        step = graph.steps[step.inputs[0]]
        found.insert(0, step.node.op)  # type: ignore[attr-defined]
    return found


def test_each_panel_gets_its_own_pixels_and_what_its_display_needs() -> None:
    wall = FITTED.replace("corners: {lower_left: [0,", "overlap: {right: 0.2}\n      corners: {lower_left: [0,", 1)
    graph = built(nodes(*WHOLE[:5], WINDOW), wall=wall)

    assert [sink.id for sink in graph.sinks] == ["out.0", "out.1"]
    assert before(graph, "out.0") == ["tile", "crop"]
    assert before(graph, "out.1") == ["tile", "crop", "colour", "blend_edges", "warp", "blend_mask"]
    assert graph.step("out.1").panels == (1,)
    blend = graph.step("out.1.blend").node
    assert (blend.left, blend.right, blend.gamma) == (2, 0, 2.0)  # type: ignore[attr-defined]  # 0.2 m of 0.1 m pixels


def test_a_panel_s_own_framelet_goes_to_its_window_as_it_is() -> None:
    graph = built(
        nodes(*WHOLE[:5], "id: out, op: sink, kind: window, input: p0", "id: f, op: sink, kind: png, input: w")
    )

    assert before(graph, "out") == ["reconstruct"]


def test_added_nodes_do_not_take_a_name_that_is_there() -> None:
    taken = ("id: out.0.crop, op: flip, input: w, axis: horizontal", "id: f, op: sink, kind: png, input: out.0.crop")
    graph = built(nodes(*WHOLE[:5], WINDOW, *taken))

    assert graph.step("out.0.crop").node.op == "flip"  # type: ignore[attr-defined]
    assert graph.step("out.0.crop_").node.op == "crop"  # type: ignore[attr-defined]


def test_a_image_without_a_whole_panel_is_refused_as_a_window() -> None:
    small = ("id: s, op: scale, input: w, factor: 0.5, filter: box", "id: out, op: sink, kind: window, input: s")
    found = refusals(nodes(*WHOLE[:5], "id: f, op: sink, kind: png, input: w", *small))

    assert found == [
        "a.yaml:14:48: graph.nodes[7].input = 's': s holds no whole panel, and windows show panels; "
        "accepted: a node that holds the pixels of one panel or more"
    ]


def test_a_second_window_of_a_panel_on_one_rank_is_refused() -> None:
    again = "id: again, op: sink, kind: window, input: p1"

    assert refusals(nodes(*WHOLE[:5], WINDOW, again)) == [
        "a.yaml:13:50: graph.nodes[6].input = 'p1': panel r0c1 has a window there already, that of out; "
        "accepted: panels without a window on the same rank, or no out"
    ]


def test_windows_of_one_panel_on_two_ranks_are_not_refused() -> None:
    other = "id: other, op: sink, kind: window, input: p1, on: compositor 1"
    graph = built(nodes(*WHOLE[:5], f"{WINDOW}, on: head", other, head="  compositors: 2\n"))

    assert {sink.id: graph.step(sink.id).rank for sink in graph.sinks} == {"out.0": 0, "out.1": 0, "other": 1}


CURVED = """\
wall:
  panels:
    - {id: r0c0, pixels: [8, 6], corners: {lower_left: [0, 0, 0], lower_right: [0.8, 0, 0], upper_left: [0, 0.6, 0]}}
    - id: r0c1
      pixels: [10, 6]
      surface: {type: cylinder, radius: 1, angles: [-30, 30], heights: [0, 0.6]}
      eye: [0, 0.3, 0.5]
      overlap: {left: 0.2}
      blend: {left: 0.2}
"""


def test_a_curved_panel_s_window_bends_its_image_before_the_ramps() -> None:
    graph = built(nodes(*WHOLE[:5], WINDOW), wall=CURVED)

    assert before(graph, "out.0") == ["tile", "crop"]
    assert before(graph, "out.1") == ["tile", "crop", "curve", "blend_edges"]
    blend = graph.step("out.1.blend").node
    assert blend.left == 2  # type: ignore[attr-defined]  # 0.2 m of pixels of pi / 30 m along the arc


def test_curve_takes_a_curved_panel_s_flat_image_alone() -> None:
    png = "id: png, op: sink, kind: png, input: w"
    graph = built(
        nodes(*WHOLE[:5], png, "id: c, op: curve, input: p1, panel: r0c1", "id: b, op: sink, kind: png, input: c"),
        wall=CURVED,
    )
    assert graph.step("c").rect == graph.step("p1").rect

    for node, said in (
        ("id: c, op: curve, input: p0, panel: r0c0", "panel = 'r0c0': r0c0 is flat; accepted: a panel with a surface"),
        ("id: c, op: curve, input: w, panel: r0c1", "input = 'w': w is not the flat image of panel r0c1"),
        ("id: c, op: curve, input: p0, panel: r0c1", "input = 'p0': p0 is not the flat image of panel r0c1"),
        ("id: c, op: curve, input: p1, panel: no", "panel = 'no': there is no such panel"),
    ):
        lines = refusals(nodes(*WHOLE[:5], png, node, "id: b, op: sink, kind: png, input: c"), wall=CURVED)
        assert said in lines[0]


PLACED = """\
version: 1
scene: {source: spheres}
wall: {grid: {columns: 2, rows: 1, pixels: [16, 9], size: [0.16, 0.09], host: "node{column}", monitor: 0}}
views: [{id: main}]
"""


def test_what_a_wall_of_several_hosts_would_meet_is_noted() -> None:
    def noted(more: str) -> list[str]:
        return list(make_layout(loads(PLACED + more, name="w.yaml")).notes)

    reached, nowhere = noted("")
    assert "transport.bind: only the machine of the head can reach it, and panels are on node0, node1" in reached
    assert nowhere.startswith("w.yaml: panel r0c0 and 1 more name a monitor or window, and no sink opens windows: ")
    bound = "transport: {bind: 0.0.0.0}\n"
    assert noted(bound) == [nowhere]
    assert noted(bound + "graph: {preset: sort-first, sinks: [window], compositors: 2}\n") == []
