"""The arithmetic and the shape of measurements; how fast anything is decides no test."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from wall.data import BACKGROUND
from wall.errors import ConfigError, RunError
from wall.measure import record, speed
from wall.measure.tracing import T_FAR, Bench
from wall.tracing import embree, kernels
from wall.tracing.packet import PRIMARY, SHADOW

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


def test_failed_measurement_does_not_lose_the_others(monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(rounds: int, seconds: float) -> list[record.Row]:
        raise ZeroDivisionError("no samples")

    def works(rounds: int, seconds: float) -> list[record.Row]:
        return [record.bounded("decode", 1.0, 1.0, unit="u", below=True)]

    monkeypatch.setattr(speed, "GROUPS", ((("encode",), broken), (("decode",), works)))
    rows = list(speed.measure([], quick=True, say=lambda names: None))
    assert [(row.metric, row.met) for row in rows] == [("encode", None), ("decode", True)]
    assert "ZeroDivisionError" in rows[0].note


def test_bare_rays_are_as_many_as_tracing_sends(compiled_only: None) -> None:
    bench = Bench("courtyard")
    work = bench.tracer._work
    work.counts[:] = 0
    kernels.trace(*bench.arguments(bench.raster))
    assert work.counts[PRIMARY] == 16 * len(bench.hits)
    assert work.counts[SHADOW] == int((bench.lit != 0).sum())
    assert np.array_equal(bench.found.ravel() == embree.NO_HIT, bench.samples["object"] == BACKGROUND)
    assert bench.stopped.any()
    assert not bench.stopped.all()


@pytest.mark.parametrize("mistake", ["lamp rays in metres", "sun rays cut short", "primary rays turned"])
def test_bare_rays_that_are_not_those_of_tracing_are_refused(compiled_only: None, mistake: str) -> None:
    bench = Bench("courtyard")
    bench.check()
    far = bench.shadows[:, T_FAR]
    if mistake == "lamp rays in metres":  # directions reach from the hit to the lamp: 1 is the lamp
        directions = bench.shadows[:, embree.DIRECTION_X : embree.DIRECTION_X + 48].reshape(-1, 3, 16)
        bench.shadows[:, T_FAR] = np.where(np.isfinite(far), np.linalg.norm(directions, axis=1), far)
    elif mistake == "sun rays cut short":
        bench.shadows[:, T_FAR] = np.where(np.isfinite(far), far, 0.01)
    else:
        bench.hits[:, embree.DIRECTION_X : embree.DIRECTION_X + 16] += np.float32(0.05)
    with pytest.raises(RunError, match="found something else than tracing did"):
        bench.check()
