"""Panels have fewer pixels where there are fewer cores than panels."""

from __future__ import annotations

from pathlib import Path

from wall.commands.fit import fitted, with_share
from wall.config.loading import Loaded, load
from wall.roles.plan import make_layout

CONFIGS = Path(__file__).parents[3] / "configs"


def test_a_demo_on_two_cores_has_half_of_its_pixels_and_says_so() -> None:
    loaded, said = fitted(load(CONFIGS / "demo.yaml"), 2)
    assert loaded.config.wall.grid is not None
    assert loaded.config.wall.grid.pixels == (336, 189)  # sqrt(1/2) of 480x270, in steps of 8 across
    assert make_layout(loaded).notes == (), "pixels are square"
    assert said.startswith("2 cores for 4 panels: each has 336x189 pixels, not 480x270;")


def test_a_wall_with_a_core_for_each_panel_or_without_a_grid_stays_as_it_is() -> None:
    for name, cores in (("demo.yaml", 4), ("cave_corner.yaml", 1)):
        loaded = load(CONFIGS / name)
        assert fitted(loaded, cores) == (loaded, "")


def test_each_panel_keeps_a_share_of_its_pixels_whether_in_a_grid_or_by_itself() -> None:
    for name in ("demo.yaml", "cave_corner.yaml"):
        before, after = (
            sum(w * h for w, h in pixels_of(loaded))
            for loaded in (load(CONFIGS / name), with_share(load(CONFIGS / name), 0.25))
        )
        assert 0.22 < after / before < 0.28


def pixels_of(loaded: Loaded) -> list[tuple[int, int]]:
    wall = loaded.config.wall
    return [panel.pixels for panel in wall.panels or ()] + ([wall.grid.pixels] if wall.grid is not None else [])
