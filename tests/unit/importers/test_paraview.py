"""ParaView's .pvx files: machines become panels, corners stay as they are."""

from __future__ import annotations

import pytest

from wall.importers.paraview import convert
from wall.importers.report import NotThisFormat

CAVE = """<?xml version="1.0" ?>
<pvx>
  <Process Type="client"><Machine Name="console"/></Process>
  <Process Type="server">
    <EyeSeparation Value="0.06"/>
    <Machine Name="left wall"
             Environment="DISPLAY=:0.1 LANG=C"
             Geometry="640x360+100+-20"
             ShowBorders="0"
             StereoType="Crystal Eyes"
             LowerLeft="-1 -1  1"
             LowerRight="-1 -1 -1"
             UpperRight="-1  1 -1"/>
    <Machine Name="front"
             Typo="garbage"
             StereoType="Left"
             Geometry="640x360"
             LowerLeft="-1 -1 -1"
             LowerRight="1 -1 -1"
             UpperRight="1  1 -1"/>
    <machine Name="ignored"/>
  </Process>
</pvx>
"""


def one(attributes: str) -> str:
    return f'<pvx>\n<Machine Name="m" {attributes}/>\n</pvx>'


def test_every_machine_is_a_panel_with_its_corners_display_and_window() -> None:
    made = convert(CAVE, "cave.pvx")

    left, front = made.values["wall"]["panels"]
    assert left == {
        "id": "left-wall",
        "pixels": [640, 360],
        "corners": {"lower_left": [-1, -1, 1], "lower_right": [-1, -1, -1], "upper_left": [-1, 1, 1]},
        "host": "left wall",
        "display": ":0.1",
        "window": {"x": 100, "y": -20, "width": 640, "height": 360},
    }
    assert front["stereo"] == "left"
    assert "window" not in front
    assert (made.panels, made.ranks) == (2, 2)


def test_the_eye_is_at_the_origin_with_the_eye_separation_of_the_file() -> None:
    view = convert(CAVE, "cave.pvx").values["views"][0]

    assert view["eye"] == [0.0, 0.0, 0.0]
    assert view["eye_separation"] == 0.06


def test_what_paraview_ignores_or_reads_differently_is_listed_with_its_line() -> None:
    items = convert(CAVE, "cave.pvx").not_carried
    left_out = {item.line: item for item in items}

    assert [item.what for item in items if item.line == 3] == [
        "pvx.Process[0]",
        "pvx.Process[0].Type = 'client'",
        "pvx.Process[0].Machine[0].Name = 'console'",
    ]
    assert "LANG=C" in left_out[7].why
    assert left_out[10].what == "pvx.Process[1].Machine[0].StereoType = 'Crystal Eyes'"
    assert left_out[15].what == "pvx.Process[1].Machine[1].Typo = 'garbage'"
    assert left_out[21].what == "pvx.Process[1].machine[0].Name = 'ignored'"
    assert 9 not in left_out  # ShowBorders="0": windows have none


def test_a_number_with_a_typo_is_read_as_paraview_reads_it_and_the_screen_is_squared() -> None:
    text = one('LowerLeft="-1 -1 0.05"\n LowerRight="1 -1 0/05"\n UpperRight="1 -1 -1"')

    made = convert(text, "floor.pvx")

    corners = made.values["wall"]["panels"][0]["corners"]
    assert corners["lower_right"] == [1.0, -1.0, 0.0]
    across = [b - a for a, b in zip(corners["lower_left"], corners["lower_right"], strict=True)]
    up = [b - a for a, b in zip(corners["lower_left"], corners["upper_left"], strict=True)]
    assert sum(a * b for a, b in zip(across, up, strict=True)) == pytest.approx(0.0, abs=1e-8)
    assert any(item.line == 3 and "is not three numbers" in item.why for item in made.not_carried)


def test_screens_without_corners_stand_side_by_side_and_leave_the_eye_open() -> None:
    text = '<pvx><Machine Name="a" Geometry="300x200+0+0"/><Machine Name="b"/></pvx>'

    made = convert(text, "plain.pvx")

    first, second = made.values["wall"]["panels"]
    assert first["corners"]["lower_right"] == [0.075, 0.0, 0.0]  # 300 pixels of 0.25 mm
    assert second["corners"]["lower_left"] == [0.075, 0.0, 0.0]
    assert second["pixels"] == [1920, 1080]
    assert "eye" not in made.values["views"][0]
    assert any("0.25 mm a pixel" in sentence for sentence in made.assumed)


def test_screens_without_geometry_get_square_pixels_of_one_density() -> None:
    text = (
        '<pvx><Machine LowerLeft="-2 0 -1" LowerRight="0 0 -1" UpperRight="0 1 -1"/>'
        '<Machine LowerLeft="0 0 -1" LowerRight="1 0 -1" UpperRight="1 1 -1"/></pvx>'
    )

    panels = convert(text, "w.pvx").values["wall"]["panels"]

    assert [panel["pixels"] for panel in panels] == [[1920, 960], [960, 960]]
    assert [panel["id"] for panel in panels] == ["screen", "screen-2"]


def test_two_viewers_of_one_screen_are_two_panels_that_say_that_they_overlap() -> None:
    screen = 'LowerLeft="-1 -1 -1" LowerRight="1 -1 -1" UpperRight="1 1 -1" Geometry="32x32+0+0"'
    text = f'<pvx>\n<Machine ViewerId="0" {screen}/>\n<Machine ViewerId="1" {screen}/>\n</pvx>'

    made = convert(text, "two.pvx")

    assert made.panels == 2
    assert all(panel["overlap"]["right"] == 2.0 for panel in made.values["wall"]["panels"])
    assert [(item.line, item.what) for item in made.not_carried] == [(3, "pvx.Machine[1].ViewerId = '1'")]


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("<wall/>", "w.pvx:1:1: wall: the first element is <wall>; accepted: <pvx>"),
        ("<pvx>\n</pvx>", "w.pvx:1:1: pvx: names no Machine"),
        ("{}", "w.pvx:1:1: not valid XML"),
    ],
)
def test_another_file_is_refused_with_its_place(text: str, says: str) -> None:
    with pytest.raises(NotThisFormat) as caught:
        convert(text, "w.pvx")

    assert says in str(caught.value)


@pytest.mark.parametrize("geometry", ["300", "0x10+0+0", "-5x10+0+0", "1e3x10", "99999999999x1+0+0"])
def test_an_invalid_geometry_is_listed(geometry: str) -> None:
    made = convert(one(f'Geometry="{geometry}"'), "w.pvx")

    assert [item.why for item in made.not_carried] == ["is not WIDTHxHEIGHT+X+Y"]
    assert made.values["wall"]["panels"][0]["pixels"] == [1920, 1080]
