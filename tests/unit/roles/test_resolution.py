"""Which resolution an image is made at: by the samples that come while the camera moves, by time where it stands."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import pytest

from wall.config.screens import GridConfig, WallConfig
from wall.geometry.expanding import expand
from wall.geometry.panels import Panel
from wall.geometry.scan import Scan
from wall.roles.resolution import (
    ENOUGH_STILL,
    FEWEST,
    LONGEST_STILL_S,
    POOR,
    RICH,
    ResolutionChoice,
    first_scale,
    scale_for,
)

REFRESH_S = 1.0 / 30.0


def panel_of(width: int, height: int) -> Panel:
    return expand(WallConfig(grid=GridConfig(columns=1, rows=1, pixels=(width, height), size=(1.0, 0.5)))).panels[0]


def moved(choice: ResolutionChoice, rates: list[float], pixels: int, *, begin: float = 0.0) -> list[int]:
    """The scales after half a second and more of each of these rates, samples a second for each pixel of the image."""
    scales, k = [], 0
    for rate in rates:
        for _ in range(17):
            choice.note(round(rate * pixels / choice.scale**2 * REFRESH_S))
            choice.after(begin + k * REFRESH_S, still=False, stored=0)
            k += 1
        scales.append(choice.scale)
    return scales


@pytest.mark.parametrize(
    ("pixels", "first", "coarsest"),
    [((480, 270), 1, 2), ((200, 200), 1, 1), ((960, 540), 2, 4), ((1920, 1080), 4, 8), ((3840, 2160), 8, 16)],
)
def test_images_begin_with_as_many_pixels_as_a_core_refreshes_in_time(
    pixels: tuple[int, int], first: int, coarsest: int
) -> None:
    panel = panel_of(*pixels)
    assert (first_scale(panel), scale_for(panel, FEWEST), ResolutionChoice(panel).scale) == (first, coarsest, first)


def test_few_samples_make_it_coarser_many_finer_and_between_nothing_changes() -> None:
    panel, pixels = panel_of(960, 540), 960 * 540
    assert moved(ResolutionChoice(panel), [POOR * 1.1, RICH * 0.9, POOR * 1.1], pixels) == [2, 2, 2]
    assert moved(ResolutionChoice(panel), [POOR * 0.9, POOR * 1.1], pixels) == [4, 4]
    assert moved(ResolutionChoice(panel), [RICH * 1.2, POOR * 1.1], pixels) == [1, 1]
    assert moved(ResolutionChoice(panel), [0.0, 0.0, 0.0], pixels) == [4, 4, 4], "no coarser than that"


def test_what_was_too_fine_is_not_tried_again_for_five_seconds() -> None:
    panel, pixels = panel_of(960, 540), 960 * 540
    scales = moved(ResolutionChoice(panel), [POOR * 0.9, *[RICH * 1.2] * 12], pixels)
    assert scales[:9] == [4] * 9
    assert scales[-1] < 4


def test_where_the_camera_stands_it_becomes_finer_to_the_last_pixel_and_is_coarse_again_once_that_moves() -> None:
    panel, pixels = panel_of(1920, 1080), 1920 * 1080
    choice = ResolutionChoice(panel)
    moved(choice, [POOR * 1.1], pixels)
    seen, now = [], 1.0
    while choice.scale > 1:
        now += REFRESH_S
        stored = int(ENOUGH_STILL * pixels) if now < 3.0 else 0  # then time alone says so
        seen.append((choice.after(now, still=True, stored=stored), now))
    changes = [now for (before, _), (after, now) in pairwise(seen) if after != before]
    assert next(scale for scale, _ in seen if scale < 4) == 2
    assert changes[0] - 1.0 < 1.0 < LONGEST_STILL_S
    assert now < 1.0 + 2 * LONGEST_STILL_S
    assert choice.after(now + REFRESH_S, still=False, stored=0) == 4, "that of the last image that moved"


def test_a_panel_that_is_lit_row_by_row_is_always_made_whole() -> None:
    scanned = replace(panel_of(1920, 1080), scan=Scan(first=0.0, per_x=0.0, per_y=1e-5))
    assert first_scale(scanned) == scale_for(scanned, 1) == 1
