"""`wall measure live` as a user types it: real runs, their rows, pictures and film; nothing is measured twice."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
from PIL import Image
from running import wall, write_config

ORBIT = ", path: {type: orbit, period_s: 8}"
KINDS = {"live.jsonl", "wall-0-1cores", "ideal"}


def measure(config: Path, out: Path) -> list[dict]:
    options = ("--methods", "adaptive,framed", "--cores", 1, "--seconds", 2, "--warm-up", 0.5)
    done = wall("measure", "live", config, *options, "--moments", 6, "--spp", 4, "--out", out)
    assert done.returncode == 0, done.stdout + done.stderr
    return [json.loads(line) for line in (out / "live.jsonl").read_text().splitlines()]


def test_two_methods_are_measured_on_the_wall_and_only_once(tmp_path: Path) -> None:
    config, out = write_config(tmp_path, path=ORBIT), tmp_path / "out"

    rows = measure(config, out)

    assert {path.name for path in out.iterdir()} == KINDS
    assert [(row["config"], row["method"], row["cores"]) for row in rows] == [
        ("wall-0", "adaptive", 1.0), ("wall-0", "framed", 1.0)
    ]  # fmt: skip
    assert rows[0]["times"] == rows[1]["times"], "the same moments of the path for each method"
    assert all(0.5 <= time <= 2.5 for time in rows[0]["times"])
    for row in rows:
        assert 0.0 < row["rmse_display"] < 0.3, "the same scene from about the same place"
        assert 0.0 < row["flip"] < 0.5
        assert 0.0 < row["ssim"] < 1.0
        assert 0.0 < row["refresh_hz"] < 40.0
        assert row["cpu_s"].keys() == {"head", "renderer"}
        assert 0.0 < row["log_cpu_s"] < sum(row["cpu_s"].values()) < 1.3 * row["run_s"], "on one core"
        assert row["latency_p99_ms"] >= row["latency_p50_ms"] > 0.0
        assert row["bytes_per_s"] > row["samples_per_s"] > 0.0
    folder = out / "wall-0-1cores"
    assert np.asarray(Image.open(folder / "strip.png")).std() > 10
    assert (folder / "film.mp4").stat().st_size > 1000
    assert not list(folder.rglob("*.raw")), "recordings are large"
    assert measure(config, out) == rows
