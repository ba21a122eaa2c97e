"""Test patterns: what they promise about pixels, and that they run on from panel to panel."""

from __future__ import annotations

from pathlib import Path
from typing import get_args

import numpy as np
import pytest
from numpy.typing import NDArray

from wall.config.loading import load
from wall.config.screens import GridConfig, WallConfig
from wall.core.colour import srgb_decoded
from wall.display.patterns import KINDS, Kind, pattern
from wall.display.patterns.draw import CYAN, FAINT, GREEN, PLAIN, fitting_size, size_of
from wall.display.patterns.gamma import CURVES, dither, gamma
from wall.display.patterns.unfolding import round_number, unfold
from wall.geometry.expanding import expand, wall_of
from wall.geometry.panels import Wall

CONFIGS = Path(__file__).parents[3] / "configs"
RGB = NDArray[np.uint8]


def grid_wall(columns: int, rows: int, pixels: tuple[int, int], *, bezel: float = 0.0) -> Wall:
    size = (pixels[0] / 1000, pixels[1] / 1000)
    return expand(WallConfig(grid=GridConfig(columns=columns, rows=rows, pixels=pixels, size=size, bezel=bezel)))


def whole(kind: Kind, wall: Wall) -> RGB:
    """All panels at their positions in the virtual screen, black between them."""
    screen = np.zeros((wall.height, wall.width, 3), np.uint8)
    for panel in wall.panels:
        (x, y), (w, h) = panel.screen, panel.pixels
        screen[y : y + h, x : x + w] = pattern(kind, panel, wall)
    return screen


def of_colour(image: RGB, colour: tuple[int, int, int]) -> NDArray[np.bool_]:
    return np.asarray((image == colour).all(axis=2))


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", ["demo", "cave_corner", "one_panel"])
def test_every_pattern_has_the_panels_pixels_and_is_made_the_same_again(kind: Kind, name: str) -> None:
    wall = expand(load(CONFIGS / f"{name}.yaml").config.wall)
    for panel in wall.panels:
        image = pattern(kind, panel, wall, [("host", "node3")])
        assert (image.shape, image.dtype) == ((panel.pixels[1], panel.pixels[0], 3), np.uint8)
        np.testing.assert_array_equal(image, pattern(kind, panel, wall, [("host", "node3")]))
        assert image.std() > 5
    assert get_args(Kind) == KINDS


@pytest.mark.parametrize("pixels", [(40, 30), (13, 200), (1, 1)])
def test_the_smallest_panels_have_patterns_too(pixels: tuple[int, int]) -> None:
    wall = grid_wall(2, 1, pixels)
    for kind in KINDS:
        assert pattern(kind, wall.panels[1], wall, [("host", "a" * 200)]).shape == (pixels[1], pixels[0], 3)


def test_grid_lines_are_one_pixel_and_a_round_number_of_metres_apart() -> None:
    wall = grid_wall(2, 1, (400, 300), bezel=0.0125)
    assert unfold(wall.panels[0], wall).step == pytest.approx(0.02)  # 20 pixels of a millimetre
    image = whole("grid", wall)
    row = image[np.flatnonzero(~of_colour(image, FAINT)[:, 200:210].any(axis=1))[40]]
    lines = np.flatnonzero((row == FAINT).all(axis=1) | (row == PLAIN).all(axis=1))
    gaps = np.diff(lines)
    assert gaps.min() == 20  # never two beside each other
    assert np.all(np.isin(gaps % 20, 0))  # whole steps also where figures or the bezel hide some


def test_the_outermost_pixels_of_every_panel_are_marked() -> None:
    wall = grid_wall(2, 2, (90, 70))
    for panel in wall.panels:
        image = pattern("grid", panel, wall)
        border = np.ones((70, 90), bool)
        border[1:-1, 1:-1] = False
        np.testing.assert_array_equal(of_colour(image, GREEN), border)


def test_diagonals_run_straight_over_all_panels_and_their_bezels() -> None:
    wall = grid_wall(3, 2, (200, 150), bezel=0.008)
    ys, xs = np.nonzero(of_colour(whole("grid", wall), CYAN))
    # From corner to corner: y = x * h / w, or its mirror image; FIGURE_PX is 1.6, so full colour is within 0.3 pixels.
    slope = wall.height / wall.width
    lean = np.hypot(slope, 1.0)
    down = np.abs((ys + 0.5) - (xs + 0.5) * slope) / lean
    up = np.abs((ys + 0.5) - (wall.width - (xs + 0.5)) * slope) / lean
    assert np.minimum(down, up).max() <= 0.3 + 1e-6
    for panel in wall.panels:  # both cross the wall's left and right panels; the middle ones have at least one
        (x, y), (w, h) = panel.screen, panel.pixels
        assert np.any((xs >= x) & (xs < x + w) & (ys >= y) & (ys < y + h))


def test_panels_without_bezels_share_the_sheet_of_one_large_panel() -> None:
    parts, entire = grid_wall(2, 1, (200, 300)), grid_wall(1, 1, (400, 300))
    whole = unfold(entire.panels[0], entire).positions()
    for k in (0, 1):
        both = [np.broadcast_to(unfold(panel, parts).positions()[k], (300, 200)) for panel in parts.panels]
        np.testing.assert_allclose(np.hstack(both), np.broadcast_to(whole[k], (300, 400)), atol=1e-12)


def test_hairlines_go_on_at_the_other_side_of_a_seam() -> None:
    wall = grid_wall(2, 1, (200, 300))
    left, right = (pattern("seam", panel, wall).astype(int) for panel in wall.panels)
    inked = [np.flatnonzero(image[1:-1, column].max(axis=1) > 90) for image, column in ((left, -2), (right, 1))]
    assert len(inked[0]) >= 15  # one line each 20 pixels, and slanted ones
    apart = np.abs(inked[0][:, None] - inked[1]).min(axis=1)
    assert np.mean(apart == 0) > 0.5  # level ones
    assert apart.max() <= 1  # slanted ones fall by three quarters of a pixel over the two columns between


def test_circles_are_round_in_metres_where_pixels_are_not_square() -> None:
    wall = expand(WallConfig(grid=GridConfig(columns=1, rows=1, pixels=(400, 150), size=(0.4, 0.3))))
    image = pattern("grid", wall.panels[0], wall)
    white = (image > 200).all(axis=2)
    ys, xs = np.nonzero(white)
    across, along = (xs.max() - xs.min()) * 0.001, (ys.max() - ys.min()) * 0.002
    assert across == pytest.approx(0.21, abs=0.004)  # twice 0.35 of the shorter side
    assert along == pytest.approx(0.21, abs=0.004)


def test_curved_panels_are_unrolled_as_long_as_their_arcs() -> None:
    wall = wall_of(load(CONFIGS / "walls" / "cylinder.yaml"))
    first, last = (unfold(wall.panels[k], wall) for k in (0, 4))
    across = last.at(320, 0) - first.at(0, 0)
    np.testing.assert_allclose(across, [np.radians(150) * 2.4, 0.0], atol=1e-9)
    np.testing.assert_allclose(first.at(0, 384) - first.at(0, 0), [0.0, 1.5], atol=1e-9)


def test_panels_at_angles_are_unfolded_with_no_gap_at_their_folds() -> None:
    wall = expand(load(CONFIGS / "cave_corner.yaml").config.wall)
    left, front = (unfold(wall.panels[k], wall) for k in (0, 1))
    np.testing.assert_allclose(left.at(320, 100), front.at(0, 100), atol=1e-6)


@pytest.mark.parametrize("share", [0.0, 0.25, 0.5, 0.75, 1.0])
def test_dithers_have_the_light_that_they_stand_for(share: float) -> None:
    assert dither(np.full((32, 48), share)).mean() == 255 * share


def test_the_smooth_ramp_and_the_dithered_one_have_the_same_light() -> None:
    image = gamma(1024, 270)
    smooth = srgb_decoded(image[:8, :, 0] / 255.0).reshape(8, 64, 16).mean(axis=(0, 2))
    dithered = (image[32:48, :, 0] / 255.0).reshape(16, 64, 16).mean(axis=(0, 2))
    assert np.abs(smooth - dithered).max() < 1 / 64 + 1 / 510  # a dither's step, and an 8-bit value's


def test_the_patch_marked_srgb_is_as_bright_as_the_dither_around_it() -> None:
    image, columns = gamma(1400, 900), 7
    k = list(CURVES).index("sRGB")
    for row, share in ((3, 0.25), (4, 0.5), (5, 0.75)):
        y, x = 100 * row + 50, 1400 // columns * k + 100
        assert srgb_decoded(image[y, x, :1] / 255.0)[0] == pytest.approx(share, abs=0.004)  # half an 8-bit step


def test_identify_says_what_it_was_told() -> None:
    """Rows appear as ink: each adds some, and two texts give two images."""
    wall = grid_wall(1, 1, (640, 360))
    plain, told, other = (
        pattern("identify", wall.panels[0], wall, about)
        for about in ([], [("host", "node3"), ("display", ":0.1")], [("host", "node4"), ("display", ":0.1")])
    )
    assert (told > 100).sum() > (plain > 100).sum()
    assert (told != other).any()


def test_letters_fit_their_room_and_steps_are_round() -> None:
    for text in ("r0c0", "row12-column31", "i"):
        assert size_of(text, fitting_size(text, (300, 80)))[0] <= 300
    assert [round_number(x) for x in (0.9, 1.3, 1.5, 4.0, 0.03, 70.0)] == pytest.approx([1, 1, 2, 5, 0.02, 50])
