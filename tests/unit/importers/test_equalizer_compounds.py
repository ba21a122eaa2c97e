"""Compound trees as graphs: each way of sharing an image, and what each pixel shows."""

from __future__ import annotations

from typing import Any

import pytest
from equalizer_texts import BINARY_SWAP, DIRECT_SEND, HYBRID, STREAM, WALL, draws, one_panel, pipes, server, takes

from wall.core.errors import ConfigError
from wall.importers.equalizer import convert
from wall.importers.report import Conversion

SIZE = (400, 300)  # pixels of the panel in one_panel
RANGES = "buffer [ COLOR DEPTH ] compound { range [ 0 .5 ] } " + draws("b", "range [ .5 1 ]") + takes("b")


def made(text: str) -> Conversion:
    return convert(text, "f.eqc")


def nodes(text: str) -> dict[str, dict[str, Any]]:
    """The nodes of a graph that is written out, by id."""
    return {node["id"]: node for node in made(text).values["graph"]["nodes"]}


def parts_of(graph: dict[str, dict[str, Any]], node: str) -> list[tuple[float, float]]:
    """The parts of the scene that a node's pixels are made of, sorted."""
    one = graph[node]
    if one["op"] == "samples":
        return [tuple(one.get("range", (0.0, 1.0)))]
    inputs = one.get("inputs") or [one["input"]]
    return sorted({part for name in inputs for part in parts_of(graph, name)})


def area_of(graph: dict[str, dict[str, Any]], node: str) -> tuple[int, int, int, int]:
    """The rectangle of a node's pixels; all inputs of a join have the same."""
    one = graph[node]
    if one["op"] == "crop":
        return tuple(one["area"])
    if one["op"] == "samples":
        return (0, 0, *SIZE)
    areas = {area_of(graph, name) for name in one.get("inputs") or [one["input"]]}
    assert len(areas) == 1
    return areas.pop()


def check_covered_once(graph: dict[str, dict[str, Any]]) -> None:
    """The pieces of the wall are apart, and as large together as the panel."""
    areas = [area_of(graph, name) for name in graph["wall"]["inputs"]]
    for i, (x, y, w, h) in enumerate(areas):
        for u, v, s, t in areas[:i]:
            assert x + w <= u or u + s <= x or y + h <= v or v + t <= y
    assert sum(w * h for _, _, w, h in areas) == SIZE[0] * SIZE[1]


def whole(count: int) -> list[tuple[float, float]]:
    return [(k / count, (k + 1) / count) for k in range(count)]


def test_panels_with_one_channel_each_are_a_preset() -> None:
    assert made(one_panel("")).values["graph"] == {"preset": "sort-first", "sinks": ["browser", "png"]}


def test_viewports_are_ranks_that_share_the_panel() -> None:
    text = one_panel("compound { viewport [ 0 0 1 .5 ] }" + draws("b", "viewport [ 0 .5 1 .5 ]") + takes("b"))
    conversion = made(text)
    assert conversion.values["graph"]["ranks_per_panel"] == conversion.ranks == 2


def test_channels_with_one_panel_each_and_other_numbers_of_ranks_are_written_out() -> None:
    alone = f'compound {{ channel "c" {WALL.replace("-1 ]", "-2 ]")} }}'
    shared = f'compound {{ channel "a" {WALL} compound {{}} {draws("b")} {takes("b")} }}'
    graph = nodes(server(pipes("abc"), shared, alone))
    assert {graph[name]["ranks"] for name in ("a.s", "c.s")} == {1, 2}
    assert graph["wall"]["inputs"] == ["a.f", "c.f"]


def test_ranges_are_joined_by_depth() -> None:
    graph = nodes(one_panel(RANGES))
    assert [(node["op"], node.get("range")) for node in graph.values()] == [
        ("samples", [0.0, 0.5]),
        ("reconstruct", None),
        ("samples", [0.5, 1.0]),
        ("reconstruct", None),
        ("depth", None),
        ("tile", None),
        ("sink", None),
        ("sink", None),
    ]
    assert graph["a.d"]["inputs"] == ["a.f0", "a.f1"]
    assert graph["wall"]["inputs"] == ["a.d"]


def test_direct_send_joins_each_strip_where_it_is_sent() -> None:
    graph = nodes(one_panel(DIRECT_SEND))
    check_covered_once(graph)
    top, bottom = graph["wall"]["inputs"]
    assert area_of(graph, top) == (0, 0, 400, 150)  # Equalizer counts from below, the frame from above
    assert (graph[top]["on"], graph[bottom]["on"]) == ("compositor 1", "head")
    assert parts_of(graph, top) == parts_of(graph, bottom) == whole(2)
    assert {node["on"] for node in graph.values() if node["op"] == "reconstruct"} == {"head", "compositor 1"}


def test_binary_swap_joins_in_two_rounds() -> None:
    graph = nodes(one_panel(BINARY_SWAP))
    check_covered_once(graph)
    assert len(graph["wall"]["inputs"]) == 4
    for name in graph["wall"]["inputs"]:
        assert parts_of(graph, name) == whole(4)
        inner = [one for one in graph[name]["inputs"] if graph[one]["op"] == "depth"]
        assert len(inner) == 1
        assert graph[inner[0]]["on"] != graph[name]["on"]
    assert {graph[name]["on"] for name in graph["wall"]["inputs"]} == {"head", *(f"compositor {k}" for k in (1, 2, 3))}


def test_a_stream_is_a_chain_of_joins() -> None:
    graph = nodes(one_panel(STREAM))
    depth, name = 0, graph["wall"]["inputs"][0]
    while name:
        depth += 1
        name = next((one for one in graph[name]["inputs"] if graph[one]["op"] == "depth"), "")
    assert depth == 3
    assert parts_of(graph, "wall") == whole(4)


def test_ranges_of_viewports_are_ranks_of_each_part() -> None:
    graph = nodes(one_panel(HYBRID))
    assert [(node["range"], node["ranks"]) for node in graph.values() if node["op"] == "samples"] == [
        ([0.0, 0.5], 2),
        ([0.5, 1.0], 2),
    ]
    check_covered_once(graph)


def test_ranges_inside_ranges_are_parts_of_parts() -> None:
    inner = "compound { range [ .5 1 ] compound { range [ 0 .5 ] } " + draws("c", "range [ .5 1 ]") + takes("c") + " }"
    text = one_panel("buffer [ COLOR DEPTH ]" + draws("b", "range [ 0 .5 ]") + inner + takes("b"))
    assert parts_of(nodes(text), "wall") == [(0.0, 0.5), (0.5, 0.75), (0.75, 1.0)]


def test_parts_of_the_scene_beside_each_other_are_cropped() -> None:
    text = one_panel(
        "compound { range [ 0 .5 ] viewport [ 0 0 .5 1 ] }"
        + draws("b", "range [ .5 1 ] viewport [ .5 0 .5 1 ]")
        + takes("b")
    )
    graph = nodes(text)
    check_covered_once(graph)
    assert {area_of(graph, name): parts_of(graph, name) for name in graph["wall"]["inputs"]} == {
        (0, 0, 200, 300): [(0.0, 0.5)],
        (200, 0, 200, 300): [(0.5, 1.0)],
    }


@pytest.mark.parametrize("mode", ["2D", "HORIZONTAL", "VERTICAL"])
@pytest.mark.parametrize("word", ["load_equalizer", "tree_equalizer", "loadBalancer"])
def test_balanced_viewports_are_ranks(word: str, mode: str) -> None:
    text = one_panel(f"{word} {{ mode {mode} }} compound {{}}" + draws("b") + draws("c") + takes("b", "c"))
    conversion = made(text)
    assert conversion.values["graph"]["ranks_per_panel"] == 3
    assert next(item.why for item in conversion.not_carried if item.what.endswith(f"/ {word}")).startswith(
        "load balance"
    )


def test_balanced_ranges_are_equal_parts() -> None:
    text = one_panel(
        "buffer [ COLOR DEPTH ] load_equalizer { mode DB } compound {}" + draws("b") + draws("c") + takes("b", "c")
    )
    assert [part for low, high in parts_of(nodes(text), "wall") for part in (low, high)] == pytest.approx(
        [0, 1 / 3, 1 / 3, 2 / 3, 2 / 3, 1], abs=1e-6
    )


@pytest.mark.parametrize(
    ("words", "left"),
    [
        (("pixel [ 0 0 2 1 ]", "pixel [ 1 0 2 1 ]"), "pixel"),
        (("subpixel [ 0 2 ]", "subpixel [ 1 2 ]"), "subpixel"),
        (("period 2 phase 0", "period 2 phase 1"), "period"),
    ],
)
def test_other_ways_to_share_are_ranks_and_are_reported(words: tuple[str, str], left: str) -> None:
    compounds = "".join(
        f'compound {{ channel "{name}" {word} outputframe {{ name "x" }} }}'
        for name, word in zip("bc", words, strict=True)
    )
    conversion = made(one_panel(compounds + 'inputframe { name "x" }'))
    assert conversion.values["graph"]["ranks_per_panel"] == 2
    assert sum(f"/ {left} " in item.what for item in conversion.not_carried) == 2


def test_eyes_of_a_stereo_view_have_their_own_ranks() -> None:
    compounds = (
        "compound { eye [ LEFT CYCLOP ] }"
        + draws("b", "eye [ RIGHT ] viewport [ 0 0 .5 1 ]")
        + draws("c", "eye [ RIGHT ] viewport [ .5 0 .5 1 ]")
        + "compound { task [ ASSEMBLE ] eye [ RIGHT ] "
        + takes("b", "c")
        + " }"
    )
    conversion = made(one_panel(compounds, mode="mode STEREO"))
    assert conversion.values["wall"]["panels"][0]["stereo"] == "side_by_side"
    samples = [node for node in conversion.values["graph"]["nodes"] if node["op"] == "samples"]
    assert [(node["panel"], node["ranks"]) for node in samples] == [("a.left", 1), ("a.right", 2)]


def test_a_channel_that_helps_two_panels_by_turns_is_a_rank_of_one() -> None:
    def shared(segment: int, others: str) -> str:
        frames = "".join(
            f'compound {{ channel "{name}" outputframe {{ name "{segment}{name}" }} }} '
            f'inputframe {{ name "{segment}{name}" }}'
            for name in others
        )
        return f"compound {{ channel ( segment {segment} view 0 ) load_equalizer {{}} compound {{}} {frames} }}"

    canvas = (
        f'layout {{ view {{ }} }} canvas {{ layout 0 {WALL} segment {{ channel "a" viewport [ 0 0 .5 1 ] }} '
        'segment { channel "b" viewport [ .5 0 .5 1 ] } }'
    )
    tree = f"compound {{ view_equalizer {{}} {shared(0, 'bcd')} {shared(1, 'acd')} }}"
    conversion = made(server(pipes("abcd"), canvas, tree))
    assert conversion.values["graph"]["ranks_per_panel"] == 2  # a and b at home, c and d one here, one there
    assert conversion.ranks == 4
    assert sum("here its channel is a rank of panel" in item.why for item in conversion.not_carried) >= 4


def test_a_frame_from_another_panel_is_rendered_instead_and_reported() -> None:
    canvas = (
        f'layout {{ view {{ }} }} canvas {{ layout 0 {WALL} segment {{ channel "a" }} }} '
        f'canvas {{ layout 0 {WALL} segment {{ channel "b" }} }}'
    )
    tree = (
        "compound { compound { channel ( segment 0 ) outputframe {} } compound { channel ( canvas 1 segment 0 ) "
        "monitor_equalizer {} task [ CLEAR ASSEMBLE ] " + takes("a") + " } }"
    )
    conversion = made(server(pipes("ab"), canvas, tree))
    assert conversion.panels == conversion.ranks == 2
    assert any("comes from outside this panel" in item.why for item in conversion.not_carried)


def test_frames_in_a_circle_end() -> None:
    circle = draws("b", 'inputframe { name "frame.c" }') + draws("c", 'inputframe { name "frame.b" }') + takes("b")
    assert made(one_panel("buffer [ COLOR DEPTH ] compound {}" + circle)).ranks >= 1


def test_a_panel_that_is_only_cleared_is_left_out() -> None:
    only = f'compound {{ task [ CLEAR ] channel "b" {WALL} }}'
    conversion = made(server(pipes("ab"), f'compound {{ channel "a" {WALL} }}', only))
    assert [panel["id"] for panel in conversion.values["wall"]["panels"]] == ["a"]
    assert any("nothing is shown there" in item.why for item in conversion.not_carried)


def test_frames_that_go_through_each_other_without_end_are_refused() -> None:
    """Each channel takes all before it twice: 3 ^ 40 ways through them."""
    names = [f"n{k}" for k in range(40)]
    tree = "".join(
        draws(name, *(f'inputframe {{ name "frame.{other}" }}' for other in names[max(0, k - 2) : k] * 2))
        for k, name in enumerate(names)
    )
    with pytest.raises(ConfigError, match=r"^f\.eqc:\d+:1: .* in too many ways"):
        made(one_panel("buffer [ COLOR DEPTH ] compound {}" + tree + takes(names[-1]), ["a", *names]))
