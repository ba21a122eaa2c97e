"""`wall measure views`: copies of a view fill the wall, and what a view keeps is held against its weight."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from rich.console import Console

from wall.config.loading import load
from wall.core.errors import ConfigError
from wall.roles.plan import make_layout
from wall.study.live.rewriting import load_without_windows
from wall.study.live.views import Row, check_counts, first_alone, grid_of, report

MAP_INSET = Path(__file__).parents[3] / "configs/views/map_inset.yaml"
ROW = Row(
    config="map", method="framed", kind="alone", views=1, view="main", weight=1.0, refresh_hz=60.0,
    refreshes_per_s=60.0, samples_per_s=1e6, share=1.0, latency_p50_ms=20.0, latency_p95_ms=40.0, other_cores=0.0,
    commit="", machine="", command="",
)  # fmt: skip


@pytest.mark.parametrize("count", [1, 2, 3, 5, 8, 16])
def test_copies_of_a_view_fill_the_wall_and_are_of_about_one_size(count: int) -> None:
    layout = make_layout(grid_of(load(MAP_INSET), count))
    shown = {viewport.view for viewport in layout.wall.viewports if viewport.view >= 0}
    assert shown == set(range(count)), "and every pixel is somebody's, or the layout were refused"
    areas = [view.viewport.width * view.viewport.height for view in layout.config.views if view.viewport]
    assert max(areas) <= 2.0 * min(areas)


def test_the_first_view_alone_has_nothing_of_the_others() -> None:
    layout = make_layout(first_alone(load(MAP_INSET)))
    assert (len(layout.config.views), layout.wall.insets) == (1, ())


@pytest.mark.parametrize(
    ("samples", "refreshes", "word"), [(0.9e6, 57.0, "yes"), (0.85e6, 57.0, "MISSED"), (0.9e6, 51.0, "MISSED")]
)
def test_a_view_must_keep_what_its_weight_leaves(samples: float, refreshes: float, word: str, tmp_path: Path) -> None:
    """A weight of 9 beside 1: 0.95 times 0.9 is 0.855 of a million, and of 60."""
    together = replace(ROW, kind="together", weight=9.0, samples_per_s=samples, refreshes_per_s=refreshes)
    other = replace(ROW, kind="together", view="map", weight=1.0, refresh_hz=5.0)
    console = Console(record=True, width=160)
    for item in report([ROW, together, other], tmp_path):
        console.print(item)
    assert word in console.export_text()


def test_other_measurements_of_running_walls_name_this_one() -> None:
    with pytest.raises(ConfigError, match="only one view can be measured so; accepted: one view, or"):
        load_without_windows(MAP_INSET)


def test_counts_are_checked() -> None:
    assert check_counts("1, 4,16") == (1, 4, 16)
    assert check_counts("") == ()
    with pytest.raises(ConfigError, match="--counts 0: wanted numbers of views from 1 to 64, or nothing"):
        check_counts("0,2")
