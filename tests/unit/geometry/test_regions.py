"""Regions cover every panel exactly, with nearly equal areas."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from wall.config.screens import GridConfig, WallConfig
from wall.core.data import Rect
from wall.core.errors import ConfigError
from wall.geometry.expanding import expand
from wall.geometry.panels import Wall
from wall.geometry.regions import MAX_EDGE, panel_regions, split


def a_wall(columns: int, pixels: tuple[int, int]) -> Wall:
    return expand(WallConfig(grid=GridConfig(columns=columns, rows=1, pixels=pixels, size=(1.0, 1.0))))


@settings(max_examples=200, deadline=None, derandomize=True)
@given(st.integers(1, 40), st.integers(1, 40), st.integers(0, 9), st.integers(0, 9), st.data())
def test_parts_cover_every_pixel_once(width: int, height: int, x: int, y: int, data: st.DataObject) -> None:
    n = data.draw(st.integers(1, width * height))

    parts = split(Rect(x=x, y=y, width=width, height=height), n)

    covered = np.zeros((y + height, x + width), dtype=int)
    for part in parts:
        assert part.area > 0
        covered[part.y : part.y + part.height, part.x : part.x + part.width] += 1
    assert len(parts) == n
    assert (covered[y:, x:] == 1).all()
    assert covered.sum() == width * height


@pytest.mark.parametrize("n", range(1, 33))
def test_parts_of_a_panel_have_nearly_equal_areas(n: int) -> None:
    # at most five cuts, each off by at most half a pixel of an edge that is 45 pixels or more after it: 1.1 % each
    areas = [part.area for part in split(Rect(x=0, y=0, width=480, height=270), n)]

    assert max(areas) / min(areas) < 1.06


def test_parts_are_rather_square() -> None:
    for part in split(Rect(x=0, y=0, width=1920, height=1080), 8):
        assert max(part.width, part.height) / min(part.width, part.height) < 2.1


@pytest.mark.parametrize("n", [0, 7])
def test_more_parts_than_pixels_are_refused(n: int) -> None:
    with pytest.raises(ValueError, match="3 x 2 pixels cannot be cut"):
        split(Rect(x=0, y=0, width=3, height=2), n)


def test_region_too_large_for_the_wire_says_how_many_ranks_are_needed() -> None:
    wall = a_wall(1, (15360, 8640))

    with pytest.raises(
        ConfigError,
        match=r"panel r0c0 .15360 x 8640 pixels.*: 1 a region is larger than 4096 pixels; accepted: (.+) ranks",
    ) as caught:
        panel_regions(wall.panels[0], 1)

    needed = int(str(caught.value).split("accepted: ")[1].split()[0])
    for region in panel_regions(wall.panels[0], needed):
        assert max(region.width, region.height) <= MAX_EDGE


def test_more_ranks_than_pixels_are_refused() -> None:
    with pytest.raises(ConfigError, match="5 ranks are too many; accepted: up to 4"):
        panel_regions(a_wall(1, (2, 2)).panels[0], 5)
