"""Shorthand is written out exactly: grids with gaps and overlaps, two eyes in one image, frames that are skipped."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from wall.config.displays import BlendConfig, SidesConfig, WindowConfig
from wall.config.loading import loads
from wall.config.yaml_text import write
from wall.geometry.expanding import expand, expanded_config
from wall.geometry.panels import Panel, Wall

ROUNDING = 1e-14  # metres; float64 at 1 m leaves 2e-16
SEAM = 1e-12  # of a ray's length


def wall_of(**keys: Any) -> Wall:
    return expand(loads(text_of(**keys)).config.wall)


def text_of(**keys: Any) -> str:
    return write({"version": 1, "scene": {"source": "courtyard"}, "wall": keys, "views": [{"id": "main"}]})


def grid(**keys: Any) -> dict[str, Any]:
    return {"columns": 3, "rows": 2, "pixels": [480, 270], "size": [0.48, 0.27], **keys}


def panel(name: str, x: float, y: float, **keys: Any) -> dict[str, Any]:
    """0.4 x 0.3 m of 40 x 30 pixels, its lower left corner at (x, y, 0)."""
    w, h = keys.pop("size", (0.4, 0.3))
    corners = {"lower_left": [x, y, 0.0], "lower_right": [x + w, y, 0.0], "upper_left": [x, y + h, 0.0]}
    return {"id": name, "pixels": [40, 30], "corners": corners, **keys}


def test_projectors_of_a_grid_overlap_by_whole_pixels() -> None:
    wall = wall_of(grid=grid(overlap=[0.0483, 0.03]))  # 48.3 pixels

    assert [p.screen for p in wall.panels] == [(0, 0), (432, 0), (864, 0), (0, 240), (432, 240), (864, 240)]
    assert (wall.width, wall.height) == (1344, 510)
    assert len({id(p.plane) for p in wall.panels}) == 1
    assert_allclose(wall.panels[0].corners[1] - wall.panels[1].corners[0], [0.048, 0, 0], atol=ROUNDING)
    assert_allclose(
        [wall.panels[1].config.overlap.left, wall.panels[1].config.overlap.right, wall.panels[1].config.overlap.bottom],
        [0.048, 0.048, 0.03],
        atol=ROUNDING,
    )
    assert (wall.panels[1].config.overlap.top, wall.panels[0].config.overlap.left) == (0.0, 0.0)
    assert len(wall.overlaps) == 11  # 4 side by side, 3 above each other, 4 across
    assert all(overlap.allowed for overlap in wall.overlaps)


def test_ramps_of_a_grid_are_between_neighbours_and_as_wide_as_the_overlap_or_as_said() -> None:
    own = wall_of(grid=grid(overlap=0.03, blend="auto")).panels[0].blend
    said = wall_of(grid=grid(overlap=0.03, blend={"left": 0.02, "right": 0.02, "gamma": 2.0})).panels[0].blend

    assert own is not None
    assert (own.left, own.top, own.gamma) == (0.0, 0.0, 2.2)
    assert_allclose([own.right, own.bottom], [0.03, 0.03], atol=ROUNDING)
    assert said == BlendConfig(right=0.02, gamma=2.0)
    assert wall_of(grid=grid(overlap=0.03)).panels[0].blend is None


def test_skipped_bezels_leave_no_gap_and_pixels_span_them() -> None:
    bezel = {"left": 0.01, "right": 0.03, "top": 0.02, "bottom": 0.0}
    wall = wall_of(bezel="skip", grid=grid(bezel=bezel))
    first, second = wall.panels[:2]

    assert second.screen == (480, 0)
    assert wall.panels[3].screen == (0, 270)
    assert_allclose(first.pitch, [0.52 / 480, 0.29 / 270], rtol=1e-14)
    assert_allclose(second.corners[0], first.corners[1], atol=ROUNDING)  # what they show meets
    assert_allclose(first.lit[1] - first.lit[0], [0.48, 0, 0], atol=ROUNDING)
    assert_allclose(first.lit[0] - first.corners[0], [0.01, 0, 0], atol=ROUNDING)
    assert_allclose(first.corners[2] - first.lit[2], [-0.01, 0.02, 0], atol=ROUNDING)
    assert_allclose(second.lit[0] - first.lit[1], [0.04, 0, 0], atol=ROUNDING)


def test_hidden_bezels_leave_the_lit_area_as_it_is() -> None:
    first, second = wall_of(grid=grid(bezel=0.01)).panels[:2]

    assert second.screen == (500, 0)
    assert np.array_equal(first.lit, first.corners)


@pytest.mark.parametrize("bezel", ["hide", "skip"])
@pytest.mark.parametrize(
    "keys",
    [
        {},
        {"bezel": 0.0137},
        {"bezel": {"left": 0.02, "right": 0.001, "top": 0.0, "bottom": 0.011}},
        {"overlap": [0.1, 0.05]},
        {"bezel": 0.0137, "stereo": "side_by_side"},
        {"overlap": 0.0333, "stereo": "top_bottom", "blend": "auto"},
        {"size": [1.0 / 3.0, 0.7], "pixels": [482, 1000], "bezel": 0.3},
    ],
)
def test_grid_spelled_out_meets_pixel_for_pixel(keys: dict[str, Any], bezel: str) -> None:
    config = loads(text_of(bezel=bezel, grid=grid(**keys))).config.wall
    short, spelled = expand(config), expand(expanded_config(config))

    assert (short.width, short.height, short.faces) == (spelled.width, spelled.height, spelled.faces)
    for a, b in zip(short.panels, spelled.panels, strict=True):
        assert (a.id, a.pixels, a.screen, a.shift, a.blend) == (b.id, b.pixels, b.screen, b.shift, b.blend)
        for mine, theirs in zip(rays(a), rays(b), strict=True):
            assert_allclose(theirs, mine, rtol=0, atol=SEAM)
    for face in spelled.faces:  # bit for bit with each other
        assert len({id(spelled.panels[k].plane) for k in face}) == 1


def rays(p: Panel) -> list[Any]:
    """From an eye 1 m before the wall through the corners of four pixels, at the panel's own corners."""
    (x, y), (w, h) = p.screen, p.pixels
    return [p.plane.point(x + i, y + j) - np.array([0.1, 0.2, 1.0]) for i, j in ((0, 0), (w, 0), (0, h), (w, h))]


def test_panels_one_by_one_on_one_grid_of_pixels_share_a_plane_and_others_do_not() -> None:
    wall = wall_of(panels=[panel("a", 0, 0), panel("b", 0.42, 0.03), panel("c", 0.84003, 0), panel("d", 1.263, 0)])
    a, b, c, d = wall.panels

    assert b.plane is a.plane  # 2 pixels to the right, 3 up
    assert c.plane is a.plane  # but for 0.003 pixels
    assert_allclose(c.corners[0], [0.84, 0, 0], atol=ROUNDING)  # which is the stated bound: ON_GRID of a pixel
    assert d.plane is not a.plane  # 0.3 pixels off: it keeps its own corners
    assert_allclose(d.corners[0], [1.263, 0, 0], atol=ROUNDING)


def test_two_eyes_in_one_image_are_two_panels_with_the_same_corners() -> None:
    wall = wall_of(panels=[panel("a", 0, 0, stereo="side_by_side", display=":0.1"), panel("b", 0.4, 0, stereo="left")])
    left, right, alone = wall.panels

    assert [p.id for p in wall.panels] == ["a.left", "a.right", "b"]
    assert [p.of for p in wall.panels] == ["a", "a", "b"]
    assert [p.at for p in wall.panels] == [(0, 0), (20, 0), (0, 0)]
    assert [p.shift for p in wall.panels] == [-0.5, 0.5, -0.5]
    assert left.pixels == right.pixels == (20, 30)
    assert_allclose(left.corners, right.corners, atol=ROUNDING)
    assert [panel.config.window for panel in (left, right)] == [None, None]  # both fill what the panel fills
    assert alone.screen == (40, 0)  # beside a.left, whose eye it shares; its pixels are half as wide
    assert wall.faces == ((0, 2), (1,))
    assert not wall.overlaps


def test_eyes_above_each_other_share_the_window_that_is_given() -> None:
    window = {"x": 100, "y": 50, "width": 40, "height": 31}
    left, right = wall_of(panels=[panel("a", 0, 0, stereo="top_bottom", window=window)]).panels

    assert left.pixels == right.pixels == (40, 15)
    assert right.at == (0, 15)
    assert left.config.window == right.config.window == WindowConfig(**window)


def test_eyes_written_as_panels_of_their_own_have_their_parts_of_the_window() -> None:
    window = {"x": 100, "y": 50, "width": 40, "height": 31}
    two = [panel("a", 0, 0, stereo="top_bottom", window=window), panel("b", 0.4, 0, stereo="side_by_side")]
    windows = [each.window for each in expanded_config(loads(text_of(panels=two)).config.wall).panels or ()]

    assert windows == [
        WindowConfig(x=100, y=50, width=40, height=15),
        WindowConfig(x=100, y=65, width=40, height=16),
        WindowConfig(x=0, y=0, width=20, height=30),
        WindowConfig(x=20, y=0, width=20, height=30),
    ]


def test_walls_of_each_eye_stand_beside_each_other_in_the_image() -> None:
    wall = wall_of(grid=grid(bezel=0.01, stereo="top_bottom"))

    assert (wall.width, wall.height) == (1480 + 20 + 1480, 2 * 135 + 10)  # two bezels between the eyes' walls
    assert [p.screen for p in wall.panels[:4]] == [(0, 0), (1500, 0), (500, 0), (2000, 0)]
    assert_allclose(wall.panels[1].corners, wall.panels[0].corners, atol=ROUNDING)


def test_patterns_name_machines_displays_and_monitors() -> None:
    wall = wall_of(
        grid=grid(host="node{row}", display=":0.{column}", monitor="DP-{column}", refresh_hz=24, rotation=90)
    )
    last = wall.panels[-1].config

    assert (last.host, last.display, last.monitor, last.refresh_hz, last.rotation) == ("node1", ":0.2", "DP-2", 24, 90)


def test_panels_of_several_planes_stand_face_by_face() -> None:
    side = {"lower_left": [0.8, 0, 0], "lower_right": [0.8, 0, 0.4], "upper_left": [0.8, 0.3, 0]}
    turned = {"id": "c", "pixels": [40, 30], "corners": side}

    wall = wall_of(panels=[panel("a", 0, 0), turned, panel("b", 0.4, 0)])

    assert wall.faces == ((0, 2), (1,))
    assert [p.screen for p in wall.panels] == [(0, 0), (80, 0), (40, 0)]
    assert wall.panels[2].plane is wall.panels[0].plane


@pytest.mark.parametrize(("declared", "allowed"), [(0.05, True), (0.046, True), (0.04, False), (0.0, False)])
def test_overlap_is_allowed_as_far_as_both_declare_it_to_half_a_pixel(declared: float, allowed: bool) -> None:
    sides = SidesConfig(right=declared, left=declared).model_dump()
    wall = wall_of(panels=[panel("a", 0, 0, overlap=sides), panel("b", 0.35, 0, overlap=sides)])
    (overlap,) = wall.overlaps

    assert overlap.allowed is allowed
    assert_allclose(overlap.size, (0.05, 0.3), atol=ROUNDING)
    assert wall.panels[1].screen == ((35, 0) if allowed else (40, 0))


def test_overlap_that_one_of_two_declares_is_not_allowed() -> None:
    wall = wall_of(panels=[panel("a", 0, 0, overlap=0.1), panel("b", 0.35, 0)])

    assert not wall.overlaps[0].allowed


def test_panels_of_different_eyes_may_stand_in_the_same_place() -> None:
    wall = wall_of(panels=[panel("a", 0, 0), panel("b", 0, 0, eye=[0, 0, 3])])

    assert wall.overlaps == ()
    assert wall.panels[1].screen == (40, 0)


def test_grid_with_gaps_wider_than_its_panels_lies_as_it_stands() -> None:
    wall = wall_of(grid=grid(pixels=[4, 3], size=[0.04, 0.03], bezel=0.03))

    assert [p.screen for p in wall.panels[:2]] == [(0, 0), (10, 0)]


METRES = st.floats(1e-3, 5.0)


@st.composite
def grids(draw: st.DrawFn) -> dict[str, Any]:
    """Any grid that the schema takes, and some that it does not."""
    size = [draw(METRES), draw(METRES)]
    stereo = draw(st.sampled_from(["mono", "left", "side_by_side", "top_bottom"]))
    pixels = [2 * draw(st.integers(1, 40)), 2 * draw(st.integers(1, 40))]
    keys = {"columns": draw(st.integers(1, 3)), "rows": draw(st.integers(1, 3)), "pixels": pixels, "size": size}
    if draw(st.booleans()):
        overlap = [draw(st.floats(0, 0.5)) * side for side in size]
        return {**keys, "stereo": stereo, "overlap": overlap, "blend": "auto"}
    sides = ("left", "right", "top", "bottom")
    bezel = {side: draw(st.floats(0, 1)) * size[k // 2] for k, side in enumerate(sides)}
    return {**keys, "stereo": stereo, "bezel": bezel}


@settings(max_examples=80, deadline=None, derandomize=True)
@given(grids(), st.sampled_from(["hide", "skip"]))
def test_any_grid_spelled_out_in_yaml_is_the_same_wall(keys: dict[str, Any], bezel: str) -> None:
    config = loads(text_of(bezel=bezel, grid=keys)).config.wall
    short = expand(config)
    values = expanded_config(config).model_dump(mode="json", exclude_none=True, exclude_defaults=True)

    spelled = expand(loads(text_of(**values)).config.wall)

    assert all(overlap.allowed for overlap in short.overlaps)
    assert [o.allowed for o in short.overlaps] == [o.allowed for o in spelled.overlaps]
    if short.width * short.height > 4 * sum(p.pixels[0] * p.pixels[1] for p in short.panels):
        return  # gaps wider than panels: one by one they stand beside each other
    assert (short.width, short.height, short.faces) == (spelled.width, spelled.height, spelled.faces)
    for a, b in zip(short.panels, spelled.panels, strict=True):
        assert (a.id, a.screen, a.pixels) == (b.id, b.screen, b.pixels)
        assert_allclose((b.corners - a.corners)[:, :2] / a.pitch, 0.0, atol=1e-9)  # pixels
    assert len({id(p.plane) for p in spelled.panels}) == len(spelled.faces)
