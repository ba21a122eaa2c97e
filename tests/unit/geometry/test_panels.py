"""Panels stand where the configuration puts them, in metres and in the virtual screen."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.testing import assert_allclose

from wall.config.displays import SidesConfig
from wall.config.screens import CornersConfig, GridConfig, PanelConfig, WallConfig
from wall.geometry.expanding import expand
from wall.geometry.panels import Wall

ROUNDING = 1e-12  # metres; float64 sums of a few numbers near 1


def grid(**changes: object) -> Wall:
    values: dict[str, object] = {"columns": 3, "rows": 2, "pixels": (480, 270), "size": (0.48, 0.27), "bezel": 0.012}
    return expand(WallConfig(grid=GridConfig.model_validate({**values, **changes})))


def panel(name: str, lower_left: tuple[float, float, float], *, angle: float = 0.0, **changes: object) -> PanelConfig:
    """A 0.4 x 0.3 m panel of 40 x 30 pixels, turned about y by an angle (degrees)."""
    x, y, z = lower_left
    right = (x + 0.4 * math.cos(math.radians(angle)), y, z + 0.4 * math.sin(math.radians(angle)))
    corners = CornersConfig(lower_left=lower_left, lower_right=right, upper_left=(x, y + 0.3, z))
    values: dict[str, object] = {"id": name, "pixels": (40, 30), "corners": corners, **changes}
    return PanelConfig.model_validate(values)


def test_grid_runs_row_by_row_from_the_top_left_with_bezel_gaps() -> None:
    wall = grid()

    assert [p.id for p in wall.panels] == ["r0c0", "r0c1", "r0c2", "r1c0", "r1c1", "r1c2"]
    assert [p.index for p in wall.panels] == list(range(6))
    assert [p.screen for p in wall.panels] == [(0, 0), (504, 0), (1008, 0), (0, 294), (504, 294), (1008, 294)]
    assert (wall.width, wall.height) == (1488, 564)
    assert wall.flat


def test_grid_has_its_centre_at_the_origin() -> None:
    wall = grid()

    corners = np.concatenate([p.corners for p in wall.panels])

    assert_allclose(corners.min(axis=0), [-0.744, -0.282, 0], atol=ROUNDING)
    assert_allclose(corners.max(axis=0), [0.744, 0.282, 0], atol=ROUNDING)


def test_lit_areas_of_a_grid_are_two_bezels_apart() -> None:
    left, right = grid().panels[:2]

    assert_allclose(right.corners[0] - left.corners[1], [0.024, 0, 0], atol=ROUNDING)


def test_bezels_are_rounded_to_whole_pixels_and_corners_follow() -> None:
    wall = grid(bezel={"left": 0.0, "right": 0.0013, "top": 0.0, "bottom": 0.0})  # 1.3 pixels

    assert wall.panels[1].screen == (481, 0)
    assert_allclose(wall.panels[1].corners[0] - wall.panels[0].corners[1], [0.001, 0, 0], atol=ROUNDING)
    assert wall.panels[3].screen == (0, 270)


def test_panels_of_a_grid_share_one_plane() -> None:
    assert len({id(p.plane) for p in grid().panels}) == 1


def test_corners_are_the_plane_s_points_of_the_panel_s_pixels() -> None:
    for p in grid().panels:
        (x, y), (w, h) = p.screen, p.pixels
        assert np.array_equal(p.corners, [p.plane.point(x, y + h), p.plane.point(x + w, y + h), p.plane.point(x, y)])


def test_single_panel_keeps_its_corners() -> None:
    config = panel("a", (0.1, 0.2, 0.3), angle=30, host="left-machine")

    (only,) = expand(WallConfig(panels=(config,))).panels

    expected = [config.corners.lower_left, config.corners.lower_right, config.corners.upper_left]
    assert_allclose(only.corners, expected, atol=ROUNDING)
    assert only.config.host == "left-machine"


def test_panels_in_one_plane_lie_as_they_stand() -> None:
    wall = expand(WallConfig(panels=(panel("a", (0, 0, 0)), panel("b", (0.42, -0.1, 0)), panel("c", (0, 0.35, 0)))))

    assert [p.screen for p in wall.panels] == [(0, 35), (42, 45), (0, 0)]
    assert (wall.width, wall.height) == (82, 75)
    assert wall.flat


def test_panels_at_an_angle_stand_side_by_side_with_their_bezels_between() -> None:
    bezel = SidesConfig(left=0.01, right=0.03)

    wall = expand(WallConfig(panels=(panel("a", (0, 0, 0), bezel=bezel), panel("b", (1, 0, 0), angle=60, bezel=bezel))))

    assert [p.screen for p in wall.panels] == [(0, 0), (44, 0)]
    assert not wall.flat


@pytest.mark.parametrize("other", [(0.1, 0.1, 0.0), (50.0, 0.0, 0.0), (0.4, 0.0, 0.1)])
def test_panels_that_overlap_or_stand_far_apart_or_behind_lie_side_by_side(other: tuple[float, float, float]) -> None:
    wall = expand(WallConfig(panels=(panel("a", (0, 0, 0)), panel("b", other))))

    assert [p.screen for p in wall.panels] == [(0, 0), (40, 0)]
    assert_allclose(wall.panels[1].corners[0], other, atol=ROUNDING)


def test_panels_of_different_pitch_do_not_overlap_in_the_image() -> None:
    fine = panel("fine", (0.4, 0, 0), pixels=(400, 300))

    wall = expand(WallConfig(panels=(panel("coarse", (0, 0, 0)), fine)))

    assert wall.panels[1].screen[0] >= 40


def test_the_face_behind_a_coarse_panel_begins_where_that_panel_ends_in_the_image() -> None:
    fine, coarse = panel("fine", (0, 0, 0), pixels=(400, 300)), panel("coarse", (0.4, 0, 0))

    wall = expand(WallConfig(panels=(fine, coarse, panel("turned", (0.8, 0, 0), angle=60))))

    assert [p.screen[0] for p in wall.panels] == [0, 400, 800]  # ten pixels of the fine one to each of the coarse one


def test_wall_of_panels_that_face_other_ways_is_not_flat() -> None:
    turned = panel("b", (0.8, 0, 0), angle=180)  # same plane, its face behind

    assert not expand(WallConfig(panels=(panel("a", (0, 0, 0)), turned))).flat


def test_panel_is_found_by_its_id() -> None:
    wall = grid()

    assert wall.panel("r1c2").index == 5
    with pytest.raises(KeyError):
        wall.panel("r9c9")


@pytest.mark.parametrize(
    ("changes", "size"),
    [
        ({"columns": 1, "rows": 2}, (0.48, 0.564)), ({}, (1.488, 0.564)), ({"bezel": 0.0}, (1.44, 0.54)),
        ({"columns": 2, "rows": 1, "bezel": 0.0, "overlap": (0.048, 0.0)}, (0.912, 0.27)),
    ],
)  # fmt: skip
def test_a_flat_wall_extends_over_its_panels_and_the_gaps_between(
    changes: dict[str, object], size: tuple[float, float]
) -> None:
    assert_allclose(grid(**changes).extent, size, atol=ROUNDING)


def test_a_wall_of_two_faces_extends_over_the_lengths_of_both() -> None:
    """Two columns at a right angle, two panels of 0.3 m each with a gap of 0.1 m."""
    panels = tuple(
        panel(f"p{k}{row}", at, angle=angle)
        for k, (at, angle) in enumerate((((0.0, 0.0, 0.0), 0.0), ((0.4, 0.0, 0.0), 90.0)))
        for row, at in enumerate((at, (at[0], 0.4, at[2])))
    )
    assert_allclose(expand(WallConfig(panels=panels)).extent, (0.8, 0.7), atol=ROUNDING)
