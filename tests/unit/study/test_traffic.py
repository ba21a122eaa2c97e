"""Bytes of planted rows: every expected number is worked out beside it."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path

import pytest

from wall.core.errors import ConfigError
from wall.study.quality import command, methods_streams
from wall.study.quality import rows as files
from wall.study.quality.plots import COLOURS, STREAMED, lines
from wall.study.quality.report import write_report
from wall.study.quality.requirements import COMPLETE, verdicts
from wall.study.quality.rows import Row
from wall.study.quality.summary import is_other
from wall.study.quality.tables import wire_tables
from wall.study.quality.traffic import at_rest, crossovers, moving, traffic

RAW = 3 * 256 * 256 * 60  # bytes a second of 8-bit frames


def row(
    method: str, sent: list[float], *, scene: str = "a", error: float = 0.01, still: list[float] | None = None
) -> Row:
    """A compared refresh a second, 400,000 rays in each."""
    times = [float(k) for k in range(1, len(sent) + 1)]
    return Row(
        scene=scene, method=method, rate=4e5, width=256, height=256, seed=1, clock="virtual", rmse=error,
        rmse_display=error, flip=error, ssim=0.9, flicker=0.01, latency_equivalent_ms=None,
        bytes_per_s=sent[-1] / len(sent), rays=400_000 * len(sent), cpu_s=1.0, secondary=0, cores=1.0, refresh_hz=60.0,
        seconds=times[-1], shown=240, error_over_time=[error] * len(sent), times=times,
        still_s=still or [0.0] * len(sent), reference="g", config="c.yaml", ablation="", commit="0", machine="m",
        command="wall", bytes_over_time=sent, rays_over_time=[4e5 * t for t in times],
    )  # fmt: skip


def test_only_bytes_of_a_moving_image_count_as_such() -> None:
    """2 MB in the first second, 1 in the third: at the second and the last refresh nothing had moved for a second."""
    assert moving(row("adaptive", [2e6, 9e6, 10e6, 19e6], still=[0.0, 1.0, 0.0, 1.0])) == (3e6, 8e5, 2.0)


def test_traffic_is_bytes_a_second_a_sample_and_of_raw_frames() -> None:
    (found,) = traffic([row("adaptive", [2.4e6, 4.8e6])])
    assert (found.bytes_per_s, found.bytes_a_sample) == (2.4e6, 6.0)
    assert found.raw == pytest.approx(2.4e6 / RAW)


def test_scene_that_never_moved_has_no_traffic_of_motion() -> None:
    assert traffic([row("adaptive", [1e6, 2e6], still=[1.0, 2.0])]) == []


def test_rows_that_do_not_say_when_bytes_were_sent_are_left_out(tmp_path: Path) -> None:
    new = json.loads(row("adaptive", [1e6]).json_line())
    old = {key: value for key, value in new.items() if not key.endswith("_over_time") or key == "error_over_time"}
    (tmp_path / "quality.jsonl").write_text(json.dumps(old) + "\n")
    (found,) = files.read(tmp_path / "quality.jsonl")
    assert found.bytes_over_time == []
    assert traffic([found]) == at_rest([found]) == []


def test_at_the_crossover_samples_and_images_cost_the_same() -> None:
    """Images: 2 MB/s over 256 x 256 x 60 pixels a second; samples: 4 bytes. Each solution put back into the costs."""
    rows = [row("adaptive", [1.6e6, 3.2e6]), row("stream_jpeg90", [2e6, 4e6], error=0.012)]
    (found,) = crossovers(rows)
    pixels = 256 * 256
    assert found.bytes_a_pixel == pytest.approx(2e6 / (pixels * 60))
    assert found.density * found.bytes_a_sample == pytest.approx(found.bytes_a_pixel)
    assert found.density_per_s * pixels * 4.0 == pytest.approx(2e6)
    assert found.refresh_hz * pixels * found.bytes_a_pixel == pytest.approx(1.6e6)
    assert found.pixels * 60 * found.bytes_a_pixel == pytest.approx(1.6e6)
    assert found.error == pytest.approx(1.2)


def test_crossover_needs_samples_of_the_same_scene() -> None:
    assert crossovers([row("adaptive", [1e6], scene="a"), row("stream_jpeg90", [1e6], scene="b")]) == []


def test_rest_is_counted_from_the_stop_on() -> None:
    """The last event was at 1 s; 300 kB are sent from 2 to 3 s, nothing later."""
    stopped = row("adaptive", [1e6, 2e6, 2.3e6, 2.3e6, 2.3e6], still=[0.0, 1.0, 2.0, 3.0, 4.0])
    (found,) = at_rest([stopped])
    assert found.windows[2:5] == (3e5, 0.0, None)  # 1-2 s, 2-4 s, 4-8 s after the stop
    assert found.silent_s == 2.0
    (other,) = at_rest([replace(stopped, bytes_over_time=[1e6, 2e6, 3e6, 3e6, 3.1e6])])
    assert other.silent_s is None


@pytest.mark.parametrize(("sent", "bar", "met"), [
    (2.7e6, "bytes a sample", True), (2.9e6, "bytes a sample", False),  # 6.75 and 7.25 bytes a sample
    (2.9e6, "raw frames", True), (3.0e6, "raw frames", False),  # a quarter of raw is 2.949 MB/s
    (2.7e6, "lossless", True), (2.9e6, "lossless", False),
])  # fmt: skip
def test_wire_bars_are_met_and_missed_by_the_figures(sent: float, bar: str, met: bool) -> None:
    rows = [row("adaptive", [sent]), row("stream_zstd_tiles", [2.8e6])]
    assert [v.met for v in verdicts(rows) if bar in v.what] == [met]


def test_raw_frames_have_a_bar_only_at_the_size_and_rate_that_it_is_about() -> None:
    wide = replace(row("adaptive", [1e6]), width=960, height=540)
    assert not [v for v in verdicts([wide]) if "raw frames" in v.what]


@pytest.mark.parametrize(("more", "met"), [(0.0, True), (1.0, False)])
def test_samples_must_have_stopped_once_there_was_time_for_enough(more: float, met: bool) -> None:
    seconds = math.ceil(COMPLETE * 256 * 256 / 4e5) + 1
    sent = [1e6] * (seconds - 1) + [1e6 + more]
    still = [float(k) for k in range(seconds)]
    assert [v.met for v in verdicts([row("adaptive", sent, still=still)]) if "image at rest" in v.what] == [met]


def test_streams_are_in_no_best_other_and_drawn_only_where_bytes_are() -> None:
    rows = [row("adaptive", [1e6]), row("stream_jpeg90", [1e6])]
    assert not is_other("stream_jpeg90")
    assert [line.name for line in lines(rows)] == ["adaptive"]
    assert [line.name for line in lines(rows, (*COLOURS, *STREAMED))] == ["adaptive", "stream_jpeg90"]
    assert set(STREAMED) == set(methods_streams.METHODS)


def test_report_holds_the_tables_of_the_wire_only_where_images_were_sent_too(tmp_path: Path) -> None:
    still = [0.0, 0.0, 1.0]
    ours, theirs = (row(method, [1e6, 2e6, 2.5e6], still=still) for method in ("adaptive", "stream_jpeg90"))
    assert wire_tables([ours]) == []
    page = write_report(tmp_path, [ours, theirs]).read_text()
    for title in ("Bytes while something moves", "Where samples begin to cost less", "after everything stopped"):
        assert title in page
    for table in wire_tables([ours, theirs]):
        assert {len(line) for line in table.lines} == {len(table.columns)}


def test_method_that_cannot_run_is_left_out_of_patterns_and_refused_by_name(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(methods_streams, "find_spec", lambda name: None)
    assert "stream_h264" not in command.methods_of("", clock="virtual")
    assert command.methods_of("stream_*", clock="virtual") == (
        "stream_raw", "stream_zstd_tiles", "stream_jpeg90", "stream_jpeg90_tiles",
    )  # fmt: skip
    with pytest.raises(ConfigError, match=r"--methods stream_h264: needs PyAV"):
        command.methods_of("adaptive,stream_h264", clock="virtual")
