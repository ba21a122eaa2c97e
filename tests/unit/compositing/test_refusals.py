"""Whatever is wrong with a graph is refused with its position in the file, with a hint."""

from __future__ import annotations

import pytest
from small_graphs import CLEAR0, CLEAR1, PANEL0, PANEL1, WHOLE, built, nodes, refusals

PNG = "id: png, op: sink, kind: png, input: "
S0, P0, S1, P1, W, _ = WHOLE
ORDERED = tuple(line.replace("transparent", "transparent, order: 1") for line in (*CLEAR0, *CLEAR1))
TWO = "  compositors: 2\n"
FRAMED = "sampling: {method: framed}\n"

STRUCTURE = {
    "a circle": (
        nodes(*PANEL0, *PANEL1, "id: x, op: tile, inputs: [p0, y]", "id: y, op: newest, inputs: [x, p1]", PNG + "y"),
        "12:36: graph.nodes[5].inputs[0] = 'x': needs its own result: x -> y -> x; accepted: a graph without cycles",
    ),
    "a node that feeds itself": (
        nodes(*PANEL0, *PANEL1, "id: x, op: tile, inputs: [p0, p1, x]", PNG + "x"),
        "11:42: graph.nodes[4].inputs[2] = 'x': needs its own result: x -> x; accepted: a graph without cycles",
    ),
    "an unknown node": (
        nodes(*PANEL0, *PANEL1, "id: w, op: tile, inputs: [p0, p12]", PNG + "w"),
        "11:38: graph.nodes[4].inputs[1] = 'p12': there is no such node; accepted: p0, p1; did you mean p1?",
    ),
    "samples where a framelet is wanted": (
        nodes(*PANEL0, *PANEL1, "id: w, op: tile, inputs: [s0, p1]", PNG + "w"),
        "11:34: graph.nodes[4].inputs[0] = 's0': tile needs a framelet, samples gives samples; accepted: p0, p1",
    ),
    "a framelet where samples are wanted": (
        nodes(*WHOLE, "id: r, op: reconstruct, input: w"),
        "13:39: graph.nodes[6].input = 'w': reconstruct needs samples, tile gives a framelet; accepted: s0, s1",
    ),
    "an id twice": (
        nodes(*PANEL0, "id: p0, op: reconstruct, input: s0", PNG + "p0"),
        "9:12: graph.nodes[2].id = 'p0': nodes[1] has this id already; accepted: ids that differ",
    ),
    "no sink": (nodes(*PANEL0), "no image ends anywhere; accepted: a node with op: sink"),
    "a graph that renders nothing": (
        nodes("id: k, op: constant, area: [0, 0, 16, 6], colour: [1, 1, 1]", PNG + "k"),
        "nothing is rendered: there is no samples node; accepted: a node with op: samples",
    ),
    "samples that nobody uses": (
        nodes(*WHOLE, "id: s2, op: samples, panel: r0c0"),
        "13:12: graph.nodes[6].id = 's2': nobody uses what this node gives: its ranks would work for nothing; "
        "accepted: a node with input: s2",
    ),
    "a framelet that nobody uses": (
        nodes(*WHOLE, "id: k, op: sky, panel: r0c0"),
        "13:12: graph.nodes[6].id = 'k': nobody uses what this node gives: sky is done in vain; "
        "accepted: a node with input: k",
    ),
    "samples that two use": (
        nodes(*PANEL0, "id: q, op: reconstruct, input: s0", "id: n, op: newest, inputs: [p0, q]", PNG + "n"),
        "7:12: graph.nodes[0].id = 's0': samples are used more than once (p0, q); accepted: one reconstruct node",
    ),
    "an unknown panel": (
        nodes(S0, P0, "id: s1, op: samples, panel: r0c11", P1, W, PNG + "w"),
        "9:36: graph.nodes[2].panel = 'r0c11': there is no such panel; accepted: r0c0, r0c1; did you mean r0c1?",
    ),
}
RANKS = {
    "the head renders": (
        nodes("id: s0, op: samples, panel: r0c0, rank: 0", *WHOLE[1:]),
        "7:48: graph.nodes[0].rank = 0: rank 0 cannot render: rank 0 is the head; accepted: rank 1 or above",
    ),
    "a compositor renders": (
        nodes("id: s0, op: samples, panel: r0c0, rank: 1", *WHOLE[1:], head=TWO),
        "8:48: graph.nodes[0].rank = 1: rank 1 cannot render: ranks 0 to 1 are compositors; accepted: rank 2 or above",
    ),
    "ranks without work": (
        nodes("id: s0, op: samples, panel: r0c0, rank: 5", *WHOLE[1:]),
        "7:48: graph.nodes[0].rank = 5: rank 5 is named, and rank 2, 3, 4 has no work; accepted: ranks without a gap",
    ),
    "a rank twice": (
        nodes(f"{S0}, rank: 1", P0, f"{S1}, rank: 1", P1, W, PNG + "w"),
        "9:48: graph.nodes[2].rank = 1: rank 1 renders node s0 already; accepted: a rank of its own",
    ),
    "a rank and a group": (
        nodes(f"{S0}, rank: 1, group: g", *WHOLE[1:]),
        "7:48: graph.nodes[0].rank = 1: names one rank, and others beside; accepted: one of rank, group, ranks",
    ),
    "an unknown group": (
        nodes(f"{S0}, group: lefd", *WHOLE[1:], head="  groups: {left: [1]}\n"),
        "8:49: graph.nodes[0].group = 'lefd': there is no such group; accepted: left; did you mean left?",
    ),
    "a group without work": (
        nodes(*WHOLE, head="  groups: {left: [1, 2]}\n"),
        "6:18: graph.groups.left = [1, 2]: rank 1, 2 has no work; accepted: a samples node with group: left",
    ),
    "more ranks than named": (
        nodes(f"{S0}, group: left, ranks: 3", *WHOLE[1:], head="  groups: {left: [1, 2]}\n"),
        "8:62: graph.nodes[0].ranks = 3: more ranks than group left names (1, 2); "
        "accepted: 1 to 2, or more ranks in the group",
    ),
    "fewer ranks than named": (
        nodes(f"{S0}, group: left, ranks: 1", *WHOLE[1:], head="  groups: {left: [1, 2]}\n"),
        "8:62: graph.nodes[0].ranks = 1: rank 2 of group left has no work; accepted: 2",
    ),
    "an empty range": (
        nodes(f"{S0}, range: [0.5, 0.5]", *WHOLE[1:]),
        "7:49: graph.nodes[0].range = [0.5, 0.5]: holds nothing; accepted: [from, to] with from < to, both from 0 to 1",
    ),
    "a compositor without work": (
        nodes(*WHOLE, head="  compositors: 3\n"),
        "6:16: graph.compositors = 3: compositor 2 has nothing to do; "
        "accepted: nodes with `on` for each compositor, or fewer",
    ),
}
LAYERS = {
    "a layer as fast as its view": (
        nodes(S0, f"{P0}, refresh_hz: 60", *WHOLE[2:]),
        "8:56: graph.nodes[1].refresh_hz = 60: view main is shown at 60 Hz; "
        "accepted: below 60, or no refresh_hz: at every refresh",
    ),
    "a slow layer in lock step": (
        nodes(S0, f"{P0}, refresh_hz: 10", *WHOLE[2:], head="  sync: frame\n") + FRAMED,
        "9:56: graph.nodes[1].refresh_hz = 10: in lock step all layers of a frame are of one moment; "
        "accepted: no refresh_hz, or sync: none",
    ),
    "few samples in lock step": (
        nodes(f"{S0}, refresh_hz: 10", *WHOLE[1:], head="  sync: frame\n") + FRAMED,
        "8:54: graph.nodes[0].refresh_hz = 10: in lock step all layers of a frame are of one moment; "
        "accepted: no refresh_hz, or sync: none",
    ),
    "few samples of a progressive image": (
        nodes(f"{S0}, refresh_hz: 10", *WHOLE[1:]) + "sampling: {method: progressive}\n",
        "7:54: graph.nodes[0].refresh_hz = 10: the sampling method progressive begins anew at every input, at a rate "
        "of its own; accepted: no refresh_hz, or another method",
    ),
    "more pixels than the panel has": (
        nodes(f"{S0}, scale: 1.5", *WHOLE[1:]),
        "7:49: graph.nodes[0].scale = 1.5: is too large; accepted: a number above 0 to 1 (pixels that are traced, "
        "a share of the panel's in each direction; its reconstruct node enlarges)",
    ),
}
PLACEMENT = {
    "no compositor": (
        nodes(S0, f"{P0}, on: there", *WHOLE[2:]),
        "8:48: graph.nodes[1].on = 'there': names no compositor; "
        "accepted: head, panel, rank N, host NAME or compositor N",
    ),
    "samples with a compositor": (
        nodes(f"{S0}, on: head", *WHOLE[1:]),
        "7:46: graph.nodes[0].on = 'head': samples come from renderers; "
        "accepted: host NAME; or rank: N, or group: NAME, instead of on",
    ),
    "only the head": (
        nodes(S0, f"{P0}, on: rank 5", *WHOLE[2:]),
        "8:48: graph.nodes[1].on = 'rank 5': there is only compositor 0 (the head); "
        "accepted: rank 0 to 0, or more graph.compositors",
    ),
    "a renderer": (
        nodes(S0, f"{P0}, on: rank 2", *WHOLE[2:], head=TWO),
        "9:48: graph.nodes[1].on = 'rank 2': rank 2 is no compositor: those are ranks 0 to 1; "
        "accepted: rank 0 to 1, or more graph.compositors",
    ),
    "no such compositor": (
        nodes(S0, f"{P0}, on: compositor 5", *WHOLE[2:], head=TWO),
        "9:48: graph.nodes[1].on = 'compositor 5': there are 2 compositors; "
        "accepted: compositor 0 to 1, or more graph.compositors",
    ),
    "a host without compositor": (
        nodes(S0, f"{P0}, on: host x", *WHOLE[2:]),
        "8:48: graph.nodes[1].on = 'host x': no compositor is left that could be on host x; "
        "accepted: more graph.compositors",
    ),
    "the panel of several": (
        nodes(*WHOLE[:4], f"{W}, on: panel", PNG + "w", head=TWO),
        "12:47: graph.nodes[4].on = 'panel': this node holds pixels of panels of compositors 0, 1; "
        "accepted: head or compositor N",
    ),
    "pages of two compositors": (
        nodes(
            *WHOLE[:5], "id: page, op: sink, kind: browser, input: w",
            "id: other, op: sink, kind: browser, input: w, on: compositor 1", head=TWO,
        ),
        "14:58: graph.nodes[6].on = 'compositor 1': page is a page of rank 0, and all pages are served by one "
        "compositor; accepted: head",
    ),
}
PIXELS = {
    "a crop outside": (
        nodes(*WHOLE, "id: c, op: crop, input: p0, area: [4, 0, 8, 6]", "id: two, op: sink, kind: png, input: c"),
        "13:42: graph.nodes[6].area = [4, 0, 8, 6]: 8x6+4+0 reaches outside what it is cut from, 8x6+0+0; "
        "accepted: a rectangle inside 8x6+0+0",
    ),
    "a crop of another panel": (
        nodes(*WHOLE, "id: c, op: crop, input: p0, panel: r0c1", "id: two, op: sink, kind: png, input: c"),
        "13:43: graph.nodes[6].panel = 'r0c1': 8x6+8+0 reaches outside what it is cut from, 8x6+0+0; "
        "accepted: a rectangle inside 8x6+0+0",
    ),
    "a constant outside": (
        nodes(
            *WHOLE,
            "id: c, op: constant, area: [4, 0, 18, 6], colour: [1, 1, 1]",
            "id: two, op: sink, kind: png, input: c",
        ),
        "13:35: graph.nodes[6].area = [4, 0, 18, 6]: 18x6+4+0 reaches outside the wall of 16x6 pixels; "
        "accepted: a rectangle inside the wall",
    ),
    "more pixels than fit in memory": (
        nodes(
            *WHOLE,
            "id: h, op: scale, input: w, filter: box, size: [1048576, 1048576]",
            "id: m, op: flip, input: h, axis: vertical",
            "id: two, op: sink, kind: png, input: m",
        ),
        "13:55: graph.nodes[6].size = [1048576, 1048576]: 1048576x1048576+0+0 is 1,099,511,627,776 pixels; "
        "accepted: at most 268,435,456 pixels",
    ),
    "pixels that come twice": (
        nodes(*CLEAR0, *PANEL0, *PANEL1, "id: w, op: tile, inputs: [p0, a, p1]", PNG + "w"),
        "13:38: graph.nodes[6].inputs[1] = 'a': pixels 8x6+0+0 come from p0 already; "
        "accepted: depth, over, newest, age_blend or average, which say how",
    ),
    "a panel that nobody covers": (
        nodes(*PANEL0, PNG + "p0"),
        "nobody covers panel r0c1; accepted: nodes that lead from it to a sink",
    ),
    "pixels that nobody covers": (
        nodes(
            *PANEL0,
            *PANEL1,
            "id: c, op: crop, input: p0, area: [0, 0, 6, 6]",
            "id: w, op: tile, inputs: [c, p1]",
            PNG + "w",
        ),
        "13:45: graph.nodes[6].input = 'w': nobody covers pixels 2x6+6+0 of panel r0c0; accepted: whole panels",
    ),
    "pixels that a mask takes away": (
        nodes(*WHOLE[:5], "id: m, op: mask, input: w, area: [2, 0, 14, 6]", PNG + "m"),
        "13:45: graph.nodes[6].input = 'm': nobody covers pixels 2x6+0+0 of panel r0c0; accepted: whole panels",
    ),
    "pixels that an inverted mask takes away": (
        nodes(*WHOLE[:5], "id: m, op: mask, input: w, area: [8, 2, 4, 4], invert: true", PNG + "m"),
        "13:45: graph.nodes[6].input = 'm': nobody covers pixels 4x4+8+2 of panel r0c1; accepted: whole panels",
    ),
}
CHANNELS = {
    "over without alpha": (
        nodes(*PANEL0, *PANEL1, "id: o, op: over, inputs: [p0, p1]", PNG + "o"),
        "11:34: graph.nodes[4].inputs[0] = 'p0': over needs alpha, and p0 gives only colour, depth, time, object_id, "
        "albedo, normal; accepted: a framelet with colour, alpha; reconstruct has alpha with background: transparent",
    ),
    "depth of a picture without one": (
        nodes(
            *WHOLE,
            "id: c, op: constant, area: [0, 0, 8, 6], colour: [1, 1, 1]",
            "id: d, op: depth, inputs: [p0, c]",
            PNG + "d",
        ).replace("id: png, op: sink, kind: png, input: d", "id: two, op: sink, kind: png, input: d"),
        "14:39: graph.nodes[7].inputs[1] = 'c': depth needs depth, and c gives only colour, alpha; "
        "accepted: a framelet with colour, depth",
    ),
    "over without an order": (
        nodes(
            *CLEAR0, *CLEAR1, *PANEL1, "id: o, op: over, inputs: [a, b]", "id: w, op: tile, inputs: [o, p1]", PNG + "w"
        ),
        "13:37: graph.nodes[6].inputs[1] = 'b': b has no order, so over cannot say what is before it; "
        "accepted: order: N at b",
    ),
    "over with one order": (
        nodes(*ORDERED, *PANEL1, "id: o, op: over, inputs: [a, b]", "id: w, op: tile, inputs: [o, p1]", PNG + "w"),
        "13:37: graph.nodes[6].inputs[1] = 'b': b and a have the same order, or one lies amidst the other's inputs; "
        "accepted: orders that differ: the smaller is the nearer",
    ),
    "bytes where light is computed with": (
        nodes(*WHOLE[:5], "id: e, op: encode, input: w", "id: c, op: colour, input: e, gain: 2.0", PNG + "c"),
        "13:34: graph.nodes[6].input = 'e': colour computes with light, and e gives display bytes; "
        "accepted: the node before encode",
    ),
    "lock step of no frames": (
        nodes(*WHOLE, head="  sync: frame\n"),
        "6:9: graph.sync = 'frame': frames in lock step are made of whole frames, and the sampling method is "
        "adaptive; accepted: sampling: {method: framed}, or sync: none",
    ),
    "depths of several panels": (
        nodes(*WHOLE[:5], "id: d, op: depth, inputs: [w, p0]", PNG + "d"),
        "12:35: graph.nodes[5].inputs[0] = 'w': holds 2 panels, and without lock step depths are compared along the "
        "rays of one panel; accepted: a node of one panel, as it is seen, or sync: frame",
    ),
    "depths of a picture that was turned": (
        nodes(
            *PANEL0,
            *PANEL1,
            "id: t, op: flip, input: p0, axis: horizontal",
            "id: d, op: depth, inputs: [t, p0]",
            PNG + "d",
            "id: f, op: sink, kind: png, input: p1",
        ),
        "12:35: graph.nodes[5].inputs[0] = 't': is turned, scaled or bent, and without lock step depths are compared "
        "along the rays of one panel; accepted: a node of one panel, as it is seen, or sync: frame",
    ),
}
CUT = (*WHOLE[:5], "id: c, op: crop, input: w, panel: r0c0", "id: d, op: depth, inputs: [c, p0]")
CHANNELS["depths of a panel cut out of two compositors' panels"] = (
    nodes(*CUT, "id: v, op: tile, inputs: [d, p1]", PNG + "v", head=TWO),
    "14:35: graph.nodes[6].inputs[0] = 'c': is cut out of panels of several compositors, which show different times; "
    "accepted: the panel's own node, or sync: frame",
)
ALL = STRUCTURE | RANKS | LAYERS | PLACEMENT | PIXELS | CHANNELS


@pytest.mark.parametrize("what", ALL)
def test_what_is_wrong_with_a_graph_is_refused_with_its_position(what: str) -> None:
    graph, expected = ALL[what]
    assert any(line.startswith("a.yaml:") and line.endswith(expected) for line in refusals(graph)), refusals(graph)


def test_what_a_mask_takes_away_others_may_bring() -> None:
    masks = (
        "id: m, op: mask, input: p0, area: [3, 0, 5, 6]",
        "id: n, op: mask, input: a, area: [3, 0, 5, 6], invert: true",
    )
    lines = (*PANEL0, *CLEAR0, *PANEL1, *masks, "id: w, op: tile, inputs: [m, n, p1]", PNG + "w")
    assert built(nodes(*lines)).step("png").panels == (0, 1)


def test_a_panel_that_is_cut_out_of_several_is_one_panel() -> None:
    graph = built(nodes(*CUT, "id: v, op: tile, inputs: [d, p1]", PNG + "v"))
    assert [graph.step(name).panels for name in "wcd"] == [(0, 1), (0,), (0,)]

    half = ("id: c, op: crop, input: w, panel: r0c1, on: panel", "id: png, op: sink, kind: png, input: c")
    graph = built(nodes(*WHOLE[:5], "id: all, op: sink, kind: png, input: w", *half, head=TWO))
    assert graph.step("c").rank == 1


def test_a_panel_is_found_where_turning_a_image_took_it() -> None:
    turned = ("id: f, op: flip, input: w, axis: horizontal", "id: c, op: crop, input: f, area: [0, 0, 8, 6]")
    graph = built(nodes(*WHOLE, *turned, "id: two, op: sink, kind: png, input: c"))
    assert graph.step("c").panels == (1,)


@pytest.mark.parametrize("order", [(-3, 7), (1, 0)])
def test_over_takes_layers_whose_orders_differ(order: tuple[int, int]) -> None:
    first, second = (f"transparent, order: {number}" for number in order)
    lines = [line.replace("transparent", first) for line in CLEAR0]
    lines += [line.replace("transparent", second) for line in CLEAR1]
    graph = built(
        nodes(*lines, *PANEL1, "id: o, op: over, inputs: [a, b]", "id: w, op: tile, inputs: [o, p1]", PNG + "w")
    )
    assert [graph.step(name).order for name in "abo"] == [*order, min(order)]


def test_in_lock_step_compositors_that_wait_for_each_other_are_refused() -> None:
    lines = [line.replace("background", "on: head, background") for line in CLEAR0]
    lines += [line.replace("background", "on: compositor 1, background") for line in CLEAR1]
    lines += [
        "id: d, op: depth, inputs: [a, b], on: compositor 1",
        "id: e, op: depth, inputs: [b, d], on: head",
        *PANEL1,
        "id: w, op: tile, inputs: [e, p1], on: head",
        PNG + "w",
    ]
    (line,) = refusals(nodes(*lines, head=f"{TWO}  sync: frame\n"), more="sampling: {method: framed}\n")
    assert "graph.sync = 'frame': in lock step " in line
    assert line.endswith(
        "wait for each other; accepted: `on` so that framelets go one way between compositors, or sync: none"
    )
    assert built(nodes(*lines, head=TWO)).sync == "none"


def test_a_preset_of_too_many_nodes_is_refused_and_a_large_one_is_not() -> None:
    wall = "wall: {grid: {columns: 8, rows: 8, pixels: [8, 6], size: [0.8, 0.6]}}"
    (line,) = refusals("graph: {preset: sort-last, ranks_per_panel: 1024}\n", wall=wall)
    assert line.endswith("64 panels with 1024 ranks each take 131264 nodes; accepted: fewer ranks: at most 65535 nodes")
    one = "wall: {grid: {columns: 1, rows: 1, pixels: [80, 60], size: [0.8, 0.6]}}"
    assert built("graph: {preset: sort-last, ranks_per_panel: 1024}\n", wall=one).renderers == 1024


def test_a_wall_of_1024_panels_has_its_graph() -> None:
    """Quadratic in Python this took a minute; see covering.Rects."""
    wall = "wall: {grid: {columns: 32, rows: 32, pixels: [8, 6], size: [0.8, 0.6]}}"
    graph = built("graph: {preset: sort-last, ranks_per_panel: 2, sinks: [png]}\n", wall=wall)
    assert (graph.renderers, len(graph.step("png").panels)) == (2048, 1024)


ONE = "wall: {grid: {columns: 1, rows: 1, pixels: [8, 6], size: [0.8, 0.6]}}"


def test_a_chain_of_nodes_may_be_as_long_as_it_likes() -> None:
    """Longer than Python's recursion goes."""
    chain = [f"id: n{k}, op: colour, input: {f'n{k - 1}' if k else 'p0'}" for k in range(1200)]

    graph = built(nodes(*PANEL0, *chain, "id: png, op: sink, kind: png, input: n1199"), wall=ONE)

    assert len(graph.steps) == 1202
    assert not graph.layers[0].reprojects


def test_ways_that_part_and_meet_again_are_looked_at_once() -> None:
    ways = [f"id: n{k}, op: average, inputs: [{f'n{k - 1}, n{k - 1}' if k else 'p0, p0'}]" for k in range(60)]

    assert len(built(nodes(*PANEL0, *ways, "id: png, op: sink, kind: png, input: n59"), wall=ONE).steps) == 62
