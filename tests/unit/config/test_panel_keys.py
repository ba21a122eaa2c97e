"""What panels and grids may say, and how they are told that they may not."""

from __future__ import annotations

from typing import Any

import pytest

from wall.config import yaml_text
from wall.config.displays import BlendConfig, SidesConfig, WarpFileConfig
from wall.config.loading import dump, loads
from wall.config.schema import Config
from wall.core.errors import ConfigError
from wall.operators.warp import Mesh

CORNERS = {"lower_left": [0, 0, 0], "lower_right": [0.4, 0, 0], "upper_left": [0, 0.3, 0]}


def text_of(wall: dict[str, Any], **view: Any) -> str:
    values = {"version": 1, "scene": {"source": "courtyard"}, "wall": wall, "views": [{"id": "main", **view}]}
    return yaml_text.write(values)


def panel_text(**keys: Any) -> str:
    return text_of({"panels": [{"id": "a", "pixels": [40, 30], "corners": CORNERS, **keys}]})


def grid_text(**keys: Any) -> str:
    return text_of({"grid": {"columns": 2, "rows": 1, "pixels": [40, 30], "size": [0.4, 0.3], **keys}})


def config_of(text: str) -> Config:
    config = loads(text).config
    assert loads(dump(config)).config == config
    return config


def refusal(text: str) -> str:
    with pytest.raises(ConfigError) as caught:
        loads(text, name="a.yaml")
    message = str(caught.value)
    assert message.startswith("a.yaml:")
    assert len(message.splitlines()) == 1
    return message


def test_everything_a_panel_may_say_is_kept() -> None:
    warp = {"columns": 2, "rows": 2, "points": [[0, 0], [1, 0.01], [0, 1], [0.99, 1]]}
    config = config_of(
        panel_text(
            rotation=90,
            overlap={"left": 0.05},
            eye=[0.1, 0.2, 2.0],
            stereo="left",
            colour={"gain": 0.9, "gamma": 1.1, "lut": "left.cube"},
            blend="auto",
            warp=warp,
            host="node3",
            display=":0.1",
            monitor="HDMI-1",
            window={"x": 10, "y": 20, "width": 40, "height": 30},
            refresh_hz=24,
        )
    )
    assert config.wall.panels is not None
    (panel,) = config.wall.panels
    assert panel.rotation == 90
    assert panel.overlap == SidesConfig(left=0.05)
    assert panel.colour is not None
    assert panel.colour.gain == (0.9, 0.9, 0.9)
    assert panel.blend == "auto"
    assert isinstance(panel.warp, Mesh)
    assert (panel.host, panel.display, panel.monitor, panel.refresh_hz) == ("node3", ":0.1", "HDMI-1", 24)


def test_monitor_is_an_index_or_a_name_and_a_warp_may_be_a_file() -> None:
    config = config_of(panel_text(monitor=1, warp={"file": "mesh.yaml"}, blend={"left": 0.1, "gamma": 2.0}))
    assert config.wall.panels is not None
    (panel,) = config.wall.panels
    assert panel.monitor == 1
    assert panel.warp == WarpFileConfig(file="mesh.yaml")
    assert panel.blend == BlendConfig(left=0.1, gamma=2.0)


def test_view_has_its_eye_separation_and_scale() -> None:
    wall = {"grid": {"columns": 1, "rows": 1, "pixels": [4, 3], "size": [0.4, 0.3]}}
    assert config_of(text_of(wall)).views[0].eye_separation == 0.065
    view = config_of(text_of(wall, eye_separation=0.07, scale=12.5)).views[0]
    assert (view.eye_separation, view.scale) == (0.07, 12.5)
    assert "views[0].scale = 0: is too small" in refusal(text_of(wall, scale=0))


@pytest.mark.parametrize(
    ("keys", "expected"),
    [
        ({"rotation": 45}, "wall.panels[0].rotation = 45: is not one of the choices; accepted: 0, 90, 180, 270"),
        ({"stereo": "lft"}, "stereo = 'lft': is not one of the choices; accepted: mono, left, right, side_by_side"),
        ({"pixels": [41, 30], "stereo": "side_by_side"}, "wall.panels[0].pixels[0] = 41: cannot be halved"),
        ({"pixels": [40, 31], "stereo": "top_bottom"}, "wall.panels[0].pixels[1] = 31: cannot be halved"),
        ({"rotation": 90, "stereo": "side_by_side"}, "rotation = 90: a turned display cannot hold both eyes"),
        ({"overlap": 0.5}, "wall.panels[0].overlap = 0.5: is wider than the panel itself; accepted: at most 0.4 m"),
        ({"bezel": 0.01, "overlap": {"top": 0.1}}, "overlap.top = 0.1: neighbours cannot light what a frame hides"),
        ({"blend": "sometimes"}, "blend = 'sometimes': is not one of the choices; accepted: none, auto"),
        ({"blend": {"left": -1}}, "wall.panels[0].blend.left = -1: is too small; accepted: a number from 0"),
        ({"blend": {"lft": 1}}, "blend.lft: unknown key; accepted: left, right, top, bottom, gamma; did you mean left"),
        ({"blend": {"right": 1.0}}, "wall.panels[0].blend: is wider than the panel itself"),
        ({"warp": {"columns": 2, "rows": 2, "points": [[0, 0]] * 5}}, "5 points for 2 x 2 nodes; accepted: 4 points"),
        ({"warp": {"columns": 2, "rows": 1, "points": [[0, 0]] * 4}}, "warp.rows = 1: is too small"),
        (
            {"warp": {"columns": 2, "rows": 2, "points": [[0, 9], [1, 0], [0, 1], [1, 1]]}},
            "warp.points[0][1] = 9: is too large",
        ),
        ({"warp": {"file": "a.yaml", "rows": 2}}, "warp.rows: unknown key; accepted: file"),
        ({"monitor": -1}, "wall.panels[0].monitor = -1: is too small; accepted: a whole number from 0 to 255"),
        ({"monitor": 1.5}, "wall.panels[0].monitor = 1.5"),
        ({"window": {"x": 0, "height": 4}}, "wall.panels[0].window.width: is missing"),
        ({"refresh_hz": 0}, "refresh_hz = 0: is too small; accepted: a number from 0.1 to 1000"),
        ({"colour": {"gain": [1, 2]}}, "wall.panels[0].colour.gain[2]: is missing"),
        ({"colour": {"gamma": "2"}}, "wall.panels[0].colour.gamma = '2': is not a number"),
        ({"eye": [0, 0]}, "wall.panels[0].eye[2]: is missing"),
        ({"color": {}}, "wall.panels[0].color: unknown key; accepted: id, pixels, corners"),
    ],
)
def test_what_a_panel_cannot_be_is_refused(keys: dict[str, Any], expected: str) -> None:
    assert expected in refusal(panel_text(**keys))


@pytest.mark.parametrize(
    ("keys", "expected"),
    [
        ({"overlap": 0.3}, "wall.grid.overlap = 0.3: is wider than half a panel; accepted: at most 0.2 m"),
        ({"overlap": [0, 0.2]}, "wall.grid.overlap = [0, 0.2]: is wider than half a panel; accepted: at most 0.2 m"),
        ({"overlap": [0.01, 0], "bezel": 0.01}, "panels with a frame between them cannot light the same area"),
        ({"stereo": "side_by_side", "pixels": [41, 30]}, "wall.grid.pixels[0] = 41: cannot be halved for two eyes"),
        ({"columns": 256, "rows": 4, "stereo": "top_bottom"}, "256 x 4 panels for two eyes are too many"),
        ({"id": "a" * 60, "columns": 1, "stereo": "top_bottom"}, "gives the id 'aaaa"),
        ({"warp": {"file": "x"}}, "wall.grid.warp: unknown key"),
    ],
)
def test_what_a_grid_cannot_be_is_refused(keys: dict[str, Any], expected: str) -> None:
    assert expected in refusal(grid_text(**keys))


def test_bezels_are_hidden_or_skipped_and_nothing_else() -> None:
    wall = {"bezel": "show", "grid": {"columns": 1, "rows": 1, "pixels": [4, 3], "size": [0.4, 0.3]}}
    assert "wall.bezel = 'show': is not one of the choices; accepted: hide, skip" in refusal(text_of(wall))


@pytest.mark.parametrize("other", ["a.left", "a"])
def test_eye_of_a_panel_that_holds_both_needs_an_id_of_its_own(other: str) -> None:
    first = {"id": "a", "pixels": [40, 30], "corners": CORNERS, "stereo": "side_by_side"}
    wall = {"panels": [first, {**first, "id": other, "stereo": "mono"}]}
    assert "wall.panels[1].id" in refusal(text_of(wall))


def test_id_that_its_eyes_make_too_long_is_refused() -> None:
    assert "accepted: 58 letters" in refusal(panel_text(id="a" * 59, stereo="top_bottom"))
