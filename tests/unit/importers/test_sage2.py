"""SAGE2's JSON5: tiles in rows and columns, with frames in metres in either shape of the key."""

from __future__ import annotations

import pytest

from wall.importers.report import NotThisFormat
from wall.importers.sage2 import convert

CONFIG = """/*
    a wall of two by three
*/
{
    name: "lab", host: "server", port: 9090,   // the server
    resolution: {width: 1920, height: 1080},
    dimensions: {
        tile_width: 1.2, tile_height: 0.7,
        tile_borders: BORDERS,
        viewing_distance: 5.0
    },
    layout: {rows: 2, columns: 3},
    displays: [{row: 0, column: 0}, {row: 1, column: 0, width: 2}, {ID: 7, row: 0, column: 2}],
    apis: {twitter: {consumerSecret: "abc"}},
}
"""
ARRAY = "[0.01, 0.02, 0.03, 0.04]"
OBJECT = "{left: 0.01, right: 0.02, bottom: 0.03, top: 0.04}"


@pytest.mark.parametrize("borders", [ARRAY, OBJECT])
def test_tile_borders_of_either_shape_separate_the_tiles(borders: str) -> None:
    first, _, third = convert(CONFIG.replace("BORDERS", borders), "lab.json").values["wall"]["panels"]

    # a tile takes 1.23 x 0.77 m; three by two of them have their middle at the origin
    assert first["bezel"] == {"left": 0.01, "right": 0.02, "bottom": 0.03, "top": 0.04}
    assert first["corners"]["upper_left"] == pytest.approx([-1.845 + 0.01, 0.77 - 0.04, 0])
    assert first["corners"]["lower_left"] == pytest.approx([-1.835, 0.03, 0])
    assert third["corners"]["lower_right"] == pytest.approx([1.845 - 0.02, 0.03, 0])
    assert (first["id"], third["id"]) == ("r0c0", "r0c2")


def test_a_display_over_two_tiles_has_the_pixels_of_both_and_spans_the_frame_between_them() -> None:
    made = convert(CONFIG.replace("BORDERS", ARRAY), "lab.json")

    wide = made.values["wall"]["panels"][1]
    assert wide["pixels"] == [3840, 1080]
    assert wide["corners"]["lower_right"][0] - wide["corners"]["lower_left"][0] == pytest.approx(2.43)
    assert any(item.what == "displays[1]" and "frames between them" in item.why for item in made.not_carried)


def test_the_viewing_distance_is_the_eyes() -> None:
    assert convert(CONFIG.replace("BORDERS", ARRAY), "lab.json").values["views"][0]["eye"] == [0, 0, 5]


def test_the_servers_desktop_is_listed_without_its_secrets() -> None:
    left_out = {item.line: item for item in convert(CONFIG.replace("BORDERS", ARRAY), "lab.json").not_carried}

    assert {5, 13, 14} == set(left_out)
    assert left_out[14].what == "apis.twitter.consumerSecret"
    assert not any("abc" in item.what + item.why for item in left_out.values())


def test_without_metres_pixels_are_a_quarter_of_a_millimetre() -> None:
    made = convert("{resolution: {width: 400, height: 200}}", "a.json")

    panel = made.values["wall"]["panels"][0]
    assert panel["corners"]["lower_left"] == [-0.05, -0.025, 0]
    assert (made.panels, "eye" in made.values["views"][0]) == (1, False)
    assert any("0.25 mm a pixel" in sentence for sentence in made.assumed)


def test_one_side_in_metres_gives_the_other_by_square_pixels() -> None:
    made = convert("{resolution: {width: 400, height: 200}, dimensions: {tile_height: 0.5}}", "a.json")

    assert made.values["wall"]["panels"][0]["corners"]["lower_left"] == [-0.5, -0.25, 0]


@pytest.mark.parametrize(
    "displays",
    [
        "[{row: 0, column: 1, host: 'left'}]",
        "{row: 0, column: 1, host: 'left'}",
        "{one: {row: 0, column: 1, hostname: 'left'}}",
    ],
)
def test_displays_may_be_a_list_an_object_of_objects_or_one_object(displays: str) -> None:
    text = f"{{resolution: [400, 200], layout: [1, 2], displays: {displays}}}"

    panels = convert(text, "a.json").values["wall"]["panels"]

    assert [(panel["id"], panel["host"]) for panel in panels] == [("r0c1", "left")]
    assert panels[0]["corners"]["lower_left"] == [0, -0.025, 0]


def test_without_displays_every_cell_of_the_layout_is_one() -> None:
    made = convert("{resolution: {width: 4, height: 2}, layout: {rows: 2, columns: 2}}", "a.json")

    assert [panel["id"] for panel in made.values["wall"]["panels"]] == ["r0c0", "r0c1", "r1c0", "r1c1"]


def test_a_display_wider_than_one_rank_can_render_gets_more() -> None:
    made = convert("{resolution: {width: 8192, height: 2160}}", "a.json")

    assert made.values["graph"]["ranks_per_panel"] == 2


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("{}", "a.json:1:1: the file: has no resolution"),
        ("{resolution: {width: 0, height: 5}}", "a.json:1:2: resolution: is not a tile's width and height"),
        ("{resolution: {width: 1, height: 5}, layout: {rows: 0}}", "layout.rows: is 0; accepted: 1 to 1024"),
        ("{resolution: [1, 5], layout: [1000, 1000]}", "has 1000 x 1000 tiles; accepted: at most 1024"),
    ],
)
def test_a_file_without_a_wall_is_refused_with_the_place(text: str, says: str) -> None:
    with pytest.raises(NotThisFormat) as caught:
        convert(text, "a.json")

    assert says in str(caught.value)
