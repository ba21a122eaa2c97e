"""The arithmetic and the shape of measurements; how fast anything is decides no test."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from small_scenes import scene_of, sphere_mesh
from typer.testing import CliRunner

from wall import cli
from wall.commands import terminal
from wall.core.data import BACKGROUND
from wall.core.errors import ConfigError, RunError
from wall.core.jit import kernel
from wall.study.speed import mitsuba_peer, path_peer, record, runs, speed
from wall.study.speed.kernels.embree_rate import bare_recording
from wall.study.speed.tracing import T_FAR, Bench
from wall.tracing import embree
from wall.tracing.instance_trees import InstanceTrees
from wall.tracing.kernels import trace as kernels
from wall.tracing.kernels.rows import SHADOW_PACKET
from wall.tracing.kernels.trees import any_hits, closest_hits
from wall.tracing.kernels.values import EVERY_OBJECT, PRIMARY_RAYS, SHADOW_RAYS, Recording
from wall.tracing.tracer import workspace
from wall.tracing.tracer_scene import make_tracer_scene

KEYS = {"metric", "value", "unit", "limit", "ratio", "command", "machine", "seed", "commit"}


def test_ratio_is_the_median_of_the_rounds_own_ratios() -> None:
    row = record.compared("m", [1.0, 4.0, 2.0], [2.0, 4.0, 2.5], unit="u", at_least=0.8)
    assert (row.value, row.limit, row.ratio) == (2.0, 2.5, 0.8)
    assert row.met
    assert row.spread == pytest.approx(0.25)
    assert not record.compared("m", [1.0], [2.0], unit="u", at_least=0.8).met


@pytest.mark.parametrize(("value", "below", "met"), [(4.0, True, True), (6.0, True, False), (6.0, False, True)])
def test_bounded_figure_meets_its_limit_on_the_right_side(value: float, below: bool, met: bool) -> None:
    assert record.bounded("m", value, 5.0, unit="u", below=below).met is met


def test_limit_of_zero_is_met_by_zero_alone() -> None:
    assert record.bounded("m", 0.0, 0.0, unit="u", below=True).met
    assert not record.bounded("m", 1.0, 0.0, unit="u", below=True).met
    assert record.bounded("m", 1.0, 0.0, unit="u", below=True).ratio is None


def test_rows_are_json_lines_with_every_promised_key(tmp_path: Path, compiled_only: None) -> None:
    rows = list(speed.measure(["encode"], quick=True, say=lambda names: None))
    speed.write(tmp_path / "speed.jsonl", [*rows, record.skipped("mitsuba_llvm", "u", "b", "absent")])
    lines = [json.loads(line) for line in (tmp_path / "speed.jsonl").read_text().splitlines()]
    assert [line["metric"] for line in lines] == ["mitsuba_llvm", "encode"]
    assert all(line.keys() >= KEYS for line in lines)
    assert lines[0]["value"] is None
    assert lines[1]["value"] > 0
    assert lines[1]["ratio"] == pytest.approx(lines[1]["value"] / lines[1]["limit"])


def test_unknown_metric_is_refused_with_the_known_ones() -> None:
    with pytest.raises(ConfigError, match=r"--only speed: no such metric; accepted: trace_framed, "):
        list(speed.measure(["speed"], quick=True, say=lambda names: None))


def test_failed_measurement_does_not_lose_the_others(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    def broken(rounds: int, seconds: float) -> list[record.Row]:
        raise ZeroDivisionError("no samples")

    def works(rounds: int, seconds: float) -> list[record.Row]:
        return [record.bounded("decode", 1.0, 1.0, unit="u", below=True)]

    monkeypatch.setattr(speed, "GROUPS", ((("encode",), broken), (("decode",), works)))
    rows = list(speed.measure([], quick=True, say=lambda names: None))
    assert [(row.metric, row.met, row.failed) for row in rows] == [("encode", None, True), ("decode", True, False)]
    assert "ZeroDivisionError" in rows[0].note
    result = CliRunner().invoke(cli.app, ["measure", "speed", "-o", str(tmp_path / "speed.jsonl")])
    assert result.exit_code == terminal.FAILED
    assert "decode" in (tmp_path / "speed.jsonl").read_text()


def test_bare_rays_are_as_many_as_tracing_sends(compiled_only: None) -> None:
    bench = Bench("courtyard")
    work = bench.tracer.works[0]
    work.counts[:] = 0
    kernels.trace(*bench.arguments(bench.raster))
    assert work.counts[PRIMARY_RAYS] == 16 * len(bench.hits)
    assert work.counts[SHADOW_RAYS] == int((bench.lit != 0).sum())
    assert np.array_equal(bench.found.ravel() == embree.NO_HIT, bench.samples["object_id"] == BACKGROUND)
    assert bench.stopped.any()
    assert not bench.stopped.all()


@pytest.mark.parametrize("mistake", ["point light rays in metres", "parallel rays cut short", "primary rays turned"])
def test_bare_rays_that_are_not_those_of_tracing_are_refused(compiled_only: None, mistake: str) -> None:
    bench = Bench("courtyard")
    bench.check()
    far = bench.shadows[:, T_FAR]
    if mistake == "point light rays in metres":  # directions reach from the hit to the light: 1 is the light
        directions = bench.shadows[:, embree.DIRECTION_X : embree.DIRECTION_X + 48].reshape(-1, 3, 16)
        bench.shadows[:, T_FAR] = np.where(np.isfinite(far), np.linalg.norm(directions, axis=1), far)
    elif mistake == "parallel rays cut short":
        bench.shadows[:, T_FAR] = np.where(np.isfinite(far), far, 0.01)
    else:
        bench.hits[:, embree.DIRECTION_X : embree.DIRECTION_X + 16] += np.float32(0.05)
    with pytest.raises(RunError, match="found something else than tracing did"):
        bench.check()


@kernel
def ask_twice(trees, work):
    """The nearest hits of a packet's rays, then whether anything is in the way of its shadow rays."""
    closest_hits(trees, work)
    any_hits(trees, work)


def test_recorded_rays_find_what_was_found_when_they_are_asked_alone(compiled_only: None) -> None:
    ball = scene_of([sphere_mesh()])
    trees = InstanceTrees(make_tracer_scene(ball), np.full(len(ball.instances), EVERY_OBJECT, np.uint32))
    trees.place(ball.at(0.0), np.zeros(3))
    packets, valid = embree.aligned((3, embree.RAY_HIT_FLOATS), np.uint32), embree.aligned((3, 16), np.int32)
    record = Recording(packets, valid, np.zeros(3, np.bool_), np.zeros(3, np.uint32), np.zeros(1, np.int64))
    work = workspace(coherent=False)
    for rays in (0, SHADOW_PACKET):  # from z = 4 down, a quarter of a unit apart: the ball has a radius of 1
        packet = work.packet[rays:]
        packet[embree.ORIGIN_X : embree.ORIGIN_X + 16] = np.arange(16) / 4.0
        packet[embree.ORIGIN_Z : embree.ORIGIN_Z + 16], packet[embree.DIRECTION_Z : embree.DIRECTION_Z + 16] = 4.0, -1.0
        packet[embree.T_FAR : embree.T_FAR + 16] = 100.0
    work.bits[embree.GEOMETRY : embree.INSTANCE + 16] = embree.NO_HIT
    work.valid[:], work.shadow_valid[:] = -1, [-1] * 8 + [0] * 8
    ask_twice(trees.trees._replace(recording=record), work)
    found = work.packet[: embree.RAY_HIT_FLOATS].copy(), work.packet[SHADOW_PACKET:][: embree.RAY_FLOATS].copy()
    assert record.asked[0] == 2
    assert record.shadow[:2].tolist() == [False, True]
    assert np.count_nonzero(record.valid) == 16 + 8
    assert (record.packets[0, T_FAR].view(np.float32) == 100.0).all(), "as it was before Embree wrote into it"
    asked = record.packets.view(np.float32)[:2], record.valid[:2], record.shadow[:2], record.flags[:2]
    assert bare_recording(trees.trees.at_rest, *asked, work.arguments) == 2
    assert np.array_equal(asked[0][0, T_FAR], found[0][T_FAR])
    assert 0 < np.isinf(asked[0][1, T_FAR]).sum() < 8
    assert np.array_equal(asked[0][1, T_FAR], found[1][T_FAR])


def test_without_mitsuba_its_metrics_are_skipped_with_the_reason(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(mitsuba_peer, "find_spec", lambda name: None)
    rows = list(speed.measure(["mitsuba_llvm", *path_peer.METRICS], quick=True, say=lambda names: None))
    assert [row.metric for row in rows] == [*path_peer.METRICS, "mitsuba_llvm"]
    assert all(row.value is None and "Mitsuba is not installed" in row.note for row in rows)


SUMMARY = {
    "seconds": 2.0, "refreshes": 59, "samples_shown": 3e6, "head_cores": 0.2, "samples_traced": 129600,
    "bytes": 1557760, "latency_ms": {"p50": 30.0, "p95": 50.0, "p99": 60.0},
}  # fmt: skip


@pytest.mark.parametrize(("change", "met"), [({}, True), ({"head_cores": 0.6}, False), ({"refreshes": 40}, False)])
def test_compositor_that_saves_its_time_by_missing_refreshes_misses_the_bar(
    change: dict[str, float], met: bool
) -> None:
    assert runs.compositor_row(SUMMARY | change).met is met


def test_latency_is_in_refresh_intervals_of_the_median() -> None:
    row = runs.latency_row(SUMMARY)
    assert row.value == pytest.approx(0.9)
    assert row.met


def test_run_that_showed_no_input_has_no_latency() -> None:
    with pytest.raises(RunError, match="no input"):
        runs.latency_row(SUMMARY | {"latency_ms": dict.fromkeys(("p50", "p95", "p99"), 0.0)})


@pytest.mark.parametrize(("more", "met"), [(0, True), (12, False)])
def test_still_view_that_goes_on_sending_misses_the_bar(more: int, met: bool) -> None:
    row = runs.static_row(SUMMARY, SUMMARY | {"bytes": 1557760 + more})
    assert (row.value, row.met) == (more, met)


def test_still_view_that_was_never_complete_proves_nothing() -> None:
    with pytest.raises(RunError, match="not complete"):
        runs.static_row(SUMMARY | {"samples_traced": 0, "bytes": 0}, SUMMARY | {"bytes": 0})


def test_memory_is_that_of_the_largest_renderer() -> None:
    ranks = [("head", 900), ("renderer", 100), ("renderer", 300), ("compositor", 700)]
    found = {"ranks": [{"role": role, "peak_memory": mb * 2**20} for role, mb in ranks]}
    assert runs.renderer_peak(found) == 300.0
    with pytest.raises(RunError, match="no renderer"):
        runs.renderer_peak({"ranks": found["ranks"][:1]})


def test_a_renderer_above_its_bar_of_memory_is_a_miss() -> None:
    rows = runs.memory_rows(150.0, local_mb=219.0, mpi_mb=200.0)
    assert [(row.metric, row.value, row.limit, row.met) for row in rows] == [
        ("memory_per_rank", 219.0, 200.0, False), ("memory_small", 150.0, 150.0, True),
    ]  # fmt: skip
    assert [row.met for row in runs.memory_rows(151.0, local_mb=199.0)] == [True, False]
