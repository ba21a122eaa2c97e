"""Tide's JSON and DisplayCluster's XML: equal screens in rows and columns, with mullions in pixels."""

from __future__ import annotations

import pytest

from wall.importers import displaycluster, tide
from wall.importers.report import NotThisFormat

DISPLAYCLUSTER = """<configuration>
    <dimensions numTilesWidth="2" numTilesHeight="2" screenWidth="400" screenHeight="200"
                mullionWidth="40" mullionHeight="20" fullscreen="0"/>
    <dock directory="/media"/>
    <process host="s01" display=":0">
        <screen x="0" y="0" i="0" j="1"/>
        <screen x="400" y="-7" i="1" j="1"/>
    </process>
    <process host="s02" display=":0.1">
        <screen x="0" y="0" i="0" j="0"/>
    </process>
</configuration>
"""
TIDE = """{
    "master": {"display": ":0", "host": "head"},
    "processes": [
        {"host": "n1", "screens": [
            {"display": ":0.2", "y": 80},
            {"display": ":0.2", "i": 1, "x": 400, "y": 80, "stereo": "left"},
            {"display": ":0.3", "i": 1, "stereo": "right", "fullscreen": true}
        ]}
    ],
    "surfaces": [
        {"background": {"color": "#00f5ff"}, "displayHeight": 400, "displayWidth": 400, "screenCountX": 2,
         "bezelWidth": 20, "dimensions": [1.64, 0.8]}
    ]
}"""


def test_screens_stand_where_their_indices_say_row_0_at_the_top() -> None:
    panels = displaycluster.convert(DISPLAYCLUSTER, "c.xml").values["wall"]["panels"]

    # 0.25 mm a pixel: the wall is 2 * 100 + 10 mm wide and 2 * 50 + 5 mm high, its middle at the origin
    assert [panel["id"] for panel in panels] == ["r1c0", "r1c1", "r0c0"]
    assert panels[0]["corners"]["lower_left"] == [-0.105, -0.0525, 0.0]
    assert panels[1]["corners"]["lower_left"] == [0.005, -0.0525, 0.0]
    assert panels[2]["corners"]["upper_left"] == [-0.105, 0.0525, 0.0]
    assert panels[0]["bezel"] == {"left": 0.005, "right": 0.005, "top": 0.0025, "bottom": 0.0025}


def test_processes_give_host_and_display_and_screens_their_windows() -> None:
    panels = displaycluster.convert(DISPLAYCLUSTER, "c.xml").values["wall"]["panels"]

    assert [(panel["host"], panel["display"]) for panel in panels] == [("s01", ":0"), ("s01", ":0"), ("s02", ":0.1")]
    assert panels[1]["window"] == {"x": 400, "y": -7, "width": 400, "height": 200}


def test_a_desktops_documents_are_listed_and_what_is_assumed_is_said() -> None:
    made = displaycluster.convert(DISPLAYCLUSTER, "c.xml")

    assert [(item.line, item.what) for item in made.not_carried] == [
        (4, "configuration.dock[0]"),
        (4, "configuration.dock[0].directory = '/media'"),
    ]
    assert any("0.25 mm a pixel" in sentence for sentence in made.assumed)
    assert any("a rank of its own" in sentence for sentence in made.assumed)
    assert (made.panels, made.ranks) == (3, 3)


def test_tides_xml_has_other_names_for_the_same_and_overlaps_as_negative_bezels() -> None:
    text = (
        '<configuration><dimensions numScreensX="2" displayWidth="100" displayHeight="50" bezelWidth="-20" '
        'displaysPerScreenX="2" physicalWidth="3.4" physicalHeight="0.5"/></configuration>'
    )

    panels = displaycluster.convert(text, "c.xml").values["wall"]["panels"]

    # a screen is two displays that share 20 pixels: 180; the surface is 2 * 180 - 20 = 340 pixels, 10 mm each
    assert [panel["pixels"] for panel in panels] == [[180, 50], [180, 50]]
    assert panels[0]["overlap"] == {"right": 0.2}
    assert panels[1]["corners"]["lower_left"] == [-0.1, -0.25, 0.0]


def test_tide_gives_metres_stereo_and_windows() -> None:
    made = tide.convert(TIDE, "t.json")

    first, left, right = made.values["wall"]["panels"]
    assert first["corners"]["lower_left"] == [-0.82, -0.4, 0.0]
    assert first["corners"]["lower_right"] == [-0.02, -0.4, 0.0]
    assert first["window"] == {"x": 0, "y": 80, "width": 400, "height": 400}
    assert (left["id"], left["stereo"], right["id"], right["stereo"]) == ("r0c1-left", "left", "r0c1-right", "right")
    assert "overlap" not in left
    assert "window" not in right
    assert right["display"] == ":0.3"
    assert {(item.line, item.what.split(" ")[0]) for item in made.not_carried} == {
        (2, "master"),
        (2, "master.display"),
        (2, "master.host"),
        (11, "surfaces[0].background"),
        (11, "surfaces[0].background.color"),
    }


def test_a_screen_of_several_displays_is_one_panel_with_the_frames_inside_it() -> None:
    text = '{"surfaces": [{"displayWidth": 1920, "displayHeight": 1080, "displaysPerScreenX": 2, "bezelWidth": 14}]}'

    made = tide.convert(text, "t.json")

    assert made.values["wall"]["panels"][0]["pixels"] == [3854, 1080]
    assert made.not_carried == []


def test_surfaces_stand_side_by_side() -> None:
    text = (
        '{"surfaces": [{"displayWidth": 600, "displayHeight": 600}, {"displayWidth": 1200, "displayHeight": 400}],'
        '"processes": [{"host": "a", "screens": [{}, {"surface": 1}, {"surface": 7}]}]}'
    )

    made = tide.convert(text, "t.json")

    first, second = made.values["wall"]["panels"]  # 0.15 + 0.1 + 0.3 m
    assert first["corners"]["lower_left"] == [-0.275, -0.075, 0.0]
    assert second["corners"]["lower_left"] == [-0.025, -0.05, 0.0]
    assert (first["id"], second["id"]) == ("s0-r0c0", "s1-r0c0")
    assert [item.why for item in made.not_carried] == ["is on surface 7 of 2"]
    assert any("side by side, 0.1 m apart" in sentence for sentence in made.assumed)


def test_without_processes_every_screen_is_a_panel_of_no_machine() -> None:
    text = '{"surfaces": [{"displayWidth": 60, "displayHeight": 60, "screenCountX": 3, "screenCountY": 2}]}'

    panels = tide.convert(text, "t.json").values["wall"]["panels"]

    assert [panel["id"] for panel in panels] == ["r0c0", "r0c1", "r0c2", "r1c0", "r1c1", "r1c2"]
    assert "host" not in panels[0]


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("{}", "t.json:1:1: the file: has no surfaces"),
        ('{"surfaces": [5]}', "t.json:1:15: surfaces[0]: is not an object"),
        ('{"surfaces": [\n{"displayWidth": 5}]}', "t.json:2:1: surfaces[0]: displayHeight is missing"),
        ('{"surfaces": [{"displayWidth": 0, "displayHeight": 1}]}', "surfaces[0].displayWidth: is 0"),
        (
            '{"surfaces": [{"displayWidth": 9, "displayHeight": 1, "screenCountX": 0}]}',
            "surfaces[0].screenCountX: is 0; accepted: a whole number from 1 to 1024",
        ),
        (
            '{"surfaces": [{"displayWidth": 9, "displayHeight": 1, "screenCountX": 900, "screenCountY": 900}]}',
            "has 810000 screens; accepted: 1 to 1024",
        ),
    ],
)
def test_a_tide_file_without_a_wall_is_refused_with_the_place(text: str, says: str) -> None:
    with pytest.raises(NotThisFormat) as caught:
        tide.convert(text, "t.json")

    assert says in str(caught.value)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("<config/>", "the first element is <config>; accepted: <configuration>"),
        ("<configuration/>", "has no <dimensions>"),
        ('<configuration>\n <dimensions screenWidth="x" screenHeight="2"/></configuration>', "c.xml:2:14: "),
    ],
)
def test_a_displaycluster_file_without_a_wall_is_refused_with_the_place(text: str, says: str) -> None:
    with pytest.raises(NotThisFormat) as caught:
        displaycluster.convert(text, "c.xml")

    assert says in str(caught.value)
