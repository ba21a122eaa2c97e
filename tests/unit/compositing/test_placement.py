"""Where nodes run, which ranks render for them, and what flows between them."""

from __future__ import annotations

import pytest
from small_graphs import CLEAR0, CLEAR1, PANEL0, PANEL1, WHOLE, built, nodes

from wall.compositing.graph import Graph

S0, P0, S1, P1, W, PNG = WHOLE
_CORNERS = "pixels: [8, 6], corners: {{lower_left: [{0}, 0, 0], lower_right: [{1}, 0, 0], upper_left: [{0}, 1, 0]}}"
HOSTS = "wall:\n  panels:\n" + "\n".join(
    f"    - {{id: {name}, {_CORNERS.format(k, k + 1)}, host: {host}}}"
    for k, (name, host) in enumerate([("a", "X"), ("b", "Y"), ("c", "X")])
)


def ranks_of(graph: Graph, *names: str) -> list[int]:
    return [graph.step(name).rank for name in names]


@pytest.mark.parametrize(
    ("on", "rank"),
    [("head", 0), ("panel", 1), ("rank 0", 0), ("rank 1", 1), ("compositor 1", 1), ("1", 1), ("compositor 0", 0)],
)
def test_a_node_runs_where_its_on_says(on: str, rank: int) -> None:
    graph = built(nodes(S0, f"{P0}, on: compositor 1", S1, f"{P1}, on: {on}", W, PNG, head="  compositors: 2\n"))
    assert ranks_of(graph, "p1") == [rank]
    assert graph.layers[1].compositor == rank
    assert graph.rank_of["s1"] == graph.layers[1].ranks[0]


def test_without_on_panels_are_dealt_and_operators_run_where_most_of_their_inputs_are() -> None:
    clear = [line.replace("r0c0", "r0c1") for line in (*CLEAR0, *CLEAR1)]
    graph = built(
        nodes(
            S0, P0, *clear, "id: k, op: sky, panel: r0c1", "id: d, op: depth, inputs: [a, b, k]",
            "id: w, op: tile, inputs: [p0, d]", PNG, head="  compositors: 2\n",
        )
    )  # fmt: skip
    assert ranks_of(graph, "p0", "a", "b", "k", "d", "w", "png") == [0, 1, 1, 1, 1, 0, 0]


def test_a_host_is_wanted_of_the_compositor_whose_panels_name_it_else_of_a_free_one() -> None:
    lines = (
        "id: sa, op: samples, panel: a", "id: pa, op: reconstruct, input: sa", "id: sb, op: samples, panel: b",
        "id: pb, op: reconstruct, input: sb", "id: sc, op: samples, panel: c", "id: pc, op: reconstruct, input: sc",
    )  # fmt: skip
    graph = built(
        nodes(
            *lines, "id: w, op: tile, inputs: [pa, pb], on: host Z", "id: w2, op: tile, inputs: [w, pc], on: host Y",
            "id: png, op: sink, kind: png, input: w2", head="  compositors: 4\n",
        ),
        wall=HOSTS,
    )  # fmt: skip
    by_host = {host: rank for rank, host in graph.hosts.items()}
    assert sorted(by_host) == ["X", "Y", "Z"]
    assert ranks_of(graph, "pa", "pb", "pc") == [by_host["X"], by_host["Y"], by_host["X"]]
    assert ranks_of(graph, "w", "w2", "png") == [by_host["Z"], by_host["Y"], 0]


@pytest.mark.parametrize("preset", ["sort-first", "sort-last"])
def test_renderers_of_a_preset_run_on_the_hosts_of_their_panels_where_that_is_asked_for(preset: str) -> None:
    text = f"graph: {{preset: {preset}, ranks_per_panel: 2, compositors: 3"
    there = built(text + ", renderers: panel}\n", wall=HOSTS)
    ranks = {layer.panel: list[int]() for layer in there.layers}
    for layer in there.layers:
        ranks[layer.panel] += layer.ranks
    assert [[there.hosts[rank] for rank in ranks[panel]] for panel in range(3)] == [["X"] * 2, ["Y"] * 2, ["X"] * 2]
    anywhere = built(text + "}\n", wall=HOSTS)
    assert anywhere.hosts == {rank: host for rank, host in there.hosts.items() if rank < 3}


def test_named_ranks_keep_their_numbers_and_free_ones_fill_the_gaps() -> None:
    graph = built(
        nodes(
            f"{S0}, group: left", P0, f"{S1}, ranks: 2", P1, W, PNG, head="  groups: {left: [4, 2]}\n",
        )
    )  # fmt: skip
    assert [layer.ranks for layer in graph.layers] == [(4, 2), (1, 3)]
    assert graph.layer_of(3).panel == 1
    with pytest.raises(KeyError):
        graph.layer_of(5)


def test_only_channels_that_somebody_needs_flow() -> None:
    newest = built(nodes(*PANEL0, *CLEAR0, *PANEL1, "id: n, op: newest, inputs: [p0, a]", W.replace("p0", "n"), PNG))
    assert newest.step("p0").channels == newest.step("a").channels == {"colour", "time"}
    depth = built(nodes(*PANEL0, *CLEAR0, *PANEL1, "id: n, op: depth, inputs: [p0, a]", W.replace("p0", "n"), PNG))
    assert {"colour", "depth"} <= depth.step("p0").channels
    assert "time" not in depth.step("p0").channels
    for graph in (newest, depth, built(nodes(*WHOLE))):
        assert graph.step("p1").channels == graph.step("w").channels == {"colour"}, "sinks need no more"


def test_light_becomes_bytes_as_soon_as_nothing_computes_with_it() -> None:
    plain = built(nodes(*WHOLE))
    assert all(step.encoded for step in plain.steps if step.node.id != "png")
    graph = built(
        nodes(*PANEL0, *PANEL1, "id: c, op: colour, input: p0, gain: 2.0", "id: w, op: tile, inputs: [c, p1]", PNG)
    )
    assert [graph.step(name).encoded for name in ("p0", "c", "p1", "w")] == [False, True, True, True]
    graph = built(nodes(*PANEL0, *PANEL1, W, "id: c, op: colour, input: w, gain: 2.0", PNG.replace("w", "c")))
    assert [graph.step(name).encoded for name in ("p0", "p1", "w", "c")] == [False, False, False, True]
    graph = built(nodes(*PANEL0, *PANEL1, W, "id: e, op: encode, input: w", PNG.replace("w", "e")))
    assert [graph.step(name).encoded for name in ("p0", "w", "e")] == [False, False, True]


def test_a_constant_may_name_its_panel() -> None:
    graph = built(nodes(S0, P0, "id: c, op: constant, panel: r0c1, colour: [1, 0, 0]", W.replace("p1", "c"), PNG))
    rect = graph.step("c").rect
    assert (rect.x, rect.y, rect.width, rect.height) == (8, 0, 8, 6)


def test_layers_are_reprojected_where_depths_are_compared_and_nothing_waits() -> None:
    lines = (*CLEAR0, *CLEAR1, "id: d, op: depth, inputs: [a, b]", *PANEL1, "id: w, op: tile, inputs: [d, p1]", PNG)
    graph = built(nodes(*lines))
    assert {layer.node: layer.reprojects for layer in graph.layers} == {"a": True, "b": True, "p1": False}
    framed = built(nodes(*lines, head="  sync: frame\n"), more="sampling: {method: framed}\n")
    assert not any(layer.reprojects for layer in framed.layers)
