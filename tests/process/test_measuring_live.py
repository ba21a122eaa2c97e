"""`wall measure live` as a user types it: real runs, their rows, images and film; nothing is left behind."""

from __future__ import annotations

import json
import os
import signal
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from running import start, until_written, wall, write_config

ORBIT = ", path: {type: orbit, period_s: 8}"
KINDS = {"live.jsonl", "wall-0-1cores", "reference"}
OPTIONS = ("--methods", "adaptive,framed", "--cores", 1, "--warm-up", 0.3, "--moments", 6, "--spp", 2)
pytestmark = pytest.mark.clock
START_LIMIT_S, STOP_LIMIT_S = 60.0, 30.0  # waits of a busy machine; an interrupted wall has 8 s to end in order


def processes_of(folder: str) -> list[int]:
    """Living processes whose command line names a file of a folder."""
    found = []
    for entry in Path("/proc").iterdir():
        try:
            words = (entry / "cmdline").read_bytes().decode().split("\0")
        except (OSError, UnicodeDecodeError):
            continue
        if entry.name.isdecimal() and any(folder in word for word in words):
            found.append(int(entry.name))
    return found


def test_two_methods_are_measured_on_the_wall(tmp_path: Path) -> None:
    config, out = write_config(tmp_path, path=ORBIT, source="gallery"), tmp_path / "out"

    done = wall("measure", "live", config, *OPTIONS, "--seconds", 1.2, "--out", out)

    assert done.returncode == 0, done.stdout + done.stderr
    rows = [json.loads(line) for line in (out / "live.jsonl").read_text().splitlines()]
    assert {path.name for path in out.iterdir()} == KINDS
    assert [(row["config"], row["method"], row["cores"]) for row in rows] == [
        ("wall-0", "adaptive", 1.0), ("wall-0", "framed", 1.0)
    ]  # fmt: skip
    assert rows[0]["times"] == rows[1]["times"], "the same moments of the path for each method"
    assert all(0.3 <= moment <= 1.5 for moment in rows[0]["times"])
    for row in rows:
        assert 0.0 < row["rmse_display"] < 0.3, "the same scene from about the same place"
        assert 0.0 < row["flip"] < 0.5
        assert 0.0 < row["ssim"] < 1.0
        assert 0.0 < row["refresh_hz"] < 40.0
        assert row["cpu_s"].keys() == {"head", "renderer"}
        assert 0.0 < row["log_cpu_s"] < sum(row["cpu_s"].values()) < 1.3 * row["run_s"], "on one core"
        assert row["latency_p99_ms"] >= row["latency_p50_ms"] > 0.0
        assert min(row["bytes_per_s"], row["samples_per_s"]) > 0.0
    folder = out / "wall-0-1cores"
    assert np.asarray(Image.open(folder / "strip.png")).std() > 10
    assert (folder / "film.mp4").stat().st_size > 1000
    assert not list(folder.rglob("*.raw")), "recordings are large"


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_leaves_no_process_behind(tmp_path: Path, number: int) -> None:
    config, out = write_config(tmp_path, path=ORBIT), tmp_path / "out"
    log = out / "wall-0-1cores" / "adaptive" / "run.log"
    measuring = start("measure", "live", config, *OPTIONS, "--seconds", 60, "--out", out)
    try:
        until_written(log, "starting", START_LIMIT_S)
        assert len(processes_of(str(tmp_path))) >= 2, "this command and the wall"

        os.kill(measuring.pid, number)

        assert measuring.wait(STOP_LIMIT_S) != 0
        assert processes_of(str(tmp_path)) == []
    finally:
        for pid in processes_of(str(tmp_path)):
            os.kill(pid, signal.SIGKILL)
    assert not (out / "live.jsonl").exists()
