"""Where windows go: pure, for monitors that no X server of a test has."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from wall.config.screens import GridConfig, WallConfig
from wall.core.errors import RunError
from wall.display.window_layout import TURNS, Box, Monitor, WindowRequest, lay_out, request_of
from wall.geometry.expanding import expand

LEFT = Monitor("DP-1", Box(0, 0, 1920, 1080), 60)
RIGHT = Monitor("HDMI-1", Box(1920, 0, 1280, 1024), 120)


def wanted(name: str = "p", **changes: Any) -> WindowRequest:
    plain = WindowRequest(
        id=name,
        pixels=(1920, 1080),
        screen=(0, 0),
        span=changes.get("pixels", (1920, 1080)),
        rotation=0,
        monitor=None,
        window=None,
        most_hz=None,
    )
    return replace(plain, **changes)


def test_a_panel_fills_the_monitor_that_it_names_by_index_or_by_name() -> None:
    for monitor in (1, "HDMI-1"):
        [position] = lay_out([wanted(monitor=monitor, pixels=(1280, 1024))], [LEFT, RIGHT], display=":0")
        assert (position.box, position.monitor, position.note) == (RIGHT.box, 1, "")


def test_a_single_panel_that_names_nothing_fills_the_first_monitor() -> None:
    [position] = lay_out([wanted()], [LEFT, RIGHT], display=":0")
    assert (position.box, position.monitor) == (LEFT.box, 0)


def test_a_window_is_counted_from_its_monitor_or_from_the_whole_screen() -> None:
    near, far = lay_out(
        [wanted("a", window=(10, 20, 300, 200)), wanted("b", window=(10, 20, 300, 200), monitor=1)],
        [LEFT, RIGHT],
        display=":0",
    )
    assert (near.box, near.monitor) == (Box(10, 20, 300, 200), None)
    assert (far.box, far.monitor) == (Box(1930, 20, 300, 200), None)


def test_a_turned_panel_fills_its_monitor_with_width_and_height_exchanged() -> None:
    [position] = lay_out([wanted(pixels=(1080, 1920), rotation=90)], [LEFT], display=":0")
    assert (position.rotation, position.note) == (90, "")
    [position] = lay_out([wanted(pixels=(1920, 1080), rotation=90)], [LEFT], display=":0")
    assert position.note == "panel p: 1080x1920 pixels are scaled to the 1920x1080 of monitor DP-1"


def test_panels_on_a_desk_keep_their_shape_and_stay_on_the_monitor() -> None:
    """A wall of 4 x 2 panels of 1920 x 1080 with gaps of 40 pixels, on a monitor of 1920 x 1080."""
    panels = [wanted(f"{x}{y}", screen=(1960 * x, 1120 * y), rotation=180) for y in range(2) for x in range(4)]
    found = lay_out(panels, [LEFT], display=":0")
    scale = 1920 / (4 * 1960 - 40)
    assert (found[0].box.x, found[3].box.x + found[3].box.width) == (0, 1920)
    middle = (1080 - round(scale * 2200)) // 2
    assert found[0].box.y == middle
    for position in found:
        assert abs(position.box.width - 1920 * scale) <= 1
        assert abs(position.box.height - 1080 * scale) <= 1
        assert (position.monitor, position.rotation) == (None, 0)  # nothing is mounted turned on a desk
    assert found[1].box.x - (found[0].box.x + found[0].box.width) == pytest.approx(40 * scale, abs=1)


def test_panels_of_both_eyes_side_by_side_lie_beside_each_other_on_a_desk() -> None:
    """Their places in the virtual screen are those of one eye, half as wide."""
    panels = [wanted(f"{x}", pixels=(640, 240), screen=(320 * x, 0), span=(320, 240)) for x in range(2)]
    first, second = (position.box for position in lay_out(panels, [LEFT], display=":0"))
    assert (first.width, first.height, second.width) == (640, 240, 640)
    assert second.x == first.x + 640


def test_a_panel_of_coarse_pixels_has_its_place_on_a_desk() -> None:
    panels = [wanted("fine", pixels=(400, 300)), wanted("coarse", pixels=(100, 75), screen=(400, 0), span=(400, 300))]
    fine, coarse = (position.box for position in lay_out(panels, [LEFT], display=":0"))
    assert (fine.width, fine.height) == (coarse.width, coarse.height) == (400, 300)
    assert coarse.x == fine.x + 400


def test_a_slower_panel_is_shown_at_every_second_blank() -> None:
    intervals = [
        lay_out([wanted(monitor=k, most_hz=hz)], [LEFT, RIGHT], display=":0")[0].interval
        for k, hz in ((0, None), (1, None), (0, 30.0), (1, 30.0), (0, 59.0))
    ]
    assert intervals == [1, 1, 2, 4, 1]
    assert lay_out([wanted(most_hz=30.0)], [LEFT._replace(blanks_per_s=0)], display=":0")[0].interval == 1


def test_a_panel_that_is_not_slower_than_its_images_waits_for_no_more_than_one_blank() -> None:
    [panel] = expand(WallConfig(grid=GridConfig(columns=1, rows=1, pixels=(64, 48), size=(0.4, 0.3)))).panels
    configs = [panel.config.model_copy(update={"refresh_hz": hz}) for hz in (None, 30.0, 60.0, 120.0)]
    rates = [request_of(replace(panel, config=config), 60.0).most_hz for config in configs]
    assert rates == [None, 30.0, None, None]


def test_a_monitor_cannot_be_filled_twice() -> None:
    both = [wanted("a", monitor=0), wanted("b", monitor="DP-1")]
    with pytest.raises(RunError, match="panel b: monitor DP-1 of display :0 is filled by panel a; wanted another"):
        lay_out(both, [LEFT, RIGHT], display=":0")


def test_a_monitor_that_there_is_not_is_refused_with_those_that_there_are() -> None:
    with pytest.raises(RunError, match=r"no monitor 2; it has 0 \(DP-1, 1920x1080\), 1 \(HDMI-1, 1280x1024\)"):
        lay_out([wanted(monitor=2)], [LEFT, RIGHT], display=":0")
    with pytest.raises(RunError, match="panel p: display :0 has no monitor that is switched on"):
        lay_out([wanted()], [], display=":0")


def test_four_quarter_turns_are_none() -> None:
    for angle, (a, b, c, d) in TURNS.items():
        assert (a * d - b * c, a * a + b * b) == (1, 1)
        twice = (a * a + b * c, a * b + b * d, c * a + d * c, c * b + d * d)
        assert twice == TURNS[2 * angle % 360]
