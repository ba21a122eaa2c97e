"""A refused value does not refuse a file: it is dropped, and listed with its line."""

from __future__ import annotations

import pytest
from equalizer_texts import one_panel

from wall.core.errors import ConfigError
from wall.importers.command import convert_text
from wall.importers.dropped_values import checked_layout
from wall.importers.report import Conversion, Item

SCREEN = 'LowerLeft="-1 -1 -1" LowerRight="1 -1 -1" UpperRight="1 1 -1"'
EQC = """server { config {
  appNode { pipe { window { viewport [ 0 0 640 480 ] channel { name "a" } } } }
  node { pipe { window { viewport [ 0 0 640 480 ] channel { name "b" } } } }
  compound { channel "a"
    compound { range [ 0 .5 ] }
    compound { channel "b"
      range [ %s ]
      outputframe { name "f" buffer [ COLOR DEPTH ] } }
    inputframe { name "f" } }
} }
"""


def two_panels() -> Conversion:
    """Panels left (line 3 of its source) and right (line 5), with a graph of nodes."""
    panels = []
    for k, name in enumerate(("left", "right")):
        corners = {"lower_left": [k, 0.0, 0.0], "lower_right": [k + 1.0, 0.0, 0.0], "upper_left": [k, 1.0, 0.0]}
        panels.append({"id": name, "pixels": [64, 64], "corners": corners})
    nodes = [
        {"id": "s0", "op": "samples", "panel": "left"},
        {"id": "f0", "op": "reconstruct", "input": "s0"},
        {"id": "s1", "op": "samples", "panel": "right"},
        {"id": "f1", "op": "reconstruct", "input": "s1"},
        {"id": "wall", "op": "tile", "inputs": ["f0", "f1"]},
        {"id": "png", "op": "sink", "kind": "png", "input": "wall"},
    ]
    values = {
        "version": 1,
        "scene": {"source": "courtyard"},
        "wall": {"panels": panels},
        "views": [{"id": "main", "camera": "auto"}],
        "graph": {"nodes": nodes},
    }
    origins = [Item(what="screen 0", line=3), Item(what="screen 1", line=5)]
    return Conversion(values=values, carried=[], not_carried=[], panels=2, ranks=2, origins=origins)


def listed(conversion: Conversion) -> list[tuple[str, int]]:
    return [(item.what, item.line) for item in conversion.not_carried]


def test_valid_values_are_kept() -> None:
    made = two_panels()

    checked_layout(made)

    assert made.values == two_panels().values
    assert made.not_carried == []


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("window", {"x": 70000, "y": 0, "width": 64, "height": 64}),
        ("window", {"x": 0, "y": 0, "width": 64, "height": 20000}),
        ("host", ""),
        ("display", "x" * 5000),
        ("monitor", 256),
        ("bezel", {"left": 2.0}),
        ("overlap", 101.0),
        ("eye", [0.0, 0.0, 1e13]),
        ("refresh_hz", 0.0),
    ],
)
def test_an_optional_value_that_is_refused_is_left_out_and_listed_with_the_line_of_its_panel(
    key: str, value: object
) -> None:
    made = two_panels()
    made.values["wall"]["panels"][1][key] = value

    checked_layout(made)

    assert made.values == two_panels().values
    assert listed(made) == [("screen 1", 5)]
    assert made.not_carried[0].why.endswith(f"; its {key} is left out")


def test_several_refused_values_are_dropped_together() -> None:
    made = two_panels()
    made.values["wall"]["panels"][0] |= {"host": "", "monitor": -1}
    made.values["views"][0]["eye_separation"] = 11.0

    checked_layout(made)

    assert made.values == two_panels().values
    assert listed(made) == [("the file", 1), ("screen 0", 3), ("screen 0", 3)]


def test_a_refused_panel_is_dropped_if_others_are_left() -> None:
    made = two_panels()
    made.values["wall"]["panels"][0]["pixels"] = [64, 20000]

    layout = checked_layout(made)

    assert [panel.id for panel in layout.wall.panels] == ["right"]
    assert made.panels == 1
    assert listed(made) == [("screen 0", 3)]
    assert made.origins == [Item(what="screen 1", line=5)]


def test_a_panel_that_covers_another_is_left_out() -> None:
    made = two_panels()
    made.values["wall"]["panels"][1]["corners"] = made.values["wall"]["panels"][0]["corners"]

    assert len(checked_layout(made).wall.panels) == 1


def test_a_refused_graph_is_replaced_by_ranks_of_each_panel() -> None:
    made = two_panels()
    made.values["graph"]["nodes"][1]["input"] = "none"

    layout = checked_layout(made)

    assert "graph" not in made.values
    assert len(layout.regions) == 2
    assert len(made.not_carried) == 1


def test_a_panel_that_needs_more_ranks_has_them() -> None:
    made = two_panels()
    made.values["wall"]["panels"][0]["pixels"] = [9000, 64]

    layout = checked_layout(made)

    assert made.values["graph"] == {"preset": "sort-first", "ranks_per_panel": 3}
    assert len(layout.regions) == 6


@pytest.mark.parametrize(
    ("viewport", "pixels"),
    [("70000 0 64 48", [64, 48]), ("0 0 20000 48", [16384, 48]), ("0 0 64 -7", [64, 1]), ("0 0 9000 48", [9000, 48])],
)
def test_an_odd_viewport_of_equalizer_does_not_refuse_the_file(viewport: str, pixels: list[int]) -> None:
    text = (EQC % "0.5 1").replace("0 0 640 480", viewport, 1)

    _, made, yaml = convert_text(text, "w.eqc")

    assert made.values["wall"]["panels"][0]["pixels"] == pixels
    assert made.not_carried
    assert "x: 70000" not in yaml


def test_a_wall_of_equalizer_too_small_for_a_panel_leaves_the_others() -> None:
    wall = "wall { bottom_left [ %s 0 -1 ] bottom_right [ %s 0 -1 ] top_left [ %s 1 -1 ] }"
    small = f'compound {{ channel "a" {wall % (0, 0.00015, 0)} viewport [ 0 0 .5 1 ] }}'
    text = (
        "".join(EQC.splitlines(keepends=True)[:3]) + f'{small} compound {{ channel "b" {wall % (1, 2, 1)} }}\n}} }}\n'
    )

    _, made, _ = convert_text(text, "w.eqc")

    assert [panel["id"] for panel in made.values["wall"]["panels"]] == ["b"]
    assert made.panels == len(made.origins) == 1
    assert any("panel a" in item.why and item.line == 4 for item in made.not_carried)


def test_the_only_panel_is_not_left_out() -> None:
    made = two_panels()
    made.values["wall"]["panels"] = [made.values["wall"]["panels"][0] | {"pixels": [64, 20000]}]

    with pytest.raises(ConfigError, match="is too large"):
        checked_layout(made)


def test_a_geometry_far_from_every_display_loses_its_window_alone() -> None:
    _, made, yaml = convert_text(f'<pvx>\n<Machine Geometry="64x64+70000+0" {SCREEN}/></pvx>', "w.pvx")

    assert "window" not in yaml
    assert "pixels: [64, 64]" in yaml
    assert [item.line for item in made.not_carried] == [2]


@pytest.mark.parametrize(
    ("written", "becomes"), [(".5 .5", None), ("1 .5", None), (".5 7", [0.5, 1.0]), ("-1 .5", [0.0, 0.5])]
)
def test_a_range_of_equalizer_is_clamped_and_one_that_holds_nothing_is_not_carried(
    written: str, becomes: list[float] | None
) -> None:
    _, made, _ = convert_text(EQC % written, "w.eqc")

    ranges = [node.get("range") for node in made.values.get("graph", {}).get("nodes", []) if node["op"] == "samples"]
    assert becomes in ranges
    refused = [item.line for item in made.not_carried if "no part of the scene" in item.why]
    assert refused == ([7] if becomes is None else [])


@pytest.mark.parametrize(
    ("right", "wrong", "says"),
    [
        ('segment { channel "a"', 'segment { channel "nobody" } segment { channel "a"', 'no channel "nobody"'),
        ("observer 0", "observer 7", "no observer 7"),
        ("canvas { layout 0", 'canvas { layout "none" layout 0', 'no layout "none"'),
    ],
)
def test_a_canvas_of_equalizer_that_names_what_is_not_there_keeps_the_rest(right: str, wrong: str, says: str) -> None:
    text = one_panel("", ("a", "b"))

    _, made, _ = convert_text(text.replace(right, wrong), "w.eqc")

    assert made.panels == 1
    assert any(says in item.why and item.line == 8 for item in made.not_carried)
