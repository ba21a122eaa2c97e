"""`wall measure updates`: views at several rates, and what is said of equal runs."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from rich.console import Console

from wall.config.loading import load
from wall.roles.plan import make_layout
from wall.study.live.updates import Row, at_rates, rates_of, report
from wall.study.live.views import grid_of

FOUR_VIEWS = Path(__file__).parents[3] / "configs/views/four_views.yaml"
ROW = Row(
    config="four", method="adaptive", barrier=False, views=5, refresh_hz=[60.0, 30.0, 15.0, 5.0, 60.0],
    refreshes_per_s=[40.0, 29.0, 15.0, 5.04, 50.0], sent_per_s=500.0, edits_per_s=480.0, updates_per_s=120.0,
    edits_together=0.97, updates_shown=0.5, updates_shared=0.25, latency_p50_ms=20.0, latency_p95_ms=40.0,
    samples_per_s=100000, other_cores=0.5, commit="", machine="", command="",
)  # fmt: skip


def test_copies_ask_for_rates_by_turns_and_one_renderer_has_them_all() -> None:
    loaded = at_rates(grid_of(load(FOUR_VIEWS), 6), barrier=True)
    assert [view.refresh_hz for view in loaded.config.views] == [60.0, 30.0, 15.0, 5.0, 60.0, 30.0]
    layout = make_layout(loaded)
    assert len(layout.regions) == 1
    assert layout.config.barrier


def test_rates_are_medians_of_the_views_that_ask_for_the_same() -> None:
    assert rates_of([ROW, replace(ROW, refreshes_per_s=[42.0, 31.0, 15.0, 5.0, 60.0])]) == "46, 30, 15, 5.0"


def test_the_table_has_a_line_for_each_number_of_views_with_and_without_a_barrier(tmp_path: Path) -> None:
    console = Console(record=True, width=200)
    rows = [ROW, replace(ROW, edits_together=0.99), replace(ROW, edits_together=0.5), replace(ROW, barrier=True)]
    for item in report(rows, tmp_path):
        console.print(item)
    lines = [line for line in console.export_text().splitlines() if "adaptive" in line]
    assert len(lines) == 2
    assert "97%" in lines[0]
