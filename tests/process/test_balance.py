"""Real walls with `balance`: borders move to where the load is, and off a renderer that dies, while the wall runs."""

from __future__ import annotations

import io
import os
import signal
import subprocess
import time
import urllib.error
import urllib.request
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image
from running import called, page_of, start, status, summary

from wall.commands.replay import replay

CONFIG = """\
version: 1
scene: {source: courtyard}
wall: {grid: {columns: 2, rows: 1, pixels: [96, 96], size: [0.48, 0.48], bezel: 0.008}}
views: [{id: main, camera: {position: [5.2, 2.6, 6.6], target: [5.0, 2.4, -2.6], fov: 62}, refresh_hz: 30}]
sampling: {method: frameless, samples_per_batch: 512}
graph: {preset: sort-first, balance: true, sinks: [browser, png]}
transport: {heartbeat_s: 0.2, lost_after_s: 20, restarts: 0}
"""
PATIENCE_S = 60.0


@pytest.fixture
def run(tmp_path: Path) -> Iterator[subprocess.Popen[str]]:
    """The wall, the left panel loaded; its folder of results is `out`, it records to `run.events`."""
    config = tmp_path / "wall.yaml"
    config.write_text(CONFIG, encoding="utf-8")
    process = start("run", config, "--out", tmp_path / "out", "--seconds", 90, "--record", tmp_path / "run.events")
    yield process
    process.kill()
    process.wait(20)


def regions_at(address: str) -> list[str]:
    """What each rank renders, as the table says; [] before there is one."""
    try:
        return [rank["region"] for rank in status(address)["ranks"]]
    except urllib.error.HTTPError:  # no image yet
        return []


def image_at(address: str) -> NDArray[np.uint8]:
    with urllib.request.urlopen(address + "wall.png", timeout=5) as answer:
        return np.asarray(Image.open(io.BytesIO(answer.read())).convert("RGB"))


def shared(regions: list[str]) -> bool:
    """Whether the right panel's renderer has a part of the left one."""
    return len(regions) == 3 and regions[2].startswith("r0c0 ") and "; r0c1 96x96+0+0" in regions[2]


def until_shared(address: str) -> None:
    deadline = time.monotonic() + PATIENCE_S
    while not shared(regions_at(address)):
        assert time.monotonic() < deadline, "no border has moved"
        time.sleep(0.1)


def test_the_loaded_panel_is_shared_and_the_run_can_be_replayed(tmp_path: Path, run: subprocess.Popen[str]) -> None:
    until_shared(page_of(run))
    run.terminate()
    assert run.wait(20) == 0
    said = summary(tmp_path / "out")
    assert said["assignments"] >= 1
    assert said["dropped"].get("bad_packet", 0) == 0
    assert all(rank["samples_traced"] > 0 for rank in said["ranks"][1:])
    *_, last = replay(tmp_path / "run.events", ranks=(), jobs=1, say=lambda line: None)
    assert "each with the bits of the run" in str(last)


def test_the_rows_of_a_renderer_that_dies_are_the_others(tmp_path: Path, run: subprocess.Popen[str]) -> None:
    """Under a black sky the whole wall is traced anew, by the one that is left."""
    address, deadline = page_of(run), time.monotonic() + PATIENCE_S
    while len(regions_at(address)) < 3:
        assert time.monotonic() < deadline, "no image"
    children = Path(f"/proc/{run.pid}/task/{run.pid}/children").read_text(encoding="ascii").split()
    os.kill(int(children[0]), signal.SIGKILL)  # rank 1: the left panel
    whole = "r0c0 96x96+0+0; r0c1 96x96+0+0"
    while regions_at(address)[1:] != ["", whole]:
        assert time.monotonic() < deadline, regions_at(address)
    black = [f"sky.{part}=0,0,0" for part in ("zenith", "horizon", "ground")]
    assert called("set", "--out", tmp_path / "out", *black).returncode == 0
    while True:
        image = image_at(address)
        if not image[2, 2].any() and not image[2, -3].any():
            break
        assert time.monotonic() < deadline, "the dead renderer's panel grows old"
    assert image.std() > 5, "what is lit by lamps stays"
    run.terminate()
    run.wait(20)
    assert "1" in summary(tmp_path / "out")["lost"]
