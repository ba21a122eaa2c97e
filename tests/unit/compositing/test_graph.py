"""The compositing graph: presets expand; whatever is wrong with a graph is refused with its position in the file."""

from __future__ import annotations

import pytest

from wall.compositing.build import build
from wall.compositing.graph import Graph
from wall.config.graph import PresetGraph
from wall.config.loading import loads
from wall.core.errors import ConfigError
from wall.geometry.expanding import expand

HEAD = """\
version: 1
scene: {source: x}
wall: {grid: {columns: 2, rows: 1, pixels: [8, 6], size: [0.8, 0.6]}}
views: [{camera: auto}]
"""
NODES = """\
graph:
  compositors: 1
  nodes:
    - {id: out, op: sink, kind: png, input: w}
    - {id: w, op: tile, inputs: [p0, p1]}
    - {id: p0, op: reconstruct, input: s0}
    - {id: p1, op: reconstruct, input: s1}
    - {id: s1, op: samples, panel: r0c1, ranks: 3}
    - {id: s0, op: samples, panel: r0c0, ranks: 2}
"""


def built(graph: str) -> Graph:
    loaded = loads(HEAD + graph, name="a.yaml")
    return build(loaded, expand(loaded.config.wall))


def refusal(graph: str) -> str:
    with pytest.raises(ConfigError) as caught:
        built(graph)
    return str(caught.value)


def changed(*pairs: tuple[str, str]) -> str:
    text = NODES
    for old, new in pairs:
        assert old in text
        text = text.replace(old, new)
    return text


def test_a_border_needs_a_preset() -> None:
    view = "{camera: auto, viewport: {left: 0, top: 0, width: 1, height: 1}, border: {}}"
    loaded = loads((HEAD + NODES).replace("{camera: auto}", view), name="a.yaml")
    with pytest.raises(ConfigError, match=r"^a.yaml:4:82: views\[0\].border: the graph is written node"):
        build(loaded, expand(loaded.config.wall))


def test_samples_bring_what_the_graph_makes_something_of_and_no_more() -> None:
    """Depth where images are compared or moved by it, objects there and where nothing may show through."""
    head = "graph:\n  nodes:\n    - {id: s0, op: samples, panel: r0c0}\n    - {id: s1, op: samples, panel: r0c1}\n"
    sinks = "    - {id: a, op: sink, kind: png, input: p0}\n    - {id: b, op: sink, kind: png, input: p1}\n"

    def fields(first: str, second: str = "") -> list[tuple[bool, bool]]:
        given = zip("01", (first, second), strict=True)
        nodes = [f"    - {{id: p{k}, op: reconstruct, input: s{k}{more}}}\n" for k, more in given]
        graph = built(head + "".join(nodes) + sinks)
        return [graph.fields_of(layer) for layer in graph.layers]

    assert fields("") == [(False, False), (False, False)]
    assert fields(", background: transparent", ", refresh_hz: 10") == [(False, True), (True, True)]
    assert built(NODES).fields_of(built(NODES).layers[0]) == (False, False)
    last = built("graph: {preset: sort-last, ranks_per_panel: 2}\n")
    assert {last.fields_of(layer) for layer in last.layers} == {(True, True)}


def test_preset_gives_each_panel_its_ranks_and_one_image() -> None:
    graph = built("graph: {preset: sort-first, ranks_per_panel: 3, sinks: [png, recorder]}\n")

    assert [(layer.panel, layer.ranks) for layer in graph.layers] == [(0, (1, 2, 3)), (1, (4, 5, 6))]
    assert (graph.compositors, graph.renderers) == (1, 6)
    assert [sink.kind for sink in graph.sinks] == ["png", "recorder"]
    assert graph.has_sink("png")
    assert not graph.has_sink("browser")


def test_absent_graph_is_the_plain_preset() -> None:
    assert built("") == built("graph: sort-first\n") == built(f"graph: {{preset: {PresetGraph().preset}}}\n")


def test_preset_deals_panels_to_compositors() -> None:
    graph = built("graph: {compositors: 2}\n")

    assert [layer.compositor for layer in graph.layers] == [0, 1]
    assert [[layer.panel for layer in graph.layers_on(rank)] for rank in (0, 1)] == [[0], [1]]
    assert graph.compositors + graph.renderers == 4


def test_preset_with_more_compositors_than_panels_is_refused() -> None:
    assert "a.yaml:5:22: graph.compositors = 3: 3 compositors cannot share 2 panels" in refusal(
        "graph: {compositors: 3}\n"
    )


def test_nodes_in_any_order_come_out_inputs_first() -> None:
    graph = built(NODES)

    position = {node.id: i for i, node in enumerate(graph.nodes)}
    assert sorted(position) == ["out", "p0", "p1", "s0", "s1", "w"]
    assert position["s0"] < position["p0"] < position["w"] < position["out"]
    assert position["s1"] < position["p1"] < position["w"]


def test_renderers_follow_the_order_of_the_panels() -> None:
    loaded = loads(HEAD + NODES)
    wall = expand(loaded.config.wall)

    found = build(loaded, wall).regions(wall)

    assert [[region.panel for region in regions] for regions in found] == [[0], [0], [1], [1], [1]]


def test_written_out_preset_is_the_preset() -> None:
    written = built(
        changed(
            (", ranks: 3", ""),
            (", ranks: 2", ""),
            ("compositors: 1", "compositors: 2"),
            ("input: s1}", "input: s1, on: 1}"),
        )
    )
    preset = built("graph: {compositors: 2, sinks: [png]}\n")

    assert [(a.panel, a.ranks) for a in written.layers] == [(b.panel, b.ranks) for b in preset.layers]
    assert [layer.compositor for layer in written.layers] == [layer.compositor for layer in preset.layers]
    assert (written.compositors, written.renderers) == (preset.compositors, preset.renderers)


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        (
            "[p0, p1]",
            "[p0, p2]",
            "a.yaml:9:38: graph.nodes[1].inputs[1] = 'p2': there is no such node; accepted: p0, p1",
        ),
        ("input: s0", "input: s9", "graph.nodes[2].input = 's9': there is no such node; accepted: s1, s0"),
        (
            "input: s0",
            "input: p1",
            "graph.nodes[2].input = 'p1': reconstruct needs samples, reconstruct gives a framelet",
        ),
        ("[p0, p1]", "[s0, p1]", "graph.nodes[1].inputs[0] = 's0': tile needs a framelet, samples gives samples"),
        (
            "input: w",
            "input: p0",
            "a.yaml:9:12: graph.nodes[1].id = 'w': nobody uses what this node gives: tile is done in vain; accepted: a",
        ),
        (
            "input: w",
            "input: out",
            "a.yaml:8:45: graph.nodes[0].input = 'out': sink needs a framelet, sink gives nothing",
        ),
        (
            "panel: r0c1",
            "panel: r0cl",
            "graph.nodes[4].panel = 'r0cl': there is no such panel; accepted: r0c0, r0c1; did",
        ),
        (
            "panel: r0c1",
            "panel: r0c0",
            "a.yaml:9:38: graph.nodes[1].inputs[1] = 'p1': pixels 8x6+0+0 come from p0 already; accepted: depth, over",
        ),
        ("id: p1", "id: p0", "graph.nodes[3].id = 'p0': nodes[2] has this id already"),
        (
            "input: s1}",
            "input: s1, on: 1}",
            "a.yaml:11:48: graph.nodes[3].on = 1: there is only compositor 0 (the head); accepted: compositor 0 to 0",
        ),
        ("compositors: 1", "compositors: 3", "a.yaml:6:16: graph.compositors = 3: compositor 2 has nothing to do"),
        (
            "[p0, p1]",
            "[p0]",
            "graph.nodes[3].id = 'p1': nobody uses what this node gives: reconstruct is done in vain",
        ),
        (
            "[p0, p1]",
            "[p0, p1, p1]",
            "a.yaml:9:42: graph.nodes[1].inputs[2] = 'p1': pixels 8x6+8+0 come from p1 already",
        ),
        (
            "input: s1}",
            "input: s0}",
            "graph.nodes[5].id = 's0': samples are used more than once (p0, p1); accepted: one",
        ),
        (
            "    - {id: out, op: sink, kind: png, input: w}\n",
            "",
            "no image ends anywhere; accepted: a node with op: sink",
        ),
        (
            "    - {id: w,",
            "    - {id: v, op: tile, inputs: [p0]}\n    - {id: w,",
            "a.yaml:9:12: graph.nodes[1].id = 'v': nobody uses what this node gives: tile is done in vain",
        ),
    ],
)
def test_wrong_graph_is_refused_with_its_position(old: str, new: str, expected: str) -> None:
    assert expected in refusal(changed((old, new)))


def test_cycle_is_refused_before_anything_follows_it() -> None:
    message = refusal(changed(("input: s0", "input: p0")))

    assert "graph.nodes[2].input = 'p0': reconstruct needs samples" in message


def test_all_that_is_wrong_with_a_graph_is_said_at_once() -> None:
    message = refusal(changed(("input: s0", "input: s9"), ("panel: r0c1", "panel: r9c9"), ("[p0, p1]", "[p0, q]")))

    assert [line.split(": ")[1] for line in message.splitlines()] == [
        "graph.nodes[1].inputs[1] = 'q'",
        "graph.nodes[2].input = 's9'",
        "graph.nodes[4].panel = 'r9c9'",
    ], "what follows from these (nobody uses p1) is not said"
