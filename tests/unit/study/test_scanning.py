"""`wall measure rows` knows what a scanning display is to show: rows made for their moments are nearer to it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from wall.core.errors import ConfigError
from wall.roles.plan import Plan
from wall.study.live import command, scanning
from wall.study.live.rewriting import ONE_MOMENT, load_without_windows, moving, with_rows
from wall.study.quality.reference import Reference
from wall.tracing.tracer_scene import make_tracer_scene

ROW_S = 5e-4
TEXT = """\
version: 1
scene: {source: gallery}
wall: {grid: {columns: 1, rows: 1, pixels: [32, 32], size: [0.3, 0.3], ROW}}
views: [{camera: {position: [2.6, 3, 7.1], target: [0, 0.6, -0.3], fov: 45}, path: {type: orbit, period_s: 2}}]
sampling: {method: adaptive}
"""


def config(folder: Path, row: str = f"row_time: {ROW_S}") -> Path:
    path = folder / "scanned.yaml"
    path.write_text(TEXT.replace("ROW", row), encoding="utf-8")
    return path


def plan_of(folder: Path, row: str = f"row_time: {ROW_S}") -> Plan:
    return moving(load_without_windows(config(folder, row)))


@pytest.mark.parametrize(("rotation", "row"), [(0, np.s_[20, :]), (90, np.s_[:, 11])])
def test_a_row_of_the_reference_is_that_of_an_image_of_its_moment(
    compiled_only: None, tmp_path: Path, rotation: int, row: tuple[int, slice]
) -> None:
    """Row 20 is the 21st; column 11 is the 21st row of a display of 32 that is turned clockwise."""
    turned = f", rotation: {rotation}"
    scanned, at_once = plan_of(tmp_path, f"row_time: {ROW_S}{turned}"), plan_of(tmp_path, f"row_time: 0{turned}")
    tracer_scene, time = make_tracer_scene(scanned.scene), 0.1
    own = Reference(scanned, tracer_scene, [time], spp=1, cache=tmp_path)
    whole = Reference(at_once, tracer_scene, [time, time + 20.5 * ROW_S], spp=1, cache=tmp_path)
    own.make([0])
    whole.make([0, 1])

    assert own.key != whole.key
    assert np.array_equal(own.image(0)[row], whole.image(1)[row])
    assert not np.array_equal(own.image(0)[row], whole.image(0)[row])


def test_renderers_know_rows_or_ignore_them_or_make_all_for_the_middle_one(tmp_path: Path) -> None:
    loaded = load_without_windows(config(tmp_path))
    ignored, middle = with_rows(loaded, "ignored"), with_rows(loaded, "middle")

    assert with_rows(loaded, "known") is loaded
    assert [panel.row_time for panel in ignored.config.wall.panels or ()] == [0.0]
    assert [panel.row_time for panel in middle.config.wall.panels or ()] == [ONE_MOMENT]
    assert ignored.config.views[0].light_after_s == 1 / 60
    assert middle.config.views[0].light_after_s == pytest.approx(1 / 60 + 16 * ROW_S)


def test_rows_for_their_moments_are_nearer_than_one_moment_and_that_than_none(
    compiled_only: None, tmp_path: Path
) -> None:
    wanted = scanning.Wanted(out=tmp_path / "out", rate=3e5, seconds=0.1, warm_up_s=0.1, moments=4, spp=4)
    rows = scanning.measure(config(tmp_path), "adaptive", wanted)

    errors = {row.rows: row.rmse_display for row in rows}
    assert errors["known"] < 0.95 * errors["middle"]
    assert errors["middle"] < errors["ignored"]
    assert [row.scan_s for row in rows] == pytest.approx([32 * ROW_S] * 3)
    assert len((tmp_path / "out" / scanning.FILE).read_text().splitlines()) == 3
    assert sum(1 for _ in scanning.report(rows, tmp_path)) == 2


def test_a_wall_whose_rows_are_seen_at_once_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="all rows of its displays are shown at once; accepted: row_time above 0"):
        scanning.measure(config(tmp_path, "row_time: 0"), "framed", scanning.Wanted(out=tmp_path))


def test_words_that_nobody_knows_are_refused() -> None:
    assert command.rows_of("middle") == "middle"
    with pytest.raises(ConfigError, match="--rows some; wanted known, middle, ignored"):
        command.rows_of("some")
