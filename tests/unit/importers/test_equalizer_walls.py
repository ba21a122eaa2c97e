"""Where an Equalizer file's panels stand, who sees them, and on which display."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from equalizer_texts import WALL, one_panel, pipes, server

from wall.core.errors import ConfigError
from wall.importers.equalizer import convert
from wall.importers.report import Conversion

EXACT = 2e-9  # corners are written with nine digits after the point


def made(*parts: str) -> Conversion:
    return convert(server(*parts), "f.eqc")


def panels(conversion: Conversion) -> dict[str, dict[str, Any]]:
    return {panel["id"]: panel for panel in conversion.values["wall"]["panels"]}


def corners(panel: dict[str, Any]) -> np.ndarray:
    """(3, 3) rows lower left, lower right, upper left, metres."""
    return np.array([panel["corners"][name] for name in ("lower_left", "lower_right", "upper_left")])


def canvas(*segments: str, frustum: str = WALL, view: str = "view {}") -> str:
    return f"observer {{}} layout {{ {view} }} canvas {{ layout 0 {frustum} {' '.join(segments)} }}"


def test_an_empty_wall_is_equalizers_own() -> None:
    conversion = made(pipes("a"), canvas('segment { channel "a" }', frustum="wall {}"))
    np.testing.assert_allclose(corners(panels(conversion)["a"]), [(-0.8, -0.5, -1), (0.8, -0.5, -1), (-0.8, 0.5, -1)])
    assert any("default wall" in item.why for item in conversion.carried)


def test_segments_are_parts_of_the_canvas_from_its_lower_left() -> None:
    low, high = 'segment { channel "a" viewport [ 0 0 1 .25 ] }', 'segment { channel "b" viewport [ .5 .25 .5 .75 ] }'
    found = panels(made(pipes("ab"), canvas(low, high)))
    np.testing.assert_allclose(corners(found["a"]), [(-0.4, -0.3, -1), (0.4, -0.3, -1), (-0.4, -0.15, -1)], atol=EXACT)
    np.testing.assert_allclose(corners(found["b"]), [(0, -0.15, -1), (0.4, -0.15, -1), (0, 0.3, -1)], atol=EXACT)


def test_a_segments_own_wall_is_before_the_canvas_and_a_views_before_both() -> None:
    own = WALL.replace("-1 ]", "-2 ]")
    view = f"view {{ viewport [ 0 0 .5 1 ] {WALL.replace('-1 ]', '-3 ]')} }} view {{ viewport [ .5 0 .5 1 ] }}"
    found = panels(made(pipes("ab"), canvas(f'segment {{ channel "a" {own} }}', view=view)))
    np.testing.assert_allclose(corners(found["a"]), [(-0.4, -0.3, -3), (0.4, -0.3, -3), (-0.4, 0.3, -3)], atol=EXACT)
    np.testing.assert_allclose(corners(found["a-2"]), [(0, -0.3, -2), (0.4, -0.3, -2), (0, 0.3, -2)], atol=EXACT)
    assert found["a"]["pixels"] == found["a-2"]["pixels"] == [200, 300]
    assert (found["a"]["window"]["x"], found["a-2"]["window"]["x"]) == (0, 200)


def test_a_view_across_segments_is_cut_where_they_meet() -> None:
    segments = ('segment { channel "a" viewport [ 0 0 .5 1 ] }', 'segment { channel "b" viewport [ .5 0 .5 1 ] }')
    view = f"view {{ viewport [ .25 0 .5 1 ] {WALL} }}"
    found = panels(made(pipes("ab"), canvas(*segments, view=view)))
    np.testing.assert_allclose(corners(found["a"])[:2], [(-0.4, -0.3, -1), (0, -0.3, -1)], atol=EXACT)
    np.testing.assert_allclose(corners(found["b"])[:2], [(0, -0.3, -1), (0.4, -0.3, -1)], atol=EXACT)


@pytest.mark.parametrize(
    ("hpr", "direction"),
    [("0 0 0", (0, 0, -1)), ("90 0 0", (-1, 0, 0)), ("0 90 0", (0, -1, 0)), ("-30 0 0", (0.5, 0, -np.sqrt(0.75)))],
)
def test_a_projection_is_a_wall_before_its_origin(hpr: str, direction: tuple[float, float, float]) -> None:
    projection = f"projection {{ origin [ .1 .2 .3 ] distance 2 fov [ 90 53.1301 ] hpr [ {hpr} ] }}"
    eye = "observer { eye_cyclop [ .1 .2 .3 ] } layout { view { observer 0 } }"
    text = f'{eye} canvas {{ layout 0 {projection} segment {{ channel "a" }} }}'
    found = corners(panels(made(pipes("a"), text))["a"])
    centre = (found[1] + found[2]) / 2
    np.testing.assert_allclose(centre, np.array([0.1, 0.2, 0.3]) + 2 * np.array(direction), atol=1e-6)
    np.testing.assert_allclose(np.linalg.norm(found[1:] - found[0], axis=1), [4.0, 2.0], atol=1e-5)  # 2 d tan(fov / 2)


def test_roll_turns_a_projection_clockwise() -> None:
    found = corners(panels(made(pipes("a"), canvas('segment { channel "a" projection { hpr [ 0 0 90 ] } }')))["a"])
    across = (found[1] - found[0]) / np.linalg.norm(found[1] - found[0])
    np.testing.assert_allclose(across, (0, -1, 0), atol=1e-6)


def test_a_compounds_viewport_is_a_part_of_the_wall_above_it() -> None:
    tree = (
        f'compound {{ {WALL} compound {{ channel "a" viewport [ 0 0 .5 1 ] }} '
        'compound { channel "b" viewport [ .5 0 .5 1 ] } }'
    )
    found = panels(made(pipes("ab"), tree))
    np.testing.assert_allclose(corners(found["b"]), [(0, -0.3, -1), (0.4, -0.3, -1), (0, 0.3, -1)], atol=EXACT)
    assert found["b"]["pixels"] == [400, 300]


def test_panels_without_corners_stand_in_a_row_and_it_is_reported() -> None:
    conversion = made(pipes("ab"))
    found = panels(conversion)
    a, b = corners(found["a"]), corners(found["b"])
    np.testing.assert_allclose(a[1], b[0], atol=EXACT)
    widths = np.linalg.norm(a[1] - a[0]), np.linalg.norm(a[2] - a[0])
    assert widths[0] / widths[1] == pytest.approx(400 / 300)
    assert any("no place of a, b" in text for text in conversion.assumed)


def test_panels_that_overlap_are_seen_under_the_same_angles() -> None:
    conversion = made(pipes("abc"), canvas(*(f'segment {{ channel "{name}" }}' for name in "abc")))
    a, b, c = (corners(panels(conversion)[name]) for name in "abc")
    for other, times in ((b, 1.002), (c, 1.004)):
        np.testing.assert_allclose(other, a * times, atol=EXACT)  # the eye is the origin
    assert sum("shows the place of panel a" in text for text in conversion.assumed) >= 1


def test_panels_for_one_eye_each_share_their_position() -> None:
    eyes = ('segment { channel "a" eye [ LEFT ] }', 'segment { channel "b" eye [ RIGHT ] }')
    mono = 'segment { channel "c" eye [ CYCLOP ] }'
    conversion = made(pipes("abc"), canvas(*eyes, mono, view="view { mode STEREO }"))
    found = panels(conversion)
    assert {name: panel["stereo"] for name, panel in found.items()} == {"a": "left", "b": "right"}
    np.testing.assert_array_equal(corners(found["a"]), corners(found["b"]))
    assert any("the view's mode does not use" in item.why for item in conversion.not_carried)


def test_a_wall_that_faces_away_is_turned_to_the_viewer_and_it_is_reported() -> None:
    ceiling = "wall { bottom_left [ -1 1 1 ] bottom_right [ 1 1 1 ] top_left [ -1 1 -1 ] }"
    conversion = made(pipes("a"), canvas('segment { channel "a" }', frustum=ceiling))
    found = corners(panels(conversion)["a"])
    assert np.cross(found[1] - found[0], found[2] - found[0])[1] < 0  # down, to the eye below it
    assert any("faces away" in text for text in conversion.assumed)


@pytest.mark.parametrize(
    ("wall", "told"),
    [
        ("bottom_left [ 0 0 -1 ] bottom_right [ 0 0 -1 ]", "wall of 0 x"),
        ("top_left [ 0 .5 -1 ]", "no right angle"),
        ("bottom_left [ -1 0 1 ] bottom_right [ 1 0 1 ] top_left [ -1 0 -1 ]", "in the plane of panel a"),
    ],
)
def test_a_wall_that_shows_nothing_is_refused_with_its_place(wall: str, told: str) -> None:
    with pytest.raises(ConfigError, match=r"^f\.eqc:\d+:\d+: ") as refused:
        made(pipes("a"), canvas('segment { channel "a" }', frustum=f"wall {{ {wall} }}"))
    assert told in str(refused.value)


def test_observers_give_the_eye_and_its_separation() -> None:
    observer = "observer { eye_left [ -.03 .1 0 ] eye_cyclop [ 0 .1 0 ] eye_right [ .03 .1 0 ] }"
    second = "observer { eye_base .1 eye_cyclop [ .5 0 0 ] }"
    views = "layout { view { observer 0 viewport [ 0 0 .5 1 ] } view { observer 1 viewport [ .5 0 .5 1 ] } }"
    conversion = made(pipes("a"), f'{observer} {second} {views} canvas {{ layout 0 {WALL} segment {{ channel "a" }} }}')
    view = conversion.values["views"][0]
    assert (view["eye"], view["eye_separation"]) == ([0.0, 0.1, 0.0], pytest.approx(0.06))
    assert [panel.get("eye") for panel in panels(conversion).values()] == [None, [0.5, 0.0, 0.0]]


@pytest.mark.parametrize("text", ["global { EQ_CONFIG_FATTR_EYE_BASE .07 }\n", ""])
def test_the_files_eye_base_is_the_separation(text: str) -> None:
    config = "" if text else "attributes { eye_base .07 }"
    conversion = convert(text + server(pipes("a"), config), "f.eqc")
    assert conversion.values["views"][0]["eye_separation"] == pytest.approx(0.07)


def test_displays_windows_and_machines_are_those_of_the_channel() -> None:
    node = (
        'node { connection { hostname "wall7" } pipe { port 1 device 2 viewport [ 0 0 2000 1000 ] '
        'window { viewport [ .25 .1 .5 .5 ] channel { name "a" viewport [ 0 .5 .5 .5 ] } channel { name "b" } } } }'
    )
    found = panels(made(node))
    assert found["a"]["host"] == "wall7"
    assert found["a"]["display"] == ":1.2"
    assert found["a"]["window"] == {"x": 500, "y": 100, "width": 500, "height": 250}  # the upper half of its window
    assert found["b"]["window"] == {"x": 500, "y": 100, "width": 1000, "height": 500}


@pytest.mark.parametrize(
    ("head", "attribute", "window"),
    [("global { EQ_WINDOW_IATTR_HINT_FULLSCREEN ON }\n", "", False), ("", "attributes { hint_fullscreen ON }", False),
     ("global { EQ_WINDOW_IATTR_HINT_FULLSCREEN ON }\n", "attributes { hint_fullscreen OFF }", True)],
)  # fmt: skip
def test_a_full_screen_panel_has_no_window(head: str, attribute: str, window: bool) -> None:
    node = f'appNode {{ pipe {{ window {{ viewport [ 5 6 640 480 ] {attribute} channel {{ name "a" }} }} }} }}'
    panel = panels(convert(head + server(node), "f.eqc"))["a"]
    assert ("window" in panel) == window
    assert panel["pixels"] == [640, 480]


def test_the_size_of_an_unknown_display_is_assumed_and_reported() -> None:
    conversion = made('appNode { pipe { window { viewport [ 0 0 .5 .5 ] channel { name "a" } } } }')
    assert panels(conversion)["a"]["pixels"] == [960, 540]
    assert any("1920 x 1080" in text for text in conversion.assumed)
    assert not any("1920 x 1080" in text for text in made(pipes("a")).assumed)


def test_names_become_ids_that_differ() -> None:
    names = ("left eye", "left-eye", "Ünïcode!", "", "x" * 200)
    found = list(panels(made(pipes(names))))
    assert len(set(found)) == 5
    assert found[:2] == ["left-eye", "left-eye-2"]
    assert max(map(len, found)) <= 48


def test_other_layouts_are_reported_with_all_inside() -> None:
    other = f'layout {{ name "later" view {{ {WALL} }} }}'
    text = server(
        pipes("ab"), 'layout { name "first" view {} }', other,
        f'canvas {{ layout OFF layout "first" layout "later" {WALL} segment {{ channel "a" }} }}',
        'compound { channel ( layout "later" ) load_equalizer {} compound { channel "b" outputframe {} } }',
    )  # fmt: skip
    conversion = convert(text, "f.eqc")
    assert list(panels(conversion)) == ["a"]
    left = [item.what for item in conversion.not_carried]
    for what in ("canvas / layout OFF", "canvas / layout later", 'layout "later" / view / wall / top_left -0.4 0.3 -1'):
        assert what in left
    assert "compound / load_equalizer" in left


def test_an_off_screen_panel_is_dropped_for_those_that_take_its_frames() -> None:
    node = (
        'appNode { pipe { window { attributes { hint_drawable FBO } viewport [ 0 0 400 300 ] channel { name "all" } } '
        'window { viewport [ 0 0 200 300 ] channel { name "part" } } } }'
    )
    segments = ('segment { channel "all" }', 'segment { channel "part" viewport [ 0 0 .5 1 ] }')
    tree = (
        'compound { compound { channel ( segment 0 ) outputframe { name "x" viewport [ 0 0 .5 1 ] } } '
        'compound { channel ( segment 1 ) task [ CLEAR ASSEMBLE ] inputframe { name "x" } } }'
    )
    conversion = made(node, canvas(*segments), tree)
    assert list(panels(conversion)) == ["part"]
    assert any(item.why.startswith("off-screen") for item in conversion.not_carried)


def test_an_odd_image_for_two_eyes_is_cut_to_one_that_can_be_halved() -> None:
    text = one_panel("", ("a",), mode="mode STEREO")
    for size, stereo, pixels in (
        ("401 301", "side_by_side", [400, 301]),
        ("401 300", "top_bottom", [401, 300]),
        ("400 301", "side_by_side", [400, 301]),
    ):
        panel = panels(convert(text.replace("400 300", size), "f.eqc"))["a"]
        assert (panel["stereo"], panel["pixels"]) == (stereo, pixels)


def test_segments_and_compounds_that_nothing_shows_have_a_reason() -> None:
    text = server(
        pipes("abc"), f"layout {{ view {{ viewport [ 0 0 .5 1 ] }} }} canvas {{ layout 0 {WALL}",
        'segment { channel "a" viewport [ 0 0 .5 1 ] } segment { channel "b" viewport [ .5 0 .5 1 ] }',
        'segment { channel "c" eye [ LEFT ] viewport [ 0 0 .5 1 ] } }', "compound { channel ( segment 2 ) }",
    )  # fmt: skip
    why = {
        item.what: item.why
        for item in convert(text, "f.eqc").not_carried
        if item.what in ("canvas / segment", "compound")
    }
    assert why == {
        "canvas / segment": "it shows eyes that the view's mode does not use",
        "compound": "no panel shows this view on this segment",
    }
    assert "no view of the layout lies on it" in {item.why for item in convert(text, "f.eqc").not_carried}
